// SPDX-License-Identifier: BSD-3-Clause
// A module with the results of tests/support/result_sample.hpp, for test_results.py.
#include <pybind11/pybind11.h>

#include "result_attributes.hpp"
#include "support/result_sample.hpp"

PYBIND11_MODULE(result_sample, module) {
  using cairn::test::GrownSample;
  using cairn::test::Sample;
  pybind11::class_<Sample> sample(module, "Sample");
  sample.def(pybind11::init<>());
  cairn::python::bind_fields<Sample>(sample);
  pybind11::class_<GrownSample> grown(module, "GrownSample");
  grown.def(pybind11::init<>()).def_readwrite("spread_member", &GrownSample::spread);
  cairn::python::bind_fields<GrownSample>(grown);
}
