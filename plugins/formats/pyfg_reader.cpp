// SPDX-License-Identifier: BSD-3-Clause
// The text of PyFactorGraph. Variables have names, a letter and a number (A0, L1), whose ids are
// those of `symbol`; each matrix is a covariance, upper triangle row by row; vertices are where
// everything truly was:
//     VERTEX_SE2 | VERTEX_SE3:QUAT              time name  pose
//     VERTEX_XY | VERTEX_XYZ                    name  position
//     VERTEX_SE2:PRIOR and so on                time name  value  covariance
//     EDGE_SE2 | EDGE_SE3:QUAT                  time name name  relative pose  covariance
//     EDGE_SE2_XY | EDGE_SE3_XYZ                time pose point  position in its frame  covariance
//     EDGE_RANGE                                time name name  range variance: not read yet

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include <fmt/core.h>

#include "cairn/graph/information.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "propagate.hpp"
#include "readers.hpp"
#include "tag_lines.hpp"

namespace cairn::formats {
namespace {

constexpr std::string_view kRange = "EDGE_RANGE";

struct Tags {
  std::string_view in_file, own;
};
constexpr std::array<Tags, 2> kPoses{
    {{"VERTEX_SE2", "VERTEX_SE2"}, {"VERTEX_SE3:QUAT", "VERTEX_SE3:QUAT"}}};
constexpr std::array<Tags, 2> kPoints{
    {{"VERTEX_XY", "VERTEX_XY"}, {"VERTEX_XYZ", "VERTEX_TRACKXYZ"}}};
constexpr std::array<Tags, 8> kFactors{{{"VERTEX_SE2:PRIOR", "EDGE_PRIOR_SE2"},
                                        {"VERTEX_SE3:QUAT:PRIOR", "EDGE_PRIOR_SE3:QUAT"},
                                        {"VERTEX_XY:PRIOR", "EDGE_PRIOR_XY"},
                                        {"VERTEX_XYZ:PRIOR", "EDGE_PRIOR_TRACKXYZ"},
                                        {"EDGE_SE2", "EDGE_SE2"},
                                        {"EDGE_SE3:QUAT", "EDGE_SE3:QUAT"},
                                        {"EDGE_SE2_XY", "EDGE_SE2_XY"},
                                        {"EDGE_SE3_XYZ", "EDGE_SE3_TRACKXYZ"}}};

class PyfgReader {
 public:
  PyfgReader(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report)
      : scanner_(text, name), draft_(name, "pyfg", types, options, report) {
    for (const Tags& tags : kPoses) {
      tags_.add(std::string(tags.in_file), [this, tags](Scanner&, Draft&) { read_pose(tags.own); });
    }
    for (const Tags& tags : kPoints) {
      tags_.add(std::string(tags.in_file),
                [this, tags](Scanner&, Draft&) { read_point(tags.own); });
    }
    for (const Tags& tags : kFactors) {
      tags_.add(std::string(tags.in_file),
                [this, tags](Scanner&, Draft&) { read_factor(tags.own); });
    }
    tags_.add(std::string(kRange), [this](Scanner&, Draft&) { pass_range(); });
  }

  Graph read() {
    while (scanner_.next_line()) {
      if (const LineReader* reader = tags_.find(scanner_.tag())) {
        (*reader)(scanner_, draft_);
      } else {
        unknown_tag(scanner_, draft_, draft_.options(), [this] { return tags_.tags(); });
      }
    }
    refuse_ranges();
    const bool has_truth = !draft_.variables().empty();
    Graph graph = draft_.build();
    if (has_truth) keep_truth(graph);
    return graph;
  }

 private:
  void read_pose(std::string_view tag) {
    const std::int32_t kind = draft_.variable_kind(tag);
    scanner_.expect({1, 1 + draft_.variable(kind).size, 0});
    const double stamp = scanner_.read_number();
    const Id id = scanner_.read_symbol();
    scanner_.read_numbers(draft_.add_variable(kind, id, scanner_.line()));
    scanner_.end_line();
    stamps_[id] = stamp;
  }

  void read_point(std::string_view tag) {
    const std::int32_t kind = draft_.variable_kind(tag);
    scanner_.expect({1, draft_.variable(kind).size, 0});
    const Id id = scanner_.read_symbol();
    scanner_.read_numbers(draft_.add_variable(kind, id, scanner_.line()));
    scanner_.end_line();
  }

  void read_factor(std::string_view tag) {
    const std::int32_t kind = draft_.factor_kind(tag, scanner_.tag());
    const Draft::FactorKind& k = draft_.factor(kind);
    scanner_.expect({k.arity, 1 + k.measurement, k.information, "covariance"});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    scanner_.read_number();  // when it was measured
    for (Id& id : slots.ids) id = scanner_.read_symbol();
    scanner_.read_numbers(slots.measurement);
    if (!scanner_.more()) return draft_.take_unit_information(scanner_);
    std::vector<double> covariance(slots.information.size());
    scanner_.read_numbers(covariance);
    scanner_.end_line();
    try {
      const Information information = Information::covariance(unpack(covariance, k.residual));
      std::ranges::copy(information.packed(), slots.information.begin());
    } catch (const Error& error) {
      scanner_.fail(fmt::format("{}: {}", draft_.describe(draft_.factors().back()), error.what()));
    }
    draft_.finish_factor(scanner_);
  }

  void pass_range() {
    if (draft_.options().skip_unknown) return draft_.add_skipped(scanner_);
    if (ranges_++ == 0) first_range_ = scanner_.line();
  }
  void refuse_ranges() const {
    if (ranges_ == 0) return;
    draft_.fail(first_range_,
                fmt::format("{} in {}: ranges are not read yet (ReadOptions::skip_unknown leaves "
                            "them out)",
                            kRange, ranges_ == 1 ? "1 line" : fmt::format("{} lines", ranges_)));
  }

  /// The states that the file gives are the truth, and would be no start but a solution.
  void keep_truth(Graph& graph) {
    ReadReport& report = draft_.report();
    report.truth = graph.clone();
    const Propagation result = propagate_states(graph);
    report.notes.push_back(fmt::format(
        "the vertices are the ground truth, and no initial estimate: states were propagated along "
        "the factors{}",
        result.roots > 1
            ? fmt::format(" from {} starting points that no factor connects", result.roots)
            : ""));
    // Of one robot; those of several are not one course of time.
    const auto letter = [](Id id) { return as_symbol(id)->letter; };
    if (stamps_.empty() || letter(stamps_.begin()->first) != letter(stamps_.rbegin()->first))
      return;
    for (const auto& [id, stamp] : stamps_) report.stamps.push_back(stamp);
  }

  Scanner scanner_;
  Draft draft_;
  TagTable tags_;
  std::map<Id, double> stamps_;
  std::int64_t ranges_ = 0, first_range_ = 0;
};

}  // namespace

Graph read_pyfg(std::string_view text, const std::string& name, Registry& types,
                const ReadOptions& options, ReadReport& report) {
  return PyfgReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
