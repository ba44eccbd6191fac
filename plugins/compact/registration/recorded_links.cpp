// SPDX-License-Identifier: BSD-3-Clause
#include "recorded_links.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "cairn/geometry/pose_chain.hpp"
#include "cairn/runtime/error.hpp"
#include "dense/cholesky.hpp"

namespace cairn::registration {
namespace {

Motion measured_motion(const Graph& recording, int factor, const MotionGroup& group) {
  const Factor measured = recording.factor(factor);
  return group.of_factor(measured, std::min(measured.variables[0], measured.variables[1]));
}

}  // namespace

double log_determinant(const std::vector<double>& covariance, int n) {
  const Eigen::LLT<Eigen::MatrixXd> llt(
      Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(covariance.data(), n, n)));
  return 2.0 * llt.matrixLLT().diagonal().array().log().sum();
}

RecordedLinks recorded_links(const RegistrationData& data, std::string_view owner) {
  if (!data.recording) {
    throw Error(ErrorCode::usage, "registration " + std::string(owner) +
                                      ": needs the recording, a graph with the measurements that "
                                      "were made (RegistrationData::recording)");
  }
  const Graph& recording = *data.recording;
  const std::vector<bool> closes_loop = loop_closures(recording);
  RecordedLinks links;
  bool has_odometry = false;
  for (int f = 0; f < recording.factor_count(); ++f) {
    const FactorPool& pool = recording.factor_pools()[recording.ref(f).pool];
    if (!pool.type->is_relative()) continue;
    const auto& pose = recording.variable_pools()[pool.variable_pools[0]].type;
    if (links.pose && links.pose != pose) {
      throw Error(ErrorCode::input, "registration " + std::string(owner) +
                                        ": the recording has poses of two types, " +
                                        std::string(links.pose->tag()) + " and " +
                                        std::string(pose->tag()) + " (" +
                                        recording.describe_factor(f) + "); they must be of one");
    }
    links.pose = pose;
    links.all.push_back(f);
    if (closes_loop[f]) links.loops.push_back(f);
    if (!links.odometry || (!has_odometry && !closes_loop[f])) links.odometry = pool.type;
    has_odometry |= !closes_loop[f];
  }
  if (links.loops.empty()) links.loops = links.all;
  return links;
}

std::vector<double> median_covariance(const Graph& recording, const RecordedLinks& links,
                                      const MotionGroup& group) {
  std::vector<std::pair<double, int>> sizes;  // and the factor, which breaks ties
  sizes.reserve(links.loops.size());
  for (const int f : links.loops) {
    sizes.emplace_back(
        log_determinant(measured_motion(recording, f, group).covariance, group.tangent_size()), f);
  }
  const auto middle = sizes.begin() + (std::ssize(sizes) - 1) / 2;
  std::nth_element(sizes.begin(), middle, sizes.end());
  return measured_motion(recording, middle->second, group).covariance;
}

Extent largest_extent(const Graph& recording, const RecordedLinks& links,
                      const RigidMotions& motions) {
  Extent largest;
  for (const int f : links.loops) {
    const Extent measured = motions.extent(recording.measurement(f));
    largest.length = std::max(largest.length, measured.length);
    largest.angle = std::max(largest.angle, measured.angle);
  }
  return largest;
}

}  // namespace cairn::registration
