// SPDX-License-Identifier: BSD-3-Clause
#include "ceres_options.hpp"

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

/// Ceres' own parsers take its own names; those names are the choices of the table.
template <class Enum>
Enum parsed(const std::string& name, bool (*parse)(std::string, Enum*)) {
  Enum value{};
  if (!parse(name, &value))
    throw Error(ErrorCode::usage, "optimizer ceres: this Ceres does not know '" + name + "'");
  return value;
}

}  // namespace

OptionTable ceres_option_table() {
  return OptionTable{}
      .choice("linear_solver_type", "sparse_normal_cholesky",
              {"sparse_normal_cholesky", "dense_normal_cholesky", "dense_qr", "dense_schur",
               "sparse_schur", "iterative_schur", "cgnr"},
              "Ceres' linear solver")
      .choice("sparse_library", "suite_sparse", {"suite_sparse", "cx_sparse", "eigen_sparse"},
              "Ceres' sparse linear algebra")
      .choice("trust_region", "levenberg_marquardt", {"levenberg_marquardt", "dogleg"},
              "trust region method")
      .choice("dogleg", "traditional_dogleg", {"traditional_dogleg", "subspace_dogleg"},
              "kind of dogleg")
      .real("initial_radius", 1e4, 1e-30, 1e30,
            "of the trust region: damping begins at its inverse")
      .choice("loss", "none", {"none", "huber", "soft_l_one", "cauchy", "arctan", "tukey"},
              "a loss of Ceres' own, for graphs that have none")
      .real("loss_scale", 1.0, 1e-30, 1e30,
            "whitened residual norm at which that loss turns robust");
}

ceres::Solver::Options ceres_solver_options(const Options& options) {
  ceres::Solver::Options ceres;
  ceres.linear_solver_type =
      parsed(options.text("linear_solver_type"), ceres::StringToLinearSolverType);
  ceres.sparse_linear_algebra_library_type =
      parsed(options.text("sparse_library"), ceres::StringToSparseLinearAlgebraLibraryType);
  ceres.trust_region_strategy_type =
      parsed(options.text("trust_region"), ceres::StringToTrustRegionStrategyType);
  ceres.dogleg_type = parsed(options.text("dogleg"), ceres::StringToDoglegType);
  ceres.initial_trust_region_radius = options.real("initial_radius");
  ceres.logging_type = ceres::SILENT;
  ceres.minimizer_progress_to_stdout = false;
  if (std::string problem; !ceres.IsValid(&problem)) {
    throw Error(ErrorCode::usage,
                "optimizer ceres: Ceres does not accept these options: " + problem);
  }
  return ceres;
}

std::unique_ptr<ceres::LossFunction> make_ceres_loss(const CeresLoss& loss) {
  if (loss.name == "huber") return std::make_unique<ceres::HuberLoss>(loss.scale);
  if (loss.name == "soft_l_one") return std::make_unique<ceres::SoftLOneLoss>(loss.scale);
  if (loss.name == "cauchy") return std::make_unique<ceres::CauchyLoss>(loss.scale);
  if (loss.name == "arctan") return std::make_unique<ceres::ArctanLoss>(loss.scale);
  if (loss.name == "tukey") return std::make_unique<ceres::TukeyLoss>(loss.scale);
  return nullptr;
}

}  // namespace cairn
