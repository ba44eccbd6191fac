// SPDX-License-Identifier: BSD-3-Clause
// Marginal covariances of a graph, as arrays.
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/covariance.hpp"
#include "cairn/typed/symbol.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

using Pairs = std::vector<std::pair<Id, Id>>;

/// The tangent size of all variables on one side of the pairs, which must be the same.
int common_size(const Graph& graph, const Pairs& pairs, Id std::pair<Id, Id>::*side) {
  if (pairs.empty()) return 0;
  const auto size_of = [&](Id id) { return graph.type(index_of(graph, id)).tangent_size(); };
  const int size = size_of(pairs.front().*side);
  for (const auto& pair : pairs) {
    const int other = size_of(pair.*side);
    if (other == size) continue;
    throw Error(ErrorCode::usage,
                fmt::format("an array has blocks of one size, and that of variable {} is {}, of {} "
                            "{}: ask for each type by itself, as in marginals(graph, "
                            "graph.ids('VERTEX_XY'))",
                            id_text(pairs.front().*side), size, id_text(pair.*side), other));
  }
  return size;
}

py::array_t<double> blocks(BoundGraph& bound, const Pairs& pairs, const std::string& solver) {
  const GraphUse use(bound);
  const int rows = common_size(use.graph(), pairs, &std::pair<Id, Id>::first);
  const int columns = common_size(use.graph(), pairs, &std::pair<Id, Id>::second);
  std::vector<double> numbers;
  {
    const py::gil_scoped_release unlocked;
    if (!pairs.empty())
      numbers = cairn::detail::covariance_blocks(use.graph(), pairs, solver, default_registry());
  }
  return blocks_of(numbers, static_cast<std::size_t>(rows), static_cast<std::size_t>(columns));
}

py::object marginals(BoundGraph& bound, const py::object& ids, const std::string& solver) {
  Pairs pairs;
  const Ids names = one_or_several(ids, "ids");
  for (const Id id : span_of(names)) pairs.emplace_back(id, id);
  py::object all = blocks(bound, pairs, solver);
  return is_one_id(ids) ? all[py::int_(0)] : all;
}

py::array_t<double> cross_covariances(BoundGraph& bound, const py::object& ids,
                                      const std::string& solver) {
  const Ids names = ids_of(ids, "pairs", 2);
  if (names.size() > 0 && names.shape(1) != 2) {
    throw Error(ErrorCode::usage,
                fmt::format("pairs: the shape is {}, expected (n, 2)", shape_text(names)));
  }
  Pairs pairs;
  const std::span<const Id> all = span_of(names);
  for (std::size_t k = 0; k < all.size(); k += 2) pairs.emplace_back(all[k], all[k + 1]);
  return blocks(bound, pairs, solver);
}

}  // namespace

void bind_covariances(py::module_& module) {
  module.def(
      "marginals", &marginals, py::arg("graph"), py::arg("ids"), py::kw_only(),
      py::arg("linear_solver") = "block_cholesky",
      R"(Marginal covariances of variables of one tangent size d, at the present estimate: (d, d) of one id, (n, d, d) of several.

They are of the step delta with x_true = x.retract(delta): for a pose metres along its own axes, then radians. Fixed and
anchored variables are certain, and all others uncertain relative to them. Factorises once for all; an Error ("numerical")
says why where the graph does not determine them.)");
  module.def(
      "cross_covariances", &cross_covariances, py::arg("graph"), py::arg("pairs"), py::kw_only(),
      py::arg("linear_solver") = "block_cholesky",
      R"(Covariances of pairs of variables: (n, d_a, d_b) for pairs (n, 2) of ids (a, b); see `marginals`.)");
}

}  // namespace cairn::python
