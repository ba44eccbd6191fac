// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What a graph consists of and what looks wrong with it, at the states that it has. chi2 here is
/// Σ ‖r‖² without a loss, since a loss would hide what is looked for.
struct GraphSurvey {
  struct VariableCount {
    std::string tag;
    std::int64_t count = 0;
    int tangent_size = 0;
    std::int64_t fixed = 0;
  };
  struct FactorCount {
    std::string tag;
    std::int64_t count = 0;
    int residual_size = 0;
    double chi2 = 0.0;
    std::string metric;  ///< empty where there is no choice
  };
  struct WorstFactor {
    std::string name;  ///< "EDGE_SE2 3 17"
    double chi2 = 0.0;
  };

  std::vector<VariableCount> variables;  ///< per type
  std::vector<FactorCount> factors;      ///< per type
  std::int64_t odometry = 0;             ///< relative factors between ids that follow each other
  std::int64_t loops = 0;                ///< other relative factors
  std::int64_t chain_gaps = 0;  ///< poses that no relative factor joins to the next pose by id
  std::int64_t doubled = 0;  ///< factors on variables that an earlier one of the type joins already
  Gauge gauge;
  std::int64_t gauge_freedoms = 0;  ///< degrees of freedom that no measurement determines
  /// As `degrees_of_freedom` (plausibility.hpp): what chi2 of a good model is near.
  std::int64_t degrees_of_freedom = 0;
  double chi2 = 0.0;
  std::vector<WorstFactor> worst;       ///< at most five, by falling chi2
  std::vector<std::string> suspicions;  ///< a sentence each
};

/// Surveys a graph. Among the suspicions are: no factors, variables without any factor, parts that
/// no factor joins, doubled factors, gaps in the odometry, priors on a part of an orientation in
/// space, what the measurements leave free, more unknowns than measurements, chi2 above 100 times
/// or below 1/100 of its degrees of freedom, and (from 100 factors on) five factors that make more
/// than half of chi2. Takes one evaluation of all residuals.
CAIRN_API GraphSurvey survey_graph(const Graph& graph);

}  // namespace cairn
