// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "cairn/grid/grid_format.hpp"
#include "cairn/plugin/registry.hpp"
#include "scan_matcher.hpp"
#include "scan_pairs.hpp"
#include "support/components.hpp"
#include "support/data.hpp"

namespace cairn {
namespace {

using icp::ScanMatch;
using icp::ScanMatcher;
using icp::Verdict;

/// What becomes of one pair.
struct Outcome {
  ScanMatch match;
  Eigen::Vector3d error;  ///< ξ with z exp(ξ) = the true relative pose
  double nees = 0.0;
  double milliseconds = 0.0;
  double sigma = 0.0;
  ScanMatch ideal; Eigen::Vector3d ideal_error; double es; //TMP

  bool right() const {
    return error.head<2>().norm() <= 0.05 && std::abs(error[2]) <= 0.5 * std::numbers::pi / 180.0;
  }
  /// Beyond that, and beyond what the covariance explains for 999 of 1000.
  bool wrong() const { return !right() && nees > 16.27; }
};

Outcome outcome_of(const test::ScanPair& pair, const ScanMatcher& matcher) {
  const auto begin = std::chrono::steady_clock::now();
  Outcome outcome;
  const icp::SurfaceScan earlier = matcher.prepare(pair.earlier), later = matcher.prepare(pair.later);
  outcome.match = matcher.search(earlier, later, pair.guess, matcher.options().window);
  const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - begin;
  outcome.milliseconds = time.count();
  outcome.error = outcome.match.pose.local(pair.truth);
  outcome.ideal = matcher.refine(earlier, later, pair.truth);//TMP
  outcome.es = earlier.sigma();//TMP
  outcome.ideal_error = outcome.ideal.pose.local(pair.truth);//TMP
  if (outcome.match.matches > 0)
    outcome.nees = outcome.error.dot(outcome.match.covariance.inverse() * outcome.error);
  return outcome;
}

std::vector<Outcome> study(const std::string& floor, int pairs) {
  Registry registry;
  const OccupancyGrid grid =
      read_grid((test::data_folder() / "maps" / (floor + ".yaml")).string(), registry);
  test::ScanPairs drawn(grid, 1);
  test::Sampler random(2);
  const ScanMatcher matcher;
  std::vector<Outcome> all;
  for (int k = 0; k < pairs; ++k) {
    const double sigma = random.uniform(0.01, 0.05);
    all.push_back(outcome_of(drawn.draw({.sigma = sigma}), matcher));
    all.back().sigma = sigma;
  }
  return all;
}

void write_table(const std::vector<Outcome>& all, const std::string& file) {
  std::ofstream out(file);
  out << "verdict,sigma,ex,ey,et,nees,ms,matches,share,rms,agree,front,behind,outside,quality,runner,"
         "unobserved,iterations,sx,sy,st,ix,iy,it,iq,inees,es\n";
  for (const Outcome& one : all) {
    const ScanMatch& m = one.match;
    out << static_cast<int>(m.verdict) << ',' << one.sigma << ',' << one.error[0] << ','
        << one.error[1] << ',' << one.error[2] << ',' << one.nees << ',' << one.milliseconds << ','
        << m.matches << ',' << m.share << ',' << m.rms << ',' << m.visibility.agreeing << ','
        << m.visibility.in_front << ',' << m.visibility.behind << ',' << m.visibility.outside << ','
        << m.quality << ',' << m.runner_up << ',' << m.unobserved << ',' << m.iterations << ','
        << std::sqrt(m.covariance(0, 0)) << ',' << std::sqrt(m.covariance(1, 1)) << ','
        << std::sqrt(m.covariance(2, 2)) << ',' << one.ideal_error[0] << ',' << one.ideal_error[1] << ',' << one.ideal_error[2] << ',' << one.ideal.quality << ',' << one.ideal_error.dot(one.ideal.covariance.inverse() * one.ideal_error) << ',' << one.es << '\n';//TMP
  }
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

struct Summary {
  double right = 0, imprecise = 0, wrong = 0, rejected = 0;  ///< parts of all pairs
  double nees = 0;         ///< mean of those with all directions observed, without wrong ones
  double median_nees = 0;  ///< 2.37 for 3 DoF
  double milliseconds = 0;  ///< median
};

Summary summary_of(const std::vector<Outcome>& all) {
  Summary sum;
  std::vector<double> nees, milliseconds;
  for (const Outcome& one : all) {
    milliseconds.push_back(one.milliseconds);
    if (!one.match.accepted()) {
      ++sum.rejected;
    } else if (one.right()) {
      ++sum.right;
    } else if (one.wrong()) {
      ++sum.wrong;
    } else {
      ++sum.imprecise;
    }
    if (one.match.accepted() && one.match.unobserved == 0 && !one.wrong()) nees.push_back(one.nees);
  }
  const double count = static_cast<double>(all.size());
  for (double* part : {&sum.right, &sum.imprecise, &sum.wrong, &sum.rejected}) *part /= count;
  if (!nees.empty()) {
    for (const double value : nees) sum.nees += value / static_cast<double>(nees.size());
    sum.median_nees = median(nees);
  }
  sum.milliseconds = median(milliseconds);
  return sum;
}

class FloorsStudy : public testing::TestWithParam<const char*> {};

/// CAIRN_ICP_PAIRS: how many pairs instead of 200; CAIRN_ICP_TABLE: a folder for tables of them.
TEST_P(FloorsStudy, MatchesArePreciseConsistentOrRejected) {
  CAIRN_NEEDS_DATA();
  CAIRN_NEEDS("grid_format", "ros");
  const char* const asked = std::getenv("CAIRN_ICP_PAIRS");
  const std::vector<Outcome> all = study(GetParam(), asked ? std::atoi(asked) : 200);
  if (const char* const folder = std::getenv("CAIRN_ICP_TABLE"))
    write_table(all, std::string(folder) + "/" + GetParam() + ".csv");
  const Summary sum = summary_of(all);
  std::cout << GetParam() << ": right " << sum.right << ", imprecise " << sum.imprecise
            << ", wrong " << sum.wrong << ", rejected " << sum.rejected << ", NEES " << sum.nees
            << " (median " << sum.median_nees << "), median " << sum.milliseconds << " ms\n";
}

INSTANTIATE_TEST_SUITE_P(Floors, FloorsStudy,
                         testing::Values("fr079", "intel_lab", "willow_full", "depot",
                                         "stata_basement", "hospital_40m", "simple_rooms",
                                         "cave_20m"),
                         [](const auto& floor) { return floor.param; });

}  // namespace
}  // namespace cairn
