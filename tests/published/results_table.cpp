// SPDX-License-Identifier: BSD-3-Clause
#include "results_table.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <ostream>
#include <stdexcept>

#include <fmt/format.h>

namespace cairn::test {
namespace {

/// The largest relative difference between the solvers.
double spread(const Result& result) {
  double low = INFINITY, high = 0.0;
  for (const auto& [solver, chi2] : result.chi2) {
    low = std::min(low, chi2);
    high = std::max(high, chi2);
  }
  return high > 0.0 ? (high - low) / high : 0.0;
}

std::string verdict(const Result& result) {
  const double ours = result.chi2.begin()->second,
               difference = (ours - result.graph.chi2) / result.graph.chi2;
  if (result.graph.absolute > 0.0) return "rounding noise";
  if (difference < -1e-6) return fmt::format("**better** by {:.2g}", -difference);
  return std::abs(difference) <= 1e-6 ? "reached" : fmt::format("above by {:.2g}", difference);
}

/// In bold where it is above the known minimum.
std::string from_given(double chi2, const PublishedGraph& graph) {
  const double known = graph.absolute > 0.0 ? graph.absolute : graph.chi2 * (1.0 + 1e-6);
  return chi2 <= known ? fmt::format("{:.8g}", chi2) : fmt::format("**{:.8g}**", chi2);
}

void write_defaults(std::ostream& out, const std::vector<DefaultResult>& defaults) {
  out << "\n## With no option\n\n"
         "`cairn optimize FILE` chooses where to start (`--initial auto`), and reaches the known "
         "minimum of every graph\n"
         "(`cubicle.g2o` is refused without `--repair-information`: 5021 of its information "
         "matrices are not positive semidefinite).\n"
         "Beside it, what the states in the file lead to (or odometry, where the file has none), "
         "which is where g2o, GTSAM\n"
         "and Ceres' examples start: by Levenberg-Marquardt and by Ceres, with at most 200 "
         "iterations each. In bold: above the\n"
         "known minimum.\n\n"
         "| graph | metric | known | start chosen | chi2 | from the given states | Ceres from "
         "there "
         "|\n| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const DefaultResult& result : defaults) {
    out << fmt::format("| `{}` | {} | {:.8g} | {} | {} | {} | {} |\n", result.graph.file,
                       result.graph.metric.empty() ? "planar" : result.graph.metric,
                       result.graph.chi2, result.start, from_given(result.chi2, result.graph),
                       from_given(result.given, result.graph),
                       from_given(result.given_ceres, result.graph));
  }
}

}  // namespace

void write_results(const std::string& file, const std::vector<Result>& results,
                   const std::vector<std::string>& solvers,
                   const std::vector<DefaultResult>& defaults) {
  std::ofstream out(file);
  out << "# Results on published graphs\n\n"
         "All published pose graphs and landmark graphs available here, optimised from the initial "
         "guess named, by\n"
         "Levenberg-Marquardt with each of cairn's linear solvers, and by Ceres on the same "
         "residuals and Jacobians. chi2\n"
         "is the sum of squared whitened residuals, without a half. *Published* is the best "
         "minimum known before, for the\n"
         "metric named (in 3D: `g2o`, translation and the vector part of the quaternion, or "
         "`rotation_vector`; in 2D:\n"
         "translation and wrapped angle); it is printed with seven to nine digits, so *reached* "
         "means within 1e-6\n"
         "relative. *Spread* is the largest relative difference among the four. Iterations are "
         "those of "
      << fmt::format("{}", fmt::join(solvers, " / "))
      << ".\n\nThe table is written by the test that checks it:\n\n"
         "    CAIRN_RESULTS=docs/results.md build/release/tests/published_data_test\n\n"
         "| graph | variables | factors | metric | initial guess | published | chi2 found | "
         "verdict | spread | iterations |\n"
         "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Result& result : results) {
    std::vector<std::string> iterations;
    for (const std::string& solver : solvers)
      iterations.push_back(fmt::format("{}", result.iterations.at(solver)));
    out << fmt::format("| `{}` | {} | {} | {} | {} | {:.8g} | {:.10g} | {} | {:.0e} | {} |\n",
                       result.graph.file, result.variables, result.factors,
                       result.graph.metric.empty() ? "planar" : result.graph.metric,
                       result.graph.guess, result.graph.chi2, result.chi2.begin()->second,
                       verdict(result), spread(result), fmt::join(iterations, " / "));
  }
  out << "\n## Better minima\n\n"
         "`pose2d/M3500c.graph` has a lower minimum than the published one: 3765.6031, found by "
         "`gauss_newton` (full\n"
         "steps) from the chordal initial guess with each linear solver, and confirmed by "
         "Levenberg-Marquardt and Ceres\n"
         "when started there. Damped steps from the chordal initial guess converge to the "
         "published minimum. Global\n"
         "optimality of either is not certified.\n"
         "\n"
         "For all other graphs the published minimum is the best that any of cairn's optimizers "
         "found.\n";
  write_defaults(out, defaults);
  if (!out.flush()) throw std::runtime_error("cannot write " + file);
}

}  // namespace cairn::test
