// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <boost/json/value.hpp>

#include "page.hpp"

namespace cairn::performance {

/// The sections of docs/performance.md, docs/compact_results.md, docs/sparsify_results.md and
/// docs/explore_results.md that the report of a study fills. Throws `std::runtime_error` for a
/// study that it does not know.
std::vector<Section> sections(const boost::json::value& report);

// The parts of `cairn sparsify`, in tables_sparsify.cpp, tables_sparsify_problems.cpp and
// tables_sparsify_edges.cpp.
std::vector<Section> sparsify_sets_sections(const boost::json::array& entries);
std::vector<Section> sparsify_topology_sections(const boost::json::array& entries);
std::vector<Section> sparsify_problems_sections(const boost::json::array& entries);
std::vector<Section> sparsify_whole_sections(const boost::json::array& entries);
std::vector<Section> sparsify_online_sections(const boost::json::array& entries);
std::vector<Section> sparsify_selection_sections(const boost::json::array& entries);
std::vector<Section> sparsify_edges_sections(const boost::json::array& entries);

// The parts of `cairn explore`, in tables_explore.cpp.
std::vector<Section> explore_part_sections(const boost::json::array& entries);
std::vector<Section> explore_floors_sections(const boost::json::array& entries);
std::vector<Section> explore_sensitivity_sections(const boost::json::array& entries);

// Numbers in words
// --------------------------------------------------------------------------------------------
/// Three digits; "-" for what is not a number.
std::string digits(double value);
/// "14" of 14.2, "-"
std::string whole(double value);
/// "3.21 ×", "-"
std::string times(double ratio);
/// "52 %" of 0.52, "-"
std::string percent(double part);
/// "14.2" of 0.0142 s.
std::string milliseconds(double seconds);
std::string megabytes(double bytes);
/// "1.53 M"
std::string count(double value);
/// How far apart two numbers are, relative to the second, or to `rounding` if that is larger: "0",
/// "3e-15".
std::string apart(double value, double reference, double rounding = 0.0);

/// A table of Markdown; the first column is to the left, the others to the right.
class MarkdownTable {
 public:
  explicit MarkdownTable(const std::vector<std::string>& heading);
  void add(const std::vector<std::string>& row);
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

}  // namespace cairn::performance
