// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/table.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include <fmt/core.h>

namespace cairn::app {
namespace {

constexpr std::size_t kDefaultWidth = 100;
constexpr std::size_t kLeastWidth = 40;   // of output: a narrower terminal wraps lines by itself
constexpr std::size_t kGap = 2;           // between columns
constexpr std::size_t kLeastFolded = 12;  // columns of text that is folded
constexpr std::size_t kLongestWord = 40;  // that a column of folded text makes room for

std::string padded(const std::string& cell, std::size_t width, Table::Align align) {
  const std::size_t used = display_width(cell);
  const std::string space(width > used ? width - used : 0, ' ');
  return align == Table::Align::right ? space + cell : cell + space;
}

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; }

}  // namespace

/// Which columns are shown, and how wide.
struct Table::Layout {
  std::vector<std::size_t> shown;
  std::vector<std::size_t> widths;  // by column
  std::vector<std::string> left_out;
  std::size_t indent = 0;

  std::size_t total() const {
    std::size_t sum = indent + kGap * (shown.size() - 1);
    for (const std::size_t c : shown) sum += widths[c];
    return sum;
  }
};

void Table::add(std::vector<std::string> cells) {
  cells.resize(columns_.size());
  for (std::string& cell : cells) cell = printable(cell);
  rows_.push_back(std::move(cells));
}

Table::Layout Table::natural_layout() const {
  Layout layout;
  layout.indent = display_width(indent_);
  layout.shown.resize(columns_.size());
  std::iota(layout.shown.begin(), layout.shown.end(), std::size_t{0});
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t width = display_width(columns_[c].title);
    for (const auto& row : rows_) width = std::max(width, display_width(row[c]));
    layout.widths.push_back(width);
  }
  return layout;
}

void Table::leave_out(Layout& layout, std::size_t width) const {
  const auto rank = [&](std::size_t c) { return columns_[c].dispensable; };
  while (layout.total() > width) {
    const auto least = std::ranges::max_element(layout.shown, {}, rank);
    if (rank(*least) == 0) return;
    layout.left_out.push_back(columns_[*least].title);
    layout.shown.erase(least);
  }
}

std::size_t Table::least_width(std::size_t column) const {
  std::size_t longest = 0;
  for (const auto& row : rows_) {
    for (const std::string& word : folded(row[column], 1))
      longest = std::max(longest, display_width(word));
  }
  return std::max(
      {kLeastFolded, display_width(columns_[column].title), std::min(longest, kLongestWord)});
}

void Table::fold(Layout& layout, std::size_t width) const {
  if (layout.total() <= width) return;
  std::vector<std::size_t> least;
  for (std::size_t c = 0; c < columns_.size(); ++c) least.push_back(least_width(c));
  while (layout.total() > width) {
    std::size_t widest = columns_.size();
    for (const std::size_t c : layout.shown) {
      if (columns_[c].align != Align::left || layout.widths[c] <= least[c]) continue;
      if (widest == columns_.size() || layout.widths[c] > layout.widths[widest]) widest = c;
    }
    if (widest == columns_.size()) return;
    --layout.widths[widest];
  }
}

std::string Table::part_text(const Layout& layout, const std::vector<std::size_t>& part,
                             bool colour) const {
  const auto line = [&](const auto& cell_of) {
    std::string text = indent_;
    for (const std::size_t c : part) {
      if (c != part.front()) text += std::string(kGap, ' ');
      text += padded(cell_of(c), layout.widths[c], columns_[c].align);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    return text;
  };
  std::string all;
  if (std::ranges::any_of(part, [&](std::size_t c) { return !columns_[c].title.empty(); }))
    all += bold(line([&](std::size_t c) { return columns_[c].title; }), colour) + "\n";
  for (const auto& row : rows_) {
    std::vector<std::vector<std::string>> cells(columns_.size());
    std::size_t height = 1;
    for (const std::size_t c : part) {
      cells[c] = folded(row[c], layout.widths[c]);
      height = std::max(height, cells[c].size());
    }
    for (std::size_t k = 0; k < height; ++k) {
      all += line([&](std::size_t c) { return k < cells[c].size() ? cells[c][k] : ""; }) + "\n";
    }
  }
  return all;
}

std::string Table::text(bool colour, std::size_t width) const {
  Layout layout = natural_layout();
  if (width == 0) {
    width = output_width();
    const auto is_dispensable = [](const Column& column) { return column.dispensable > 0; };
    if (!is_terminal(stdout) && std::ranges::any_of(columns_, is_dispensable))
      width = std::max(width, layout.total());
  }
  leave_out(layout, width);
  fold(layout, width);
  std::string all;
  const std::size_t first = layout.shown.front();
  for (auto next = layout.shown.begin(); next != layout.shown.end();) {
    std::vector<std::size_t> part;
    if (next != layout.shown.begin()) part.push_back(first);
    std::size_t used = layout.indent + (part.empty() ? 0 : layout.widths[first]);
    do {
      used += layout.widths[*next] + (part.empty() ? 0 : kGap);
      part.push_back(*next++);
    } while (next != layout.shown.end() &&
             (part.size() < 2 || used + kGap + layout.widths[*next] <= width));
    all += (all.empty() ? "" : "\n") + part_text(layout, part, colour);
  }
  if (!layout.left_out.empty()) {
    all += fmt::format("{}(no room for: {})\n", indent_, joined(layout.left_out, ", "));
  }
  return all;
}

std::string printable(std::string_view text, bool lines) {
  std::string shown;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto byte = static_cast<unsigned char>(text[k]);
    const auto next = static_cast<unsigned char>(k + 1 < text.size() ? text[k + 1] : ' ');
    if (byte == 0xc2 && next >= 0x80 && next < 0xa0) {  // U+0080 … U+009F, control characters too
      shown += fmt::format("\\x{:02x}", next);
      ++k;
    } else if ((byte < 0x20 || byte == 0x7f) && !(lines && byte == '\n')) {
      shown += fmt::format("\\x{:02x}", byte);
    } else {
      shown += text[k];
    }
  }
  return shown;
}

