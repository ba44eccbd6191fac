// SPDX-License-Identifier: BSD-3-Clause
// A robot drives a square of four metres a side and recognises the place where it began. The first
// estimate has drifted; optimising finds the corners where the measurements say that they are.
#include <array>
#include <cstdio>
#include <exception>
#include <numbers>
#include <string>

#include "cairn/graph/graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"

int main(int argc, char** argv) try {
  // What is on offer is found when the program runs; a plugin is loaded when one of its names is
  // asked for.
  cairn::Registry registry;
  const auto pose = registry.variable_type("VERTEX_SE2");
  const auto relative_pose = registry.factor_type("EDGE_SE2");

  // The first estimate: x [m], y [m], heading [rad], with the drift of the odometry in it.
  constexpr double kQuarter = std::numbers::pi / 2;
  cairn::Graph graph;
  graph.add_variable(pose, 0, std::array{0.0, 0.0, 0.0});
  graph.add_variable(pose, 1, std::array{4.1, 0.0, kQuarter});
  graph.add_variable(pose, 2, std::array{4.2, 4.1, 2 * kQuarter});
  graph.add_variable(pose, 3, std::array{0.1, 4.2, 3 * kQuarter});

  // Each measurement is the pose of the second in the frame of the first, with the upper triangle
  // of its information.
  const std::array measured{4.0, 0.0, kQuarter};
  const std::array information{100.0, 0.0, 0.0, 100.0, 0.0, 400.0};
  for (int from = 0; from < 4; ++from) {
    graph.add_factor(relative_pose, std::array{from, (from + 1) % 4}, measured, information);
  }

  // Any optimizer with any linear solver, by name: cairn plugins lists them.
  const char* name = argc > 1 ? argv[1] : "levenberg_marquardt:linear_solver=block_cholesky";
  const auto optimizer = registry.make<cairn::Optimizer>(name);
  const cairn::Summary summary = optimizer->optimize(graph);

  std::printf("%s: chi2 %.3f -> %.3g\n", std::string(to_string(summary.status)).c_str(),
              summary.initial_chi2, summary.final_chi2);
  for (int k = 0; k < graph.variable_count(); ++k) {
    const auto x = graph.state(k);
    std::printf("pose %d  x %6.3f  y %6.3f  heading %6.3f\n", k, x[0], x[1], x[2]);
  }
  return summary.status == cairn::Status::converged ? 0 : 4;
} catch (const std::exception& error) {
  std::fprintf(stderr, "square: %s\n", error.what());
  return 5;
}
