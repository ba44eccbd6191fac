// SPDX-License-Identifier: BSD-3-Clause
#include "information_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "dense/cholesky.hpp"
#include "kept_poses.hpp"

namespace cairn::compact {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A variance that would grow by more than the inverse of this is one of something undetermined.
constexpr double kDetermined = 1e-9;

/// ln |I − A|; −∞ where that is not positive definite.
double log_determinant_of_rest(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> llt(MatrixXd(MatrixXd::Identity(A.rows(), A.cols()) - A));
  if (llt.info() != Eigen::Success) return -kInfinity;
  const Eigen::ArrayXd diagonal = llt.matrixLLT().diagonal();
  if ((diagonal.square() < kDetermined).any()) return -kInfinity;
  return 2.0 * diagonal.log().sum();
}

/// Variables in one vector.
class Places {
 public:
  void add(Id id, Index size) {
    if (places_.try_emplace(id, Place{total_, size}).second) {
      ids_.push_back(id);
      total_ += size;
    }
  }
  bool has(Id id) const { return places_.contains(id); }
  Index operator[](Id id) const { return places_.at(id).first; }
  Index size(Id id) const { return places_.at(id).size; }
  Index total() const { return total_; }
  const std::vector<Id>& ids() const { return ids_; }

 private:
  struct Place {
    Index first = 0, size = 0;
  };
  std::map<Id, Place> places_;
  std::vector<Id> ids_;
  Index total_ = 0;
};

/// Their joint covariance at the estimate.
MatrixXd covariance_of(const Places& variables, Estimator& estimator) {
  MatrixXd S(variables.total(), variables.total());
  for (const Id id : variables.ids()) {
    MatrixXd column(variables.total(), variables.size(id));
    need_covariance(
        estimator.covariance_column(id, variables.ids(),
                                    {column.data(), static_cast<std::size_t>(column.size())}),
        id);
    S.middleCols(variables[id], variables.size(id)) = column;
  }
  return S;
}

/// Of these variables, those that `S`, on `places`, has; zero for others.
MatrixXd block_of(const MatrixXd& S, const Places& places, const Places& of) {
  MatrixXd block = MatrixXd::Zero(of.total(), of.total());
  for (const Id a : of.ids()) {
    for (const Id b : of.ids()) {
      if (!places.has(a) || !places.has(b)) continue;
      block.block(of[a], of[b], of.size(a), of.size(b)) =
          S.block(places[a], places[b], of.size(a), of.size(b));
    }
  }
  return block;
}

/// H of these variables, the blocks that the factors have of them.
MatrixXd information_of(const Places& variables, std::span<const LinearFactor> factors) {
  MatrixXd H = MatrixXd::Zero(variables.total(), variables.total());
  for (const LinearFactor& f : factors) {
    const std::vector<Id>& on = f.factor.variables;
    for (std::size_t a = 0; a < on.size(); ++a) {
      if (!variables.has(on[a])) continue;
      for (std::size_t b = 0; b < on.size(); ++b) {
        if (!variables.has(on[b])) continue;
        H.block(variables[on[a]], variables[on[b]], variables.size(on[a]), variables.size(on[b])) +=
            f.J[a].transpose() * f.J[b];
      }
    }
  }
  return H;
}

/// The covariance of the first variables where all others are known: the inverse of their block of
/// H, with zeros for the others.
MatrixXd covariance_given_others(const MatrixXd& H, Index first) {
  const Eigen::LLT<MatrixXd> llt(MatrixXd(H.topLeftCorner(first, first)));
  MatrixXd whole = MatrixXd::Zero(H.rows(), H.cols());
  whole.topLeftCorner(first, first) = llt.solve(MatrixXd(MatrixXd::Identity(first, first)));
  return whole;
}

/// Rows of J on these variables.
MatrixXd rows_on(const Places& variables, std::span<const LinearFactor* const> factors) {
  Index rows = 0;
  for (const LinearFactor* f : factors) rows += f->J.front().rows();
  MatrixXd J = MatrixXd::Zero(rows, variables.total());
  Index row = 0;
  for (const LinearFactor* f : factors) {
    const std::vector<Id>& on = f->factor.variables;
    const Index count = f->J.front().rows();
    for (std::size_t a = 0; a < on.size(); ++a)
      J.block(row, variables[on[a]], count, f->J[a].cols()) = f->J[a];
    row += count;
  }
  return J;
}

}  // namespace

MatrixXd eliminate(const MatrixXd& J, Index count) {
  const MatrixXd own = J.leftCols(count), others = J.rightCols(J.cols() - count);
  const Eigen::LLT<MatrixXd> llt(MatrixXd(own.transpose() * own));
  return others - own * llt.solve(MatrixXd(own.transpose() * others));
}

double information_about(const MatrixXd& R, const MatrixXd& S, const MatrixXd& S_given) {
  const double all = log_determinant_of_rest(R * S * R.transpose());
  const double given = log_determinant_of_rest(R * S_given * R.transpose());
  // Where R alone determines anything, the difference is one of infinities, or of rounding.
  const double loss = 0.5 * (given - all);
  return std::isfinite(loss) ? std::max(0.0, loss) : kInfinity;
}

bool LinearFactor::is_on(Id variable) const {
  return std::ranges::find(factor.variables, variable) != factor.variables.end();
}

InformationLoss information_loss(Id leaving, bool all, const LeavingPoses& poses,
                                 std::span<const LinearFactor> factors, Index pose_size,
                                 Estimator& estimator) {
  std::vector<const LinearFactor*> measured;
  for (const LinearFactor& f : factors) {
    if (f.is_on(leaving) && (all || !f.factor.type->is_relative())) measured.push_back(&f);
  }
  // With the pose itself first: where all that it measured leaves, it does too.
  Places on, stay;
  on.add(leaving, pose_size);
  if (!all) stay.add(leaving, pose_size);
  for (const LinearFactor* f : measured) {
    for (std::size_t a = 0; a < f->J.size(); ++a) {
      const Id id = f->factor.variables[a];
      on.add(id, f->J[a].cols());
      if (id != leaving) stay.add(id, f->J[a].cols());
    }
  }
  const MatrixXd J = rows_on(on, measured);
  const MatrixXd R = all ? eliminate(J, pose_size) : J;
  const MatrixXd S = covariance_of(stay, estimator);

  Places temporary;
  for (const Id id : poses.others) temporary.add(id, pose_size);
  const Index of_others = temporary.total();
  if (poses.newest) temporary.add(*poses.newest, pose_size);
  const MatrixXd H = information_of(temporary, factors);
  const auto loss = [&](Index unknown) {  // about all but the first temporary poses
    return information_about(R, S, block_of(covariance_given_others(H, unknown), temporary, stay));
  };
  const double map = loss(H.rows());
  return {map, poses.newest ? std::max(0.0, loss(of_others) - map) : 0.0};
}

}  // namespace cairn::compact
