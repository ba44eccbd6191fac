// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

namespace cairn::test {

/// A tabular of LaTeX, as far as a compiler of LaTeX would check it.
struct LatexTabular {
  std::string alignment;                       ///< a letter for each column
  std::vector<std::vector<std::string>> rows;  ///< the titles, if there are any, are the first
};

/// Reads one tabular, with comments before it. Fails the test where LaTeX would refuse it: braces
/// or $ that do not balance, a character that has a meaning and no backslash, or a row with more or
/// fewer cells than columns.
inline LatexTabular latex_tabular(std::string_view text) {
  LatexTabular table;
  constexpr std::string_view kBegin = "\\begin{tabular}{", kEnd = "\\end{tabular}";
  const std::size_t begin = text.find(kBegin), end = text.find(kEnd);
  if (begin == text.npos || end == text.npos || text.find(kBegin, begin + 1) != text.npos) {
    ADD_FAILURE() << "not one tabular: " << text;
    return table;
  }
  text = text.substr(begin + kBegin.size(), end - begin - kBegin.size());
  table.alignment = text.substr(0, text.find('}'));
  EXPECT_EQ(table.alignment.find_first_not_of("lrc"), std::string::npos) << table.alignment;
  text.remove_prefix(table.alignment.size() + 1);
  std::vector<std::string> row{""};
  int depth = 0;
  bool mathematics = false;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    if (text.substr(k).starts_with("\\hline")) {
      EXPECT_EQ(row.size() + row.front().size(), 1U) << "\\hline within a row";
      k += 5;
    } else if (text.substr(k).starts_with("\\\\")) {
      EXPECT_EQ(depth, 0) << "braces of a row do not balance";
      EXPECT_FALSE(mathematics) << "a $ of a row is not closed";
      EXPECT_EQ(row.size(), table.alignment.size()) << "cells of a row that begins " << row.front();
      table.rows.push_back(std::move(row));
      row = {""};
      ++k;
    } else if (c == '\\') {
      row.back() += text.substr(k, 2);
      ++k;
    } else if (c == '&' && depth == 0) {
      row.emplace_back();
    } else if (c != '\n') {
      depth += int(c == '{') - int(c == '}');
      EXPECT_GE(depth, 0) << "a brace is closed that was not opened";
      mathematics = mathematics != (c == '$');
      const std::string_view meaning = mathematics ? "%#&~" : "%#&~_^<>|\"";
      EXPECT_EQ(meaning.find(c), std::string_view::npos) << "no backslash before " << c;
      if (c != ' ' || (!row.back().empty() && row.back().back() != ' ')) row.back() += c;
    }
  }
  EXPECT_EQ(row.size() + row.front().size(), 1U) << "a row without an end";
  for (auto& cells : table.rows)
    for (std::string& cell : cells)
      while (cell.ends_with(' ')) cell.pop_back();
  return table;
}

}  // namespace cairn::test
