// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

class Graph;

/// Chooses factors of a graph, such as those that get a robust loss. By default all.
class CAIRN_API FactorSelector {
 public:
  using Predicate = std::function<bool(const Graph&, int position)>;
  enum class Kind { all, loops, tag, predicate };

  FactorSelector() = default;
  static FactorSelector all() { return {}; }
  /// Factors that close a loop: between two variables of one type that do not follow each other in
  /// the order of their ids among the variables of that type. Odometry, priors and observations of
  /// landmarks do not.
  static FactorSelector loops() { return FactorSelector(Kind::loops, {}, {}); }
  /// Factors of the type with that tag.
  static FactorSelector tag(std::string tag) {
    return FactorSelector(Kind::tag, std::move(tag), {});
  }
  /// Factors for which a function says so.
  static FactorSelector where(Predicate predicate) {
    return FactorSelector(Kind::predicate, {}, std::move(predicate));
  }
  /// "all", "loops", or the tag of a factor type.
  static FactorSelector parse(std::string_view text);

  Kind kind() const { return kind_; }
  const std::string& tag() const { return tag_; }
  const Predicate& predicate() const { return predicate_; }

 private:
  FactorSelector(Kind kind, std::string tag, Predicate predicate)
      : kind_(kind), tag_(std::move(tag)), predicate_(std::move(predicate)) {}

  Kind kind_ = Kind::all;
  std::string tag_;
  Predicate predicate_;
};

/// For each factor by position, whether it is selected.
CAIRN_API std::vector<bool> select(const Graph& graph, const FactorSelector& which);

/// For each factor by position, whether it closes a loop (`FactorSelector::loops`).
CAIRN_API std::vector<bool> loop_closures(const Graph& graph);

}  // namespace cairn
