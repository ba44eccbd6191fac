// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

/// States, tangent vectors and matrices of any size.
struct AnySize {
  using State = std::vector<double>;
  using Tangent = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
};

/// Those of poses in the plane or in space, without allocation. Of a `State` the first ambient_size
/// doubles count, the others are zero.
struct PoseSize {
  static constexpr int kMostAmbient = 16, kMostTangent = 6;
  using State = std::array<double, kMostAmbient>;
  using Tangent = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMostTangent, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor,
                               kMostTangent, kMostTangent>;
};

/// The Lie group of a variable type with states by value instead of pointers to storage (the
/// ability `LieGroup`). The type must outlive it. Results are those of the type; over many steps
/// rounding errors take them off the group, and `normalized` projects them back.
template <class Size>
class BasicStateGroup {
 public:
  using State = typename Size::State;      ///< ambient_size doubles
  using Tangent = typename Size::Tangent;  ///< tangent_size
  using Matrix = typename Size::Matrix;    ///< tangent × tangent
  using View = std::span<const double>;    ///< a state anywhere

  /// Throws `Error` (usage) if the type forms no Lie group, or does not fit the sizes.
  explicit BasicStateGroup(const VariableType& type)
      : type_(&type),
        group_(type.lie_group()),
        ambient_(type.ambient_size()),
        tangent_(type.tangent_size()) {
    if (!group_) {
      throw Error(ErrorCode::usage, std::string(type.tag()) +
                                        " forms no Lie group (it lacks the ability LieGroup); "
                                        "poses such as VERTEX_SE2 and VERTEX_SE3:QUAT do");
    }
    if constexpr (requires { Size::kMostAmbient; }) {
      if (ambient_ > Size::kMostAmbient || tangent_ > Size::kMostTangent) {
        throw Error(ErrorCode::usage, std::string(type.tag()) + " has " + std::to_string(tangent_) +
                                          " degrees of freedom, and a pose at most 6");
      }
    }
  }

  int ambient_size() const { return ambient_; }
  int tangent_size() const { return tangent_; }

  State state(View x) const {
    State copy = zero();
    std::copy_n(x.begin(), ambient_, copy.begin());
    return copy;
  }
  View view(const State& x) const { return {x.data(), static_cast<std::size_t>(ambient_)}; }

  State identity() const {
    State x = zero();
    type_->identity(x.data());
    return x;
  }
  /// a b
  State compose(View a, View b) const {
    State ab = zero();
    group_->compose(a.data(), b.data(), ab.data());
    return ab;
  }
  /// a⁻¹
  State inverse(View a) const {
    State inverse = zero();
    group_->inverse(a.data(), inverse.data());
    return inverse;
  }
  /// a⁻¹ b: b in the frame of a.
  State between(View a, View b) const { return compose(inverse(a), b); }
  State exp(const Tangent& delta) const {
    State a = zero();
    group_->exp(delta.data(), a.data());
    return a;
  }
  Tangent log(View a) const {
    Tangent delta(tangent_);
    group_->log(a.data(), delta.data());
    return delta;
  }
  /// Ad(a): a exp(δ) a⁻¹ = exp(Ad(a) δ).
  Matrix adjoint(View a) const {
    Matrix Ad(tangent_, tangent_);
    group_->adjoint(a.data(), Ad.data());
    return Ad;
  }
  /// The state in canonical form (unit quaternion, wrapped angle).
  State normalized(State x) const {
    type_->normalize(x.data());
    return x;
  }

 private:
  State zero() const {
    if constexpr (requires { Size::kMostAmbient; }) {
      return {};
    } else {
      return State(static_cast<std::size_t>(ambient_));
    }
  }

  const VariableType* type_;
  const LieGroup* group_;
  int ambient_, tangent_;
};

/// Any Lie group.
using StateGroup = BasicStateGroup<AnySize>;
/// Poses, where nothing may be allocated.
using PoseGroup = BasicStateGroup<PoseSize>;

}  // namespace cairn
