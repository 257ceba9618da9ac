#include "core/io/text_cursor.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

namespace strata::io {
namespace {

// A token too long for a double: too small is as good as zero, too large is not a coordinate.
bool is_underflow(std::string_view token) {
  const auto exponent = token.find_first_of("eE");
  if (exponent != std::string_view::npos) return exponent + 1 < token.size() && token[exponent + 1] == '-';
  const auto digit = token.find_first_of("123456789");
  const auto point = token.find('.');
  return point != std::string_view::npos && digit != std::string_view::npos && point < digit;
}

}  // namespace

void TextCursor::skip_space_and_comments() {
  for (skip_space(); at_ != end_ && *at_ == '#'; skip_space()) skip_line();
}

void TextCursor::skip_line() {
  if (at_ == end_) return;
  const void* line_break = std::memchr(at_, '\n', bytes_left());
  at_ = line_break != nullptr ? static_cast<const char*>(line_break) + 1 : end_;
}

std::string_view TextCursor::rest_of_line() {
  skip_blanks();
  const char* from = at_;
  skip_line();
  const char* to = at_;
  while (to > from && is_space(to[-1])) --to;
  return {from, static_cast<std::size_t>(to - from)};
}

double TextCursor::coordinate_here(std::string_view what) {
  const char* from = at_;
  if (from != end_ && *from == '+' && from + 1 != end_ && from[1] != '-') ++from;
  double value = 0;
  const auto [after, error] = std::from_chars(from, end_, value);
  if (error == std::errc::invalid_argument || (after != end_ && !is_space(*after))) expected(what);
  if (error == std::errc::result_out_of_range) {
    if (!is_underflow({from, static_cast<std::size_t>(after - from)})) value = HUGE_VAL;
    else value = 0;
  }
  if (!std::isfinite(value))
    refuse(Reason::SurfaceNonFinite, place(),
           "expected " + std::string(what) + ", found " + shown({at_, static_cast<std::size_t>(after - at_)}) + ", which is not finite");
  at_ = after;
  return value;
}

std::int64_t TextCursor::integer_here(std::string_view what) {
  const char* from = at_;
  if (from != end_ && *from == '+' && from + 1 != end_ && from[1] != '-') ++from;
  std::int64_t value = 0;
  const auto [after, error] = std::from_chars(from, end_, value);
  if (error != std::errc() || (after != end_ && !is_space(*after))) expected(what);
  at_ = after;
  return value;
}

std::uint64_t TextCursor::count_here(std::string_view what) {
  const char* from = at_;
  const std::int64_t value = integer_here(what);
  if (value < 0) {
    at_ = from;
    expected(std::string(what) + " of at least 0");
  }
  return static_cast<std::uint64_t>(value);
}

void TextCursor::expected(std::string_view what) {
  const Place here = place();
  const std::string_view found = rest_of_word();
  const std::string seen = !found.empty() ? shown(found) : at_ == end_ ? "the end of the file" : "the end of the line";
  refuse(Reason::FileMalformed, here, "expected " + std::string(what) + ", found " + seen);
}

Place TextCursor::place_of(const char* at) const { return Place::line(1 + std::count(begin_, at, '\n')); }

bool is_keyword(std::string_view text, std::string_view lower_case) {
  return text.size() == lower_case.size() && std::equal(text.begin(), text.end(), lower_case.begin(), [](char a, char b) {
           return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b;
         });
}

}  // namespace strata::io
