// SPDX-License-Identifier: BSD-3-Clause
// Table::latex, and what is needed for it.
#include "cairn/program/latex_table.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/program/table.hpp"

namespace cairn::app {
namespace {

/// By what a text may begin with.
constexpr std::pair<std::string_view, std::string_view> kCommands[] = {
    {"&", "\\&"},
    {"%", "\\%"},
    {"$", "\\$"},
    {"#", "\\#"},
    {"_", "\\_"},
    {"{", "\\{"},
    {"}", "\\}"},
    {"~", "\\textasciitilde{}"},
    {"^", "\\textasciicircum{}"},
    {"\\", "\\textbackslash{}"},
    {"<", "$<$"},
    {">", "$>$"},
    {"|", "$|$"},
    {"\"", "''"},
    {"±", "$\\pm$"},
    {"×", "$\\times$"},
    {"·", "$\\cdot$"},
    {"²", "$^2$"},
    {"³", "$^3$"},
    {"°", "$^\\circ$"},
    {"−", "$-$"},
    {"…", "\\dots{}"},
    {"–", "--"},
    {"→", "$\\to$"},
    {"≤", "$\\leq$"},
    {"≥", "$\\geq$"},
    {"√", "$\\surd$"},
    {"α", "$\\alpha$"},
    {"δ", "$\\delta$"},
    {"Δ", "$\\Delta$"},
    {"λ", "$\\lambda$"},
    {"Λ", "$\\Lambda$"},
    {"µ", "$\\mu$"},
    {"μ", "$\\mu$"},
    {"π", "$\\pi$"},
    {"ρ", "$\\rho$"},
    {"σ", "$\\sigma$"},
    {"Σ", "$\\Sigma$"},
    {"χ", "$\\chi$"},
};

std::string line_of(const std::vector<std::string>& cells) {
  std::string line;
  for (const std::string& cell : cells)
    line += (&cell == &cells.front() ? "" : " & ") + latex_text(cell);
  return line + " \\\\\n";
}

}  // namespace

std::string latex_text(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const auto* const found = std::ranges::find_if(
        kCommands, [&](const auto& command) { return text.starts_with(command.first); });
    const bool plain = found == std::end(kCommands);
    out += plain ? text.substr(0, 1) : found->second;
    text.remove_prefix(plain ? 1 : found->first.size());
  }
  return out;
}

std::string Table::latex() const {
  std::string alignment;
  std::vector<std::string> titles;
  for (const Column& column : columns_) {
    alignment += column.align == Align::right ? 'r' : 'l';
    titles.push_back(column.title);
  }
  std::string text = fmt::format("\\begin{{tabular}}{{{}}}\n\\hline\n", alignment);
  if (std::ranges::any_of(titles, [](const std::string& title) { return !title.empty(); }))
    text += line_of(titles) + "\\hline\n";
  for (const std::vector<std::string>& row : rows_) text += line_of(row);
  return text + "\\hline\n\\end{tabular}\n";
}

}  // namespace cairn::app
