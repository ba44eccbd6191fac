// SPDX-License-Identifier: BSD-3-Clause
// Reads a graph in any format, optimises it, says how certain the last pose is, and writes it.
#include <iostream>

#include <cairn/cairn.hpp>

using namespace cairn;

int main(int argc, char** argv) try {
  if (argc != 3) throw Error(ErrorCode::usage, "usage: read_file GRAPH RESULT");
  Graph graph = read(argv[1]);
  std::cout << optimize(graph, "dogleg:linear_solver=block_cholesky");
  const Id last = graph.id(graph.variable_count() - 1);
  std::cout << "standard deviations of " << last << ": "
            << covariance(graph, last).diagonal().cwiseSqrt().transpose() << "\n";
  write(graph, argv[2]);
} catch (const Error& error) {
  std::cerr << "read_file: " << error.what() << "\n";
  return static_cast<int>(error.code());
}
