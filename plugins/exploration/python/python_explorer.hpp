// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <utility>

#include <pybind11/pybind11.h>

#include "cairn/exploration/explorer.hpp"
#include "python_component.hpp"

namespace cairn::python {

/// An explorer written in Python: a function decide(situation), or an object with a method `decide`
/// and, if it has them, `begin(seed)` and `is_worthwhile(situation, path)`.
class PythonExplorer final : public Explorer, public PythonComponent {
 public:
  /// `stop` is called where Ctrl-C has ended one of its calls, and ends the run.
  PythonExplorer(const py::object& explorer, std::function<void()> stop);

  void begin(std::uint64_t seed) override;
  Decision decide(const Situation& situation) override;
  bool is_worthwhile(const Situation& situation, const PlannedPath& path) override;

 private:
  py::object decide_, begin_, is_worthwhile_;  ///< None: it has no such method
  std::function<void()> stop_;
};

}  // namespace cairn::python
