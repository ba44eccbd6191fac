// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string_view>

#include "cairn/graph/graph.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

class Registry;

/// A simulated data set: noisy measurements with an initial estimate, and the ground truth.
struct Simulation {
  Graph graph;  ///< estimate: as a robot would have it (odometry), first pose true
  Graph truth;  ///< the same variables at their true states; the same factors
};

/// Makes graphs. The same options and seed give the same graph, bit by bit, on every machine.
class CAIRN_API Generator : public Component {
 public:
  static constexpr std::string_view kKind = "generator";
  ~Generator() override;

  virtual Simulation generate(Registry& types, std::uint64_t seed) = 0;
};

}  // namespace cairn
