// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"
#include "recorded_links.hpp"
#include "registrations.hpp"

namespace cairn::registration {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Error bad_data(ErrorCode code, const std::string& message) {
  return {code, "registration simulated: " + message};
}

/// By more than rounding: on a grid of streets many pairs are just as far apart as the range, and
/// are to be out of it on every machine.
bool less(double a, double b) { return a < (1.0 - 1e-9) * b; }

/// A sensor that measures the true relative poses with noise:
///
///     z = x_earlier⁻¹ x_later exp(ξ),   ξ ~ N(0, Σ)
///
/// as a factor of the type of the recording's odometry, with the covariance Σ. What comes of a pair
/// is decided for it alone, by the seed and the two ids: first whether it fails to match, then
/// whether it matches falsely, then the noise. So a higher failure rate takes matches away and
/// changes none of those that are left.
class Simulated final : public Registration, public FalseMatches {
 public:
  explicit Simulated(const SimulatedOptions& sensor) : sensor_(sensor) {}

  void begin(const RegistrationData& data) override {
    if (!data.truth) {
      throw bad_data(ErrorCode::usage,
                     "needs the truth: give a graph with the true states of the recording's poses "
                     "(--truth FILE, in C++ RegistrationData::truth), or take the registration "
                     "'recorded', which "
                     "answers from the recording itself");
    }
    const RecordedLinks links = recorded_links(data, "simulated");
    if (links.all.empty()) {
      throw bad_data(ErrorCode::input,
                     "the recording has no relative factor between poses, such as EDGE_SE2, so the "
                     "type of the factors to make is unknown");
    }
    odometry_ = links.odometry;
    motions_.emplace(links.pose);
    group_.emplace(links.pose);
    set_noise(median_covariance(*data.recording, links, *group_));
    truth_ = data.truth;  // from here on it can match
  }

  std::vector<Factor> match(Id earlier, Id later) override {
    Match match = measure(earlier, later);
    if (match.outcome == Outcome::none) return {};
    const auto [from, to] = std::minmax(earlier, later);
    std::vector<double> z = match.outcome == Outcome::wrong
                                ? motions_->draw(sensor_.range, match.random)
                                : motions_->perturbed(match.motion, draw_noise(match.random));
    return {group_->to_factor(odometry_, from, to, {std::move(z), covariance_})};
  }

  bool was_false(Id earlier, Id later) const override {
    return measure(earlier, later).outcome == Outcome::wrong;
  }

  void* ability(std::string_view name) override {
    return name == FalseMatches::kAbility ? static_cast<FalseMatches*>(this) : nullptr;
  }

 private:
  enum class Outcome { none, right, wrong };
  struct Match {
    Outcome outcome = Outcome::none;
    std::vector<double> motion;  ///< true one, from the lower id to the higher
    PairRandom random;           ///< for what is left to be drawn
  };

  Match measure(Id earlier, Id later) const {
    if (!truth_) throw std::logic_error("registration simulated: match before begin");
    Match match{.motion = {}, .random = PairRandom(sensor_.seed, earlier, later)};
    if (earlier == later) return match;
    const std::span<const double> from = true_state(std::min(earlier, later));
    match.motion = motions_->between(from, true_state(std::max(earlier, later)));
    const Extent apart = motions_->extent(match.motion);
    if (!less(apart.length, sensor_.range.length) || !less(apart.angle, sensor_.range.angle)) {
      if (match.random.chance(sensor_.far_rate)) match.outcome = Outcome::wrong;
    } else if (!match.random.chance(sensor_.failure_rate)) {
      match.outcome = match.random.chance(sensor_.false_rate) ? Outcome::wrong : Outcome::right;
    }
    return match;
  }

  std::span<const double> true_state(Id id) const {
    const std::optional<int> variable = truth_->find(id);
    if (!variable) {
      throw bad_data(ErrorCode::input, "the truth has no pose " + std::to_string(id));
    }
    const VariableType& type = truth_->type(*variable);
    if (type.tag() != group_->type().tag()) {
      throw bad_data(ErrorCode::input,
                     "in the truth stands " + truth_->describe_variable(*variable) +
                         ", in the recording it is a " + std::string(group_->type().tag()));
    }
    return truth_->state(*variable);
  }

  /// The recording's covariance, but for what the options say.
  void set_noise(const std::vector<double>& recorded) {
    const int n = group_->tangent_size();
    covariance_ = recorded;
    Eigen::Map<MatrixXd> Sigma(covariance_.data(), n, n);
    const auto set = [&](const std::vector<int>& components, double sigma) {
      if (sigma == 0.0) return;
      for (const int k : components) {
        Sigma.row(k).setZero();
        Sigma.col(k).setZero();
        Sigma(k, k) = sigma * sigma;
      }
    };
    set(motions_->translations(), sensor_.sigma_translation);
    set(motions_->rotations(), sensor_.sigma_rotation);
    L_ = Eigen::LLT<MatrixXd>(MatrixXd(Sigma)).matrixL();
  }

  /// ξ = L n with L Lᵀ = Σ, n ~ N(0, 1).
  VectorXd draw_noise(PairRandom& random) const {
    VectorXd n(L_.rows());
    for (double& component : n) component = random.gaussian();
    return L_ * n;
  }

  SimulatedOptions sensor_;
  const Graph* truth_ = nullptr;
  std::shared_ptr<const FactorType> odometry_;
  std::optional<RigidMotions> motions_;
  std::optional<MotionGroup> group_;
  std::vector<double> covariance_;  ///< Σ, column-major
  MatrixXd L_;
};

}  // namespace

std::unique_ptr<Registration> make_simulated(const SimulatedOptions& options) {
  return std::make_unique<Simulated>(options);
}

}  // namespace cairn::registration
