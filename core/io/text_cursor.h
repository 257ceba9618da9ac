// A position in a text, with the scanning every text format shares. Whitespace is every byte up to and including ' '.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/io/read_error.h"

namespace strata::io {

class TextCursor {
 public:
  explicit TextCursor(std::string_view text, std::size_t at = 0)
      : begin_(text.data()), at_(text.data() + at), end_(text.data() + text.size()) {}

  [[nodiscard]] bool done() const { return at_ == end_; }
  [[nodiscard]] std::size_t offset() const { return static_cast<std::size_t>(at_ - begin_); }
  [[nodiscard]] std::size_t bytes_left() const { return static_cast<std::size_t>(end_ - at_); }

  // '#' starts a comment that runs to the end of its line (OFF, Medit).
  void skip_space_and_comments();
  void skip_space() {
    while (at_ != end_ && is_space(*at_)) ++at_;
  }
  // Stops before the line break.
  void skip_blanks() {
    while (at_ != end_ && is_space(*at_) && *at_ != '\n') ++at_;
  }
  [[nodiscard]] bool at_line_end() const { return at_ == end_ || *at_ == '\n'; }
  // Moves behind the next line break.
  void skip_line();

  // The next word, empty at the end of the text.
  std::string_view word() {
    skip_space();
    return rest_of_word();
  }
  // The word that starts here, empty when here is whitespace or the end.
  std::string_view rest_of_word() {
    const char* from = at_;
    while (at_ != end_ && !is_space(*at_)) ++at_;
    return {from, static_cast<std::size_t>(at_ - from)};
  }
  // What is left of the line, without whitespace at either end; moves behind the line break.
  std::string_view rest_of_line();

  // The number at the next word, which it must fill. `what` names it in the refusal: "a coordinate". A coordinate that is not a
  // number is FileMalformed; NaN, infinite or beyond the range of a double is SurfaceNonFinite.
  double coordinate(std::string_view what = "a coordinate") {
    skip_space();
    return coordinate_here(what);
  }
  double coordinate_here(std::string_view what);
  std::int64_t integer(std::string_view what) {
    skip_space();
    return integer_here(what);
  }
  std::int64_t integer_here(std::string_view what);
  // An integer of at least 0.
  std::uint64_t count(std::string_view what) {
    skip_space();
    return count_here(what);
  }
  std::uint64_t count_here(std::string_view what);

  // Refuses with "expected WHAT, found 'word'" for the word that starts here.
  [[noreturn]] void expected(std::string_view what);
  // The line of the current position; costs a walk from the start of the text, so for messages only.
  [[nodiscard]] Place place() const { return place_of(at_); }

  static bool is_space(char c) { return static_cast<unsigned char>(c) <= ' '; }

 private:
  [[nodiscard]] Place place_of(const char* at) const;

  const char* begin_;
  const char* at_;
  const char* end_;
};

// Compares with a lower-case keyword, without regard to the case of `text`.
bool is_keyword(std::string_view text, std::string_view lower_case);

inline std::string_view as_text(std::span<const char> bytes) { return {bytes.data(), bytes.size()}; }

}  // namespace strata::io
