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

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "cairn/runtime/error.hpp"
#include "recorded_links.hpp"
#include "registrations.hpp"

namespace cairn::registration {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What the sensor can do, and how often it cannot.
struct Sensor {
  Extent range;                    ///< poses nearer than this can be matched
  double sigma_translation = 0.0;  ///< [m]; 0: as in the recording
  double sigma_rotation = 0.0;     ///< [rad]; 0: as in the recording
  double failure_rate = 0.0;       ///< of the pairs within range, those that are not matched
  double false_rate = 0.0;         ///< of the pairs matched within range, those with another motion
  double far_rate = 0.0;           ///< of the pairs out of range, those that are matched, falsely
  std::uint64_t seed = 1;
};

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
  explicit Simulated(const Sensor& sensor) : sensor_(sensor) {}

  void begin(const RegistrationData& data) override {
    if (!data.truth) {
      throw bad_data(ErrorCode::usage,
                     "needs the truth: give a graph with the true states of the recording's poses "
                     "(RegistrationData::truth), or take the registration 'recorded', which "
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
    std::vector<double> z =
        match.outcome == Outcome::wrong
            ? motions_->draw(sensor_.range, match.random)
            : motions_->perturbed(match.motion, draw_noise(match.random).data());
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
    L_ = Sigma.llt().matrixL();
  }

  /// ξ = L n with L Lᵀ = Σ, n ~ N(0, 1).
  VectorXd draw_noise(PairRandom& random) const {
    VectorXd n(L_.rows());
    for (double& component : n) component = random.gaussian();
    return L_ * n;
  }

  Sensor sensor_;
  const Graph* truth_ = nullptr;
  std::shared_ptr<const FactorType> odometry_;
  std::optional<RigidMotions> motions_;
  std::optional<MotionGroup> group_;
  std::vector<double> covariance_;  ///< Σ, column-major
  MatrixXd L_;
};

/// No angle between two orientations is larger; a little more than π, so that none is as large.
constexpr double kAnyAngle = 3.1416;

}  // namespace

OptionTable simulated_options() {
  return OptionTable{}
      .real("range", 2.0, 1e-3, 1e6, "poses nearer to each other than this can be matched [m]")
      .real("angle", kAnyAngle, 1e-3, kAnyAngle,
            "if their orientations differ by less than this [rad]; 3.1416: any")
      .real("sigma_translation", 0.0, 0.0, 1e6,
            "noise of measured translations, each axis [m]; 0: as in the recording")
      .real("sigma_rotation", 0.0, 0.0, 3.0,
            "noise of measured rotations, each axis [rad]; 0: as in the recording")
      .real("failure_rate", 0.0, 0.0, 1.0,
            "fraction of the pairs within range that are not matched")
      .real("false_rate", 0.0, 0.0, 1.0,
            "fraction of the pairs matched within range with a random relative pose within range")
      .real("far_rate", 0.0, 0.0, 1.0,
            "fraction of the pairs out of range that are matched, with a random relative pose")
      .integer("seed", 1, 0, 1e15, "of noise, failures and false matches");
}

std::unique_ptr<Registration> make_simulated(const Options& options) {
  return std::make_unique<Simulated>(
      Sensor{.range = {.length = options.real("range"), .angle = options.real("angle")},
             .sigma_translation = options.real("sigma_translation"),
             .sigma_rotation = options.real("sigma_rotation"),
             .failure_rate = options.real("failure_rate"),
             .false_rate = options.real("false_rate"),
             .far_rate = options.real("far_rate"),
             .seed = static_cast<std::uint64_t>(options.integer("seed"))});
}

}  // namespace cairn::registration
