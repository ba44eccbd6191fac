// SPDX-License-Identifier: BSD-3-Clause
#include "table.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include <fmt/format.h>

namespace cairn::app {
namespace {

std::string padded(const std::string& cell, std::size_t width, Table::Align align, bool last) {
  const std::size_t used = display_width(cell);
  const std::string space(width > used ? width - used : 0, ' ');
  if (align == Table::Align::right) return space + cell;
  return last ? cell : cell + space;  // no blanks at the end of a line
}

}  // namespace

void Table::add(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  rows_.push_back(std::move(cells));
}

std::string Table::text(bool colour) const {
  std::vector<std::size_t> widths;
  bool titled = false;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t width = display_width(columns_[c].title);
    titled = titled || width > 0;
    for (const auto& row : rows_) width = std::max(width, display_width(row[c]));
    widths.push_back(width);
  }
  const auto line = [&](const auto& cell_of) {
    std::string text = indent_;
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      if (c > 0) text += "  ";
      text += padded(cell_of(c), widths[c], columns_[c].align, c + 1 == columns_.size());
    }
    text.erase(text.find_last_not_of(' ') + 1);
    return text;
  };
  std::string all;
  if (titled) all += bold(line([&](std::size_t c) { return columns_[c].title; }), colour) + "\n";
  for (const auto& row : rows_) all += line([&](std::size_t c) { return row[c]; }) + "\n";
  return all;
}

std::size_t display_width(std::string_view text) {
  std::size_t width = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto byte = static_cast<unsigned char>(text[k]);
    if (byte == 0x1b) {  // an escape sequence ends with 'm'
      while (k < text.size() && text[k] != 'm') ++k;
      continue;
    }
    if ((byte & 0xc0) != 0x80) ++width;  // not a continuation byte
  }
  return width;
}

bool is_terminal(std::FILE* stream) { return ::isatty(::fileno(stream)) == 1; }

bool use_colour(std::FILE* stream) {
  const char* no_colour = std::getenv("NO_COLOR");
  if (no_colour && *no_colour) return false;
  const char* terminal = std::getenv("TERM");
  return is_terminal(stream) && terminal && std::string_view(terminal) != "dumb";
}

std::string bold(std::string_view text, bool colour) {
  return colour ? fmt::format("\x1b[1m{}\x1b[0m", text) : std::string(text);
}

std::string seconds_text(double seconds) {
  if (seconds < 1e-3) return fmt::format("{:.3g} µs", seconds * 1e6);
  if (seconds < 1.0) return fmt::format("{:.3g} ms", seconds * 1e3);
  return seconds < 1000.0 ? fmt::format("{:.3g} s", seconds) : fmt::format("{:.0f} s", seconds);
}

std::string bytes_text(std::int64_t bytes) {
  if (bytes <= 0) return "-";
  return fmt::format("{:.1f} MB", static_cast<double>(bytes) / 1e6);
}

std::string count_text(std::int64_t count) {
  if (count < 1000000) return fmt::format("{}", count);
  return fmt::format("{:.2f} M", static_cast<double>(count) / 1e6);
}

std::string chi2_text(double chi2) { return fmt::format("{:.8g}", chi2); }

std::string plural(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

}  // namespace cairn::app
