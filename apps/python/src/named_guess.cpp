// SPDX-License-Identifier: BSD-3-Clause
#include "named_guess.hpp"

#include <string_view>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::python {

NamedGuess::NamedGuess(const pybind11::object& name) {
  if (name.is_none()) return;
  name_ = name.cast<std::string>();
  guess_ = default_registry().make<InitialGuess>(name_);
}

std::vector<std::string> NamedGuess::compute(Graph& graph,
                                             const std::atomic<bool>& interrupt) const {
  std::vector<std::string> notes;
  if (!guess_) return notes;
  notes = compute_guess(graph, *guess_, name_,
                        [&](std::string_view, double) { return !interrupt.load(); });
  for (std::string& note : notes) note = fmt::format("initial guess {}: {}", name_, note);
  return notes;
}

}  // namespace cairn::python
