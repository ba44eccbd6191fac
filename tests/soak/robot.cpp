// SPDX-License-Identifier: BSD-3-Clause
#include "robot.hpp"

#include <cmath>
#include <cstdio>
#include <numbers>

namespace cairn::soak {
namespace {

constexpr long kLap = 15, kKept = 40;  // poses
constexpr double kRadius = 10.0;       // [m]

std::string numbers(double x, double y, double theta) {
  char text[100];
  std::snprintf(text, sizeof text, " %.6f %.6f %.6f", x, y, theta);
  return text;
}

}  // namespace

Robot::Robot(Forgetting forgetting, std::uint64_t seed) : forgetting_(forgetting), random_(seed) {}

Robot::Pose Robot::truth(long pose) {
  const double angle = 2.0 * std::numbers::pi * static_cast<double>(pose % kLap) / kLap;
  return {kRadius * std::cos(angle), kRadius * std::sin(angle), angle + std::numbers::pi / 2.0};
}

/// Uniform, so that it is the same with every standard library.
double Robot::noise(double sigma) {
  const double unit = static_cast<double>(random_() >> 11) * 0x1p-53;
  return sigma * std::sqrt(12.0) * (unit - 0.5);
}

std::string Robot::measured(long from, long to) {
  const Pose a = truth(from), b = truth(to);
  const double c = std::cos(a.theta), s = std::sin(a.theta), dx = b.x - a.x, dy = b.y - a.y;
  const double turn = b.theta - a.theta;
  return numbers(c * dx + s * dy + noise(0.02), c * dy - s * dx + noise(0.02),
                 std::atan2(std::sin(turn), std::cos(turn)) + noise(0.01));
}

/// What is older than the poses that are kept leaves; some measurements do before that.
void Robot::forget(long now, std::vector<std::string>& lines) {
  const std::string oldest = std::to_string(now - kKept);
  if (forgetting_ == Forgetting::marginalize) {
    lines.push_back("MARGINALIZE " + oldest);
    return;
  }
  lines.push_back("REMOVE VARIABLE " + oldest);
  const std::string closure = std::to_string(closure_);
  if (now % 7 == 0) lines.push_back("CHANGE " + closure + measured(now - kLap, now));
  if (now % 11 == 0) lines.push_back("REMOVE FACTOR " + closure);
}

std::vector<std::string> Robot::next_pose() {
  const long now = pose_++;
  const std::string id = std::to_string(now);
  if (now == 0) return {"VERTEX_SE2 0" + numbers(kRadius, 0.0, std::numbers::pi / 2), "FIX 0"};
  std::vector<std::string> lines{"NEW VERTEX_SE2 " + id};
  const auto see = [&](long other) {
    lines.push_back("EDGE_SE2 " + std::to_string(other) + " " + id + measured(other, now) +
                    " 2500 0 0 2500 0 10000");
    return factors_++;
  };
  see(now - 1);
  if (now % 3 == 0 && now > kLap + 3) see(now - kLap - 3);
  if (now >= kLap) closure_ = see(now - kLap);
  if (now % kLap == 0) {
    const Pose at = truth(now);
    lines.push_back("EDGE_PRIOR_SE2 " + id + numbers(at.x, at.y, at.theta) + " 100 0 0 100 0 100");
    ++factors_;
  }
  if (now >= kKept) forget(now, lines);
  if (now % 50 == 0) lines.emplace_back("FULL");
  return lines;
}

}  // namespace cairn::soak
