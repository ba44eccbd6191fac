// SPDX-License-Identifier: BSD-3-Clause
#include "bindings.hpp"
#include "cairn/runtime/version.hpp"
#include "pickles.hpp"

PYBIND11_MODULE(_cairn, module) {
  namespace python = cairn::python;
  module.doc() = "The compiled part of cairn, a back end for graph SLAM.";
  module.attr("__version__") = CAIRN_VERSION;
  python::bind_errors(module);
  python::bind_values(module);
  python::bind_factor_types(module);
  python::bind_measurements(module);
  python::bind_factors(module);
  python::bind_graph(module);
  python::bind_files(module);
  python::bind_optimize(module);
  python::bind_covariances(module);
  python::bind_estimates(module);
  python::bind_estimator(module);
  python::bind_evaluation(module);
  python::bind_pictures(module);
  python::bind_subjects(module);
  python::bind_components(module);
  python::refuse_objects_without_init(module);
  python::take_all_protocols(module);
}