std::size_t display_width(std::string_view text) {
  std::size_t width = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '\x1b') {  // an escape sequence ends with 'm'
      while (k < text.size() && text[k] != 'm') ++k;
      continue;
    }
    if (!is_continuation(text[k])) ++width;
  }
  return width;
}

std::string shortened(const std::string& text, std::size_t width) {
  if (display_width(text) <= width) return text;
  std::size_t end = 0;
  for (std::size_t columns = 0; end < text.size(); ++end) {
    if (!is_continuation(text[end]) && ++columns > width - 1) break;
  }
  return text.substr(0, end) + "…";
}

std::vector<std::string> folded(const std::string& text, std::size_t width) {
  if (display_width(text) <= width) return {text};
  std::vector<std::string> lines{""};
  for (std::size_t begin = 0; begin < text.size();) {
    std::size_t end = text.find_first_of(" ,", begin);
    end = end == std::string::npos ? text.size() : end + 1;
    std::string word = text.substr(begin, end - begin);
    const std::size_t bare = display_width(word) - (word.back() == ' ' ? 1 : 0);
    if (!lines.back().empty() && display_width(lines.back()) + bare > width) {
      lines.emplace_back();
    }
    lines.back() += word;
    begin = end;
  }
  for (std::string& line : lines) line.erase(line.find_last_not_of(' ') + 1);
  return lines;
}

bool is_terminal(std::FILE* stream) { return ::isatty(::fileno(stream)) == 1; }

std::size_t terminal_width(std::FILE* stream) {
  winsize size{};
  return is_terminal(stream) && ::ioctl(::fileno(stream), TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

std::size_t output_width() {
  const std::size_t width = terminal_width(stdout);
  return width == 0 ? kDefaultWidth : std::max(width, kLeastWidth);
}

bool use_colour(std::FILE* stream) {
  const char* no_colour = std::getenv("NO_COLOR");
  if (no_colour && *no_colour) return false;
  const char* terminal = std::getenv("TERM");
  return is_terminal(stream) && terminal && std::string_view(terminal) != "dumb";
}

std::string bold(std::string_view text, bool colour) {
  const std::string shown = printable(text);
  return colour ? fmt::format("\x1b[1m{}\x1b[0m", shown) : shown;
}

std::string seconds_text(double seconds) {
  if (seconds < 1e-3) return fmt::format("{:.3g} µs", seconds * 1e6);
  if (seconds < 1.0) return fmt::format("{:.3g} ms", seconds * 1e3);
  return seconds < 1000.0 ? fmt::format("{:.3g} s", seconds) : fmt::format("{:.0f} s", seconds);
}

std::string bytes_text(std::int64_t bytes) {
  if (bytes <= 0) return "-";
  constexpr std::array<const char*, 5> kUnits{"B", "KiB", "MiB", "GiB", "TiB"};
  double size = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; size >= 1024.0 && unit + 1 < kUnits.size(); ++unit) size /= 1024.0;
  return unit == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.1f} {}", size, kUnits[unit]);
}

std::string count_text(std::int64_t count) {
  if (count < 1000000) return fmt::format("{}", count);
  return fmt::format("{:.2f} M", static_cast<double>(count) / 1e6);
}

std::string chi2_text(double chi2) { return fmt::format("{:.8g}", chi2); }

std::string plural(std::int64_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::string joined(std::span<const std::string> parts, std::string_view between) {
  std::string text;
  for (const std::string& part : parts) {
    if (&part != &parts.front()) text += between;
    text += part;
  }
  return text;
}

void add_notes(Table& table, const std::vector<std::string>& notes,
               const std::vector<std::string>& doubts, std::size_t most) {
  for (const std::string& doubt : doubts) table.add({"doubt", doubt});
  std::size_t left = most - std::min(most, doubts.size()), more = 0;
  for (const std::string& note : notes) {
    if (std::ranges::find(doubts, note) != doubts.end()) continue;
    if (left == 0) {
      ++more;
      continue;
    }
    --left;
    table.add({"note", note});
  }
  if (more > 0) table.add({"", fmt::format("and {} more: --json", more)});
}

}  // namespace cairn::app
