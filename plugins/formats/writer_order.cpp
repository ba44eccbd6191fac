// SPDX-License-Identifier: BSD-3-Clause
#include "writer_order.hpp"

#include <algorithm>
#include <numeric>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::formats {

std::vector<int> variables_by_id(const Graph& graph) {
  if (graph.variable_count() == 0) {
    throw Error(ErrorCode::input, "the graph is empty: there is nothing to write");
  }
  std::vector<int> order(static_cast<std::size_t>(graph.variable_count()));
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return graph.id(a) < graph.id(b); });
  return order;
}

void cannot_express(std::string_view format, const std::string& what, std::string_view expected) {
  throw Error(ErrorCode::input,
              fmt::format("format {} cannot express {}; expected {}", format, what, expected));
}

}  // namespace cairn::formats
