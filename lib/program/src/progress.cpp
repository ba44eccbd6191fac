// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/progress.hpp"

#include <algorithm>
#include <cstdio>

#include <fmt/core.h>

#include "cairn/program/table.hpp"

namespace cairn::app {
namespace {

constexpr int kBarWidth = 20;
constexpr std::chrono::milliseconds kRedraw{50};
constexpr std::size_t kUnknownWidth = 80;  // columns of a terminal that does not say

/// Every line at first, then ever fewer, so that a log of a long run stays readable.
bool worth_a_line(int iteration) {
  int step = 1;
  while (iteration >= 20 * step) step *= 10;
  return iteration % step == 0;
}

void write_error(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace

StatusLine::StatusLine(bool quiet) : quiet_(quiet), terminal_(is_terminal(stderr)) {}

void StatusLine::show(std::string_view text) {
  if (quiet_) return;
  if (terminal_) {
    // A line that reaches the last column wraps, and could not be rewritten any more.
    const std::size_t width = terminal_width(stderr);
    const std::string line = shortened(std::string(text), (width == 0 ? kUnknownWidth : width) - 1);
    write_error(fmt::format("\r{}\x1b[K", line));  // \x1b[K wipes what a longer text left behind
  } else {
    write_error(fmt::format("{}\n", text));
  }
  shown_ = true;
}

void StatusLine::clear() {
  if (shown_ && terminal_) write_error("\r\x1b[K");
  shown_ = false;
}

std::string bar(double part, int width) {
  const int full = std::clamp(static_cast<int>(part * width), 0, width);
  return "[" + std::string(full, '#') + std::string(width - full, ' ') + "]";
}

void OptimizationProgress::on_start(const Graph& graph, double chi2) {
  line_.show(fmt::format("{}, {}: chi2 {:.8g}", plural(graph.variable_count(), "variable"),
                         plural(graph.factor_count(), "factor"), chi2));
}

bool OptimizationProgress::on_iteration(const Iteration& iteration, const Graph& /*graph*/,
                                        const Values& /*values*/) {
  if (!due(iteration.number)) return true;
  std::string text = fmt::format("iteration {:3}  chi2 {:.8g}  step {:.2e}", iteration.number,
                                 iteration.chi2, iteration.step_norm);
  if (iteration.lambda > 0) text += fmt::format("  lambda {:.1e}", iteration.lambda);
  if (!iteration.accepted) text += "  rejected";
  if (line_.on_terminal()) {
    const double part = max_iterations_ > 0 ? double(iteration.number) / max_iterations_ : 1.0;
    text = fmt::format("{} {}", bar(part, kBarWidth), text);
  }
  line_.show(text);
  return true;
}

bool OptimizationProgress::due(int iteration) {
  if (line_.silent()) return false;
  if (!line_.on_terminal()) return worth_a_line(iteration);
  const auto now = std::chrono::steady_clock::now();
  if (now - last_shown_ < kRedraw) return false;
  last_shown_ = now;
  return true;
}

bool GuessProgress::operator()(std::string_view what, double part) {
  const auto now = std::chrono::steady_clock::now();
  const auto pause = line_.on_terminal() ? 4 * kRedraw : std::chrono::milliseconds(5000);
  if (now - last_shown_ >= pause) {
    last_shown_ = now;
    const std::string text = fmt::format("initial estimate: {}, {:.0f} %", what, 100.0 * part);
    line_.show(line_.on_terminal() ? bar(part, kBarWidth) + " " + text : text);
  }
  return !interrupt_;
}

void WorkProgress::show(std::optional<double> part, std::string_view text) {
  const auto now = std::chrono::steady_clock::now();
  if (part && now - shown_ < std::chrono::milliseconds(line_.on_terminal() ? 100 : 5000)) return;
  shown_ = now;
  line_.show(part ? fmt::format("{} {}", bar(*part, 30), text) : std::string(text));
}

}  // namespace cairn::app
