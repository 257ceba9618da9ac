#include "client/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <iostream>

#include "client/status.h"

namespace strata::client {
namespace {

constexpr auto kRedraw = std::chrono::milliseconds(100);
constexpr int kBarWidth = 30;
constexpr int kNotes = 12;  // shown; the report has them all

int terminal_width() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 20 ? size.ws_col : 80;
}

std::string bar(double fraction) {
  const int full = static_cast<int>(std::lround(kBarWidth * std::clamp(fraction, 0.0, 1.0)));
  return "[" + std::string(static_cast<std::size_t>(full), '#') + std::string(static_cast<std::size_t>(kBarWidth - full), '.') + "]";
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

}  // namespace

std::string lower_name(const std::string& enum_name, const std::string& prefix) {
  std::string name = enum_name.rfind(prefix, 0) == 0 ? enum_name.substr(prefix.size()) : enum_name;
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}
std::string stage_name(v1::Stage stage) { return lower_name(v1::Stage_Name(stage), "STAGE_"); }
std::string rung_name(v1::Rung rung) { return lower_name(v1::Rung_Name(rung), "RUNG_"); }
std::string state_name(v1::JobState state) { return lower_name(v1::JobState_Name(state), "JOB_STATE_"); }

ProgressView::Style ProgressView::style_for(bool quiet, bool no_progress) {
  if (quiet) return Style::Silent;
  return no_progress || isatty(STDERR_FILENO) == 0 ? Style::Lines : Style::Block;
}

void ProgressView::transfer(const std::string& what, std::int64_t done, std::int64_t total) {
  if (style_ != Style::Block) return;
  headline_ = what;
  const double fraction = total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 0.0;
  bar_ = bar(fraction) +
         format(" %3.0f %%  %.1f of %.1f MB", 100 * fraction, 1e-6 * static_cast<double>(done), 1e-6 * static_cast<double>(total));
  draw(false);
}

void ProgressView::state(v1::JobState state, int queue_position) {
  headline_ = state_name(state);
  if (state == v1::JOB_STATE_QUEUED && queue_position > 0) headline_ += format(", %d ahead", queue_position);
  if (style_ == Style::Lines && state == v1::JOB_STATE_QUEUED) std::cerr << headline_ << '\n';
  bar_.clear();
  draw(true);
}

void ProgressView::progress(const v1::Progress& p) {
  cells_ = std::max(cells_, p.cells());
  headline_ = format("stage %d/%d  %s", static_cast<int>(p.stage()), static_cast<int>(v1::Stage_MAX), stage_name(p.stage()).c_str());
  bar_ = bar(p.fraction()) + format(" %3.0f %%  %.1f s", 100 * p.fraction(), p.elapsed_seconds());
  if (p.has_eta_seconds()) bar_ += format(", about %.0f s to go", p.eta_seconds());
  if (cells_ > 0) bar_ += format("  %lld hexes", static_cast<long long>(cells_));
  if (expected_ > 0) bar_ += format(" (about %lld at the end)", static_cast<long long>(expected_));
  draw(false);
}

void ProgressView::estimate(const v1::Estimate& estimate) { expected_ = estimate.hexes(); }

void ProgressView::tried_again(int attempt) {
  if (style_ == Style::Silent) return;
  clear();
  std::cerr << format("note: the worker was lost; try %d begins\n", attempt);
}

void ProgressView::stage_ended(const v1::StageRecord& record) {
  if (style_ != Style::Lines) return;
  std::cerr << format("%-16s %8.2f s  %7.0f MB\n", stage_name(record.stage()).c_str(), record.seconds(),
                      1e-6 * static_cast<double>(record.peak_memory_bytes()));
}

void ProgressView::quality(const v1::Quality& q) {
  quality_ =
      format("scaled Jacobian min %.3f mean %.3f over %lld hexes", q.all().min(), q.all().mean(), static_cast<long long>(q.all().count()));
  draw(true);
}

void ProgressView::adjustment(const v1::Diagnostic& diagnostic) {
  if (style_ == Style::Silent) return;
  if (++notes_ > kNotes + 1) return;
  clear();
  std::cerr << "note: " << (notes_ > kNotes ? "more of them, in the report" : describe(diagnostic)) << '\n';
}

void ProgressView::clear() {
  if (drawn_ > 0) std::cerr << "\x1b[" << drawn_ << "F\x1b[J" << std::flush;
  drawn_ = 0;
}

void ProgressView::draw(bool force) {
  if (style_ != Style::Block) return;
  const auto now = std::chrono::steady_clock::now();
  if (!force && now - last_ < kRedraw) return;
  last_ = now;
  clear();
  const auto width = static_cast<std::size_t>(terminal_width() - 1);
  for (const std::string& line : {headline_, bar_, quality_}) std::cerr << line.substr(0, width) << '\n';
  std::cerr << std::flush;
  drawn_ = 3;
}

}  // namespace strata::client
