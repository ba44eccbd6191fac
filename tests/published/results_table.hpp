// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

namespace cairn::test {

/// One published graph: how it is read, where the optimisation starts, and the chi2 that is known
/// of it.
struct PublishedGraph {
  std::string file;    ///< within CAIRN_DATA
  std::string metric;  ///< of slam3d; empty in the plane
  std::string guess;
  double chi2;            ///< published
  double absolute = 0.0;  ///< where chi2 is rounding noise: largest value that counts as reached
};

/// What the solvers made of one graph.
struct Result {
  PublishedGraph graph;
  int variables = 0;
  int factors = 0;
  std::map<std::string, double> chi2;     ///< by solver
  std::map<std::string, int> iterations;  ///< by solver
};

/// What `cairn optimize` does with one graph where no option is given, and what starting from the
/// states as given leads to.
struct DefaultResult {
  PublishedGraph graph;
  std::string start;  ///< the initial guess that was chosen
  double chi2 = 0.0;
  double given = 0.0;        ///< chi2 by Levenberg-Marquardt from the states as given
  double given_ceres = 0.0;  ///< by Ceres from there
};

/// Writes docs/results.md.
void write_results(const std::string& file, const std::vector<Result>& results,
                   const std::vector<std::string>& solvers,
                   const std::vector<DefaultResult>& defaults);

}  // namespace cairn::test
