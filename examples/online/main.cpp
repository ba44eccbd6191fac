// SPDX-License-Identifier: BSD-3-Clause
// A robot circles a room. An estimator takes in each pose as it comes, with the odometry that leads
// to it and the loop closure with the lap before, and always knows how certain the newest pose is.
#include <iostream>
#include <numbers>

#include <cairn/cairn.hpp>

using namespace cairn;
using namespace cairn::symbols;  // X(3): pose 3

int main() {
  constexpr int kPosesPerLap = 20, kLaps = 3;
  const Pose2 step(1.0, 0.0, 2 * std::numbers::pi / kPosesPerLap);  // x y [m], heading [rad]
  const auto odometry = Information::sigmas(0.05, 0.05, 0.02);
  const auto closure = Information::sigmas(0.1, 0.1, 0.03);

  const auto estimator = make<Estimator>("incremental_cholesky");
  estimator->keep_marginals(KeptMarginals::last);
  for (int k = 0; k <= kLaps * kPosesPerLap; ++k) {
    GraphUpdate update;
    if (k == 0) {
      update.add(X(0), Pose2());
    } else {
      update.add<Pose2>(X(k));  // initialised from its first measurement
      update.add(Between(X(k - 1), X(k), step), odometry);
    }
    if (k >= kPosesPerLap) update.add(Between(X(k - kPosesPerLap), X(k), Pose2()), closure);
    estimator->update(update);

    if (k % kPosesPerLap == 0) {
      std::cout << id_text(X(k)) << " " << estimate<Pose2>(*estimator, X(k)) << " sigmas "
                << covariance<Pose2>(*estimator, X(k)).diagonal().cwiseSqrt().transpose() << "\n";
    }
  }
}
