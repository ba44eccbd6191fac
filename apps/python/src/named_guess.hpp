// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/initial_guess.hpp"

namespace cairn::python {

/// The initial guess of a name; None: none, the states stay as they are.
class NamedGuess {
 public:
  explicit NamedGuess(const pybind11::object& name);
  /// Null: none.
  InitialGuess* guess() const { return guess_.get(); }
  const std::string& name() const { return name_; }
  /// Without the interpreter's lock; returns notes. It ends early once `interrupt` is true.
  std::vector<std::string> compute(Graph& graph, const std::atomic<bool>& interrupt) const;

 private:
  std::string name_;
  std::unique_ptr<InitialGuess> guess_;
};

}  // namespace cairn::python
