// SPDX-License-Identifier: BSD-3-Clause
#include "simulation_builder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "cairn/graph/packed.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::generate {
namespace {

struct Sigmas {
  double translation;
  double rotation;
};

template <class Pose>
Sigmas sigmas_of(const Noise& noise, const Pose& motion) {
  const double dt = noise.translation_share * length(motion);
  const double dr = noise.rotation_share * rotation_angle(motion);
  return {std::sqrt(noise.translation_sigma * noise.translation_sigma + dt * dt),
          std::sqrt(noise.rotation_sigma * noise.rotation_sigma + dr * dr)};
}

struct WrongLoop {
  Loop loop;
  int number;  // order of drawing, to break ties
};

template <class Pose>
double squared_distance(const Pose& a, const Pose& b) {
  const auto p = position(a), q = position(b);
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) sum += (p[k] - q[k]) * (p[k] - q[k]);
  return sum;
}

/// Pairs of poses further apart than three times the reach of a claimed motion.
template <class Pose>
std::vector<WrongLoop> draw_wrong_loops(const std::vector<Pose>& path, const Outliers& outliers,
                                        Random& random) {
  constexpr int kTries = 1000;
  const double least = 9.0 * outliers.reach * outliers.reach;
  const auto n = static_cast<std::int64_t>(path.size());
  std::vector<WrongLoop> wrong;
  for (int number = 0; number < outliers.count; ++number) {
    int tries = 0;
    for (; tries < kTries; ++tries) {
      const auto a = static_cast<int>(random.below(n)), b = static_cast<int>(random.below(n));
      if (squared_distance(path[a], path[b]) <= least) continue;
      wrong.push_back({{std::min(a, b), std::max(a, b)}, number});
      break;
    }
    if (tries == kTries) {
      throw Error(ErrorCode::usage,
                  "generate: outliers: found no two poses further apart than " +
                      std::to_string(3.0 * outliers.reach) +
                      " m to join wrongly; ask for a larger world or for none (outliers=0)");
    }
  }
  std::sort(wrong.begin(), wrong.end(), [](const WrongLoop& a, const WrongLoop& b) {
    return a.loop.later != b.loop.later ? a.loop.later < b.loop.later : a.number < b.number;
  });
  return wrong;
}

}  // namespace

template <class Pose>
SimulationBuilder<Pose>::SimulationBuilder(Registry& types, const Noise& noise, std::uint64_t seed,
                                           std::size_t poses, std::size_t factors)
    : noise_(noise),
      random_(seed, Random::Stream::noise),
      variable_(types.variable_type(Pose::kVariable)),
      factor_(types.factor_type(Pose::kRelative)) {
  graph_.reserve(poses, factors);
  truth_.reserve(poses);
  estimate_.reserve(poses);
  variable_of_pose_.reserve(poses);
}

template <class Pose>
Pose SimulationBuilder<Pose>::measure(const Pose& motion, double noisier) {
  const Sigmas sigma = sigmas_of(noise_, motion);
  std::array<double, Pose::kTangent> n;
  for (int k = 0; k < Pose::kTangent; ++k) {
    const double s = k < Pose::kDimension ? sigma.translation : sigma.rotation;
    n[k] = noisier * noise_.scale * s * random_.gaussian();
  }
  if (noise_.scale == 0.0) return motion;  // exactly, not up to rounding
  return compose(motion, inverse(from_vectors(n)));
}

template <class Pose>
void SimulationBuilder<Pose>::add_factor(int from, int to, const Pose& measured, const Pose& motion,
                                         double noisier) {
  constexpr int kN = Pose::kTangent;
  const Sigmas sigma = sigmas_of(noise_, motion);
  const double scale = noisier * (noise_.scale == 0.0 ? 1.0 : noise_.scale);
  std::array<double, packed_size(kN)> information{};
  for (int row = 0, place = 0; row < kN; place += kN - row, ++row) {
    const double s = scale * (row < Pose::kDimension ? sigma.translation : sigma.rotation);
    information[place] = 1.0 / (s * s);
  }
  const std::array<int, 2> variables{variable_of_pose_[from], variable_of_pose_[to]};
  graph_.add_factor(factor_, variables, state(measured), information);
}

template <class Pose>
void SimulationBuilder<Pose>::add_pose(const Pose& truth) {
  const int k = poses();
  Pose measured, motion;
  if (k == 0) {
    estimate_.push_back(truth);
  } else {
    motion = between(truth_.back(), truth);
    measured = measure(motion, 1.0);
    estimate_.push_back(compose(estimate_.back(), measured));
  }
  truth_.push_back(truth);
  variable_of_pose_.push_back(graph_.add_variable(variable_, k, state(estimate_.back())));
  if (k > 0) add_factor(k - 1, k, measured, motion, 1.0);
}

template <class Pose>
void SimulationBuilder<Pose>::add_loop(const Loop& loop) {
  const Pose motion = between(truth_[loop.earlier], truth_[loop.later]);
  add_factor(loop.earlier, loop.later, measure(motion, noise_.loops), motion, noise_.loops);
}

template <class Pose>
void SimulationBuilder<Pose>::add_wrong_loop(const Loop& loop, const Pose& claimed) {
  add_factor(loop.earlier, loop.later, claimed, claimed, noise_.loops);
}

template <class Pose>
void SimulationBuilder<Pose>::set_truth(int variable, std::vector<double> state_of_other) {
  other_truth_.emplace_back(variable, std::move(state_of_other));
}

template <class Pose>
Simulation SimulationBuilder<Pose>::finish() {
  Graph truth = graph_.clone();
  for (int k = 0; k < poses(); ++k) truth.set_state(variable_of_pose_[k], state(truth_[k]));
  for (const auto& [variable, x] : other_truth_) truth.set_state(variable, x);
  return {std::move(graph_), std::move(truth)};
}

template class SimulationBuilder<Pose2>;
template class SimulationBuilder<Pose3>;

template <class Pose>
Simulation simulate(const std::vector<Pose>& path, const std::vector<Loop>& loops,
                    const Noise& noise, const Outliers& outliers, Registry& types,
                    std::uint64_t seed) {
  Random random(seed, Random::Stream::outliers);
  const std::vector<WrongLoop> wrong = draw_wrong_loops(path, outliers, random);
  SimulationBuilder<Pose> builder(types, noise, seed, path.size(),
                                  path.size() + loops.size() + wrong.size());
  auto loop = loops.begin();
  auto wrong_loop = wrong.begin();
  for (int k = 0; k < static_cast<int>(path.size()); ++k) {
    builder.add_pose(path[k]);
    for (; loop != loops.end() && loop->later == k; ++loop) builder.add_loop(*loop);
    for (; wrong_loop != wrong.end() && wrong_loop->loop.later == k; ++wrong_loop) {
      Pose claimed;
      draw_motion(random, outliers.reach, claimed);
      builder.add_wrong_loop(wrong_loop->loop, claimed);
    }
  }
  return builder.finish();
}

template Simulation simulate(const std::vector<Pose2>&, const std::vector<Loop>&, const Noise&,
                             const Outliers&, Registry&, std::uint64_t);
template Simulation simulate(const std::vector<Pose3>&, const std::vector<Loop>&, const Noise&,
                             const Outliers&, Registry&, std::uint64_t);

}  // namespace cairn::generate
