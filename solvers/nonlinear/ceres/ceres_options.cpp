// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_options.hpp"

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

template <class Enum>
Enum parsed(const std::string& name, bool (*parse)(std::string, Enum*)) {
  Enum value{};
  if (!parse(name, &value))
    throw Error(ErrorCode::usage, "optimizer ceres: this Ceres does not know '" + name + "'");
  return value;
}

}  // namespace

ceres::Solver::Options ceres_solver_options(const CeresOptions& options) {
  ceres::Solver::Options ceres;
  ceres.linear_solver_type = parsed(options.linear_solver_type, ceres::StringToLinearSolverType);
  ceres.sparse_linear_algebra_library_type =
      parsed(options.sparse_library, ceres::StringToSparseLinearAlgebraLibraryType);
  ceres.initial_trust_region_radius = options.initial_radius;
  ceres.logging_type = ceres::SILENT;
  ceres.minimizer_progress_to_stdout = false;
  if (std::string problem; !ceres.IsValid(&problem)) {
    throw Error(ErrorCode::usage,
                "optimizer ceres: Ceres does not accept these options: " + problem);
  }
  return ceres;
}

}  // namespace cairn
