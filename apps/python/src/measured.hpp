// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/graph/elements.hpp"
#include "cairn/types/factor_type.hpp"

namespace cairn::python {

namespace py = pybind11;

/// A measurement as a value: on which variables it is, what was measured, and of which factor type.
struct Measured {
  std::string tag;
  std::vector<Id> ids;
  std::vector<double> numbers;
  std::shared_ptr<const FactorType> own = nullptr;  ///< null: by its tag, from the registry
};
// One class each in Python, which differ in how they are made.
struct MeasuredBetween : Measured {};
struct MeasuredPrior : Measured {};
struct MeasuredPosition : Measured {};
struct MeasuredOrientation : Measured {};
struct MeasuredDirection : Measured {};
struct MeasuredObservation : Measured {};
struct MeasuredBearingRange : Measured {};

/// How certain measurements are, as it is given in Python: one of the three.
struct Noise {
  py::object sigmas, information, covariance;

  /// The packed information of one measurement whose residual has n numbers. Throws `Error` (usage
  /// or input).
  std::vector<double> packed(int n) const;
  /// That of `count` measurements, one after the other; or of one for all, where a matrix or sigmas
  /// have no dimension for the measurements.
  std::vector<double> packed(int n, std::size_t count) const;

 private:
  void check_one_given() const;
};

}  // namespace cairn::python
