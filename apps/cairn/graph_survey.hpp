// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/graph/gauge.hpp"
#include "cairn/graph/graph.hpp"

namespace cairn::app {

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

/// What a graph consists of and what looks wrong with it, at the states that it has.
struct GraphSurvey {
  std::vector<VariableCount> variables;
  std::vector<FactorCount> factors;
  std::int64_t odometry = 0;    ///< relative factors between ids that follow each other
  std::int64_t loops = 0;       ///< other relative factors
  std::int64_t chain_gaps = 0;  ///< poses that no relative factor joins to the next pose by id
  std::int64_t doubled = 0;  ///< factors on variables that an earlier one of the type joins already
  Gauge gauge;
  std::int64_t gauge_freedoms = 0;  ///< degrees of freedom that no measurement determines
  std::int64_t degrees_of_freedom =
      0;  ///< residuals minus those of variables that are not constant: the expected chi2
  double chi2 = 0.0;
  std::vector<WorstFactor> worst;       ///< by falling chi2
  std::vector<std::string> suspicions;  ///< a sentence each
};

GraphSurvey survey(const Graph& graph);

}  // namespace cairn::app
