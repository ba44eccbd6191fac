// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/losses_not_written.hpp"

#include <fmt/core.h>

namespace cairn {

std::string losses_not_written(const Graph& graph) {
  if (!graph.has_losses()) return {};
  std::int64_t count = 0;
  for (int f = 0; f < graph.factor_count(); ++f) count += graph.loss(f) != nullptr;
  if (count == 0) return {};
  return fmt::format(
      "the losses of {} factor{} are not in the file: no format has them, and the graph that is "
      "read "
      "from it has none",
      count, count == 1 ? "" : "s");
}

}  // namespace cairn
