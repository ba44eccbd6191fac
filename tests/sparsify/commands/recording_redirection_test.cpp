// SPDX-License-Identifier: BSD-3-Clause
// cairn study sparsify --redirect beforehand: a recording's loop closures are moved along its
// odometry. --information-frame: a file's information is read as that of other residuals.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <boost/json/value.hpp>

#include "cairn/io/format.hpp"
#include "integration/process.hpp"
#include "sparsify/commands/sparsify_command.hpp"

namespace cairn::test {
namespace {

using testing::HasSubstr;

/// A pose in the plane, as an independent oracle: a rotation is multiplication by exp(iθ).
struct Planar {
  std::complex<double> t;
  double angle = 0.0;
};

Planar after(const Planar& a, const Planar& b) {
  return {a.t + std::polar(1.0, a.angle) * b.t, a.angle + b.angle};
}

/// b as seen from a.
Planar seen(const Planar& a, const Planar& b) {
  return {std::polar(1.0, -a.angle) * (b.t - a.t), b.angle - a.angle};
}

constexpr int kPoses = 24;

Planar step(int number) { return {{1.0 + 0.01 * number, 0.02 * number}, 0.1 + 0.004 * number}; }

std::vector<Planar> dead_reckoning() {
  std::vector<Planar> poses{{}};
  for (int n = 0; n + 1 < kPoses; ++n) poses.push_back(after(poses.back(), step(n)));
  return poses;
}

std::string edge(int from, int to, const Planar& z, double information = 50.0) {
  return fmt::format("EDGE_SE2 {} {} {:.17g} {:.17g} {:.17g} {} 2 1 {} 3 400\n", from, to,
                     z.t.real(), z.t.imag(), z.angle, information, 2.0 * information);
}

/// Odometry from 0 on, of which one step is measured backwards, and then other lines.
std::string recording(const std::string& others, int without = -1) {
  std::string text;
  for (int n = 0; n < kPoses; ++n) text += fmt::format("VERTEX_SE2 {} {} 0 0\n", n, n);
  for (int n = 0; n + 1 < kPoses; ++n) {
    if (n == without) continue;
    text += n == 6 ? edge(7, 6, seen(step(6), {})) : edge(n, n + 1, step(n));
  }
  return text + others;
}

/// With measurements that odometry does not fit.
Planar measured(const Planar& from, const Planar& to) {
  const Planar z = seen(from, to);
  return {z.t + std::complex(0.05, -0.03), z.angle + 0.02};
}

TEST_F(Sparsify, ARecordingIsRedirectedAlongItsOdometry) {
  const std::vector<Planar> at = dead_reckoning();
  const auto z = [&](int from, int to) { return measured(at[from], at[to]); };
  // Of every five poses one stays. 2 goes to 5, of which (2 + 1)/5 is nearer than of 0; 6, the
  // second end, to 5, and 1 to 0; 12 would go to 15, which is not there when 14 is, so it goes to
  // 10; 8 would go to 10, which measures it; 10 stays.
  write_text(folder_.file("as_recorded.g2o"),
             recording(edge(2, 12, z(2, 12)) + edge(16, 6, z(16, 6), 20.0) + edge(1, 9, z(1, 9)) +
                       edge(12, 14, z(12, 14)) + edge(8, 10, z(8, 10)) + edge(10, 20, z(10, 20))));
  write_text(
      folder_.file("by_hand.g2o"),
      recording(edge(5, 12, after(seen(at[5], at[2]), z(2, 12))) +
                edge(16, 5, after(z(16, 6), seen(at[6], at[5])), 20.0) +
                edge(0, 9, after(seen(at[0], at[1]), z(1, 9))) +
                edge(10, 14, after(seen(at[10], at[12]), z(12, 14))) + edge(10, 20, z(10, 20))));
  const auto told = [&](const std::string& name, const char* redirect) {
    return study({folder_.file(name + ".g2o"), "--keep-every", "5", "--online", "100", "--redirect",
                  redirect, "-o", folder_.file(name + "_sparse.g2o")});
  };
  const boost::json::value beforehand = told("as_recorded", "beforehand"),
                           by_hand = told("by_hand", "early");
  EXPECT_EQ(by_hand.at("redirected").as_int64(), 0);
  EXPECT_EQ(beforehand.at("redirected").as_int64(), 4);
  EXPECT_EQ(beforehand.at("dropped").as_int64(), 1);
  EXPECT_EQ(beforehand.at("factors").at("in").as_int64(), kPoses - 1 + 6);
  EXPECT_TRUE(beforehand.at("rmse_full").is_null());
  EXPECT_GT(number(beforehand.at("kld")), 1e-6);
  EXPECT_NEAR(number(beforehand.at("kld")), number(by_hand.at("kld")),
              1e-6 * number(by_hand.at("kld")));
  EXPECT_EQ(beforehand.at("problems").at("count"), by_hand.at("problems").at("count"));
  Registry registry;
  const Graph a = read_graph(folder_.file("as_recorded_sparse.g2o"), registry),
              b = read_graph(folder_.file("by_hand_sparse.g2o"), registry);
  ASSERT_EQ(a.variable_count(), b.variable_count());
  ASSERT_EQ(a.factor_count(), b.factor_count());
  for (int v = 0; v < a.variable_count(); ++v) {
    EXPECT_EQ(a.id(v), b.id(v));
    EXPECT_THAT(std::vector<double>(a.state(v).begin(), a.state(v).end()),
                testing::Pointwise(testing::DoubleNear(1e-6), b.state(v)));
  }
}

TEST_F(Sparsify, ARecordingIsRedirectedBeforehandOnlyWhereItsOdometryIsWhole) {
  const std::vector<Planar> at = dead_reckoning();
  // 3 goes to 5, and nothing measures 5 from 4.
  const std::string loops = edge(3, 9, measured(at[3], at[9])) + edge(2, 6, measured(at[2], at[6]));
  write_text(folder_.file("gap.g2o"), recording(loops, 4));
  const Arguments online{"study",      "sparsify",  folder_.file("gap.g2o"), "--online", "100",
                         "--redirect", "beforehand"};
  Arguments arguments = online;
  arguments.insert(arguments.end(), {"--keep-every", "5"});
  Outcome run = cairn(arguments);
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("--redirect early or late"));
  EXPECT_THAT(run.err, HasSubstr("VERTEX_SE2 5"));
  run = cairn(online);
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("--redirect beforehand needs"));
  arguments.insert(arguments.end(), {"--redirect-to", "next"});
  run = cairn(arguments);
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("--redirect late or early"));
}

// Its chi2 is that of the errors in the first pose's frame; with g2o's it is another one.
TEST_F(Sparsify, InformationIsOfTheFirstPosesFrameOnDemand) {
  const std::vector<Planar> at = dead_reckoning();
  const Planar along = measured(at[2], at[12]), back = measured(at[16], at[6]);
  std::string text;
  for (int n = 0; n < kPoses; ++n) {
    text += fmt::format("VERTEX_SE2 {} {:.17g} {:.17g} {:.17g}\n", n, at[n].t.real(),
                        at[n].t.imag(), at[n].angle);
  }
  for (int n = 0; n + 1 < kPoses; ++n) text += edge(n, n + 1, step(n));
  write_text(folder_.file("in.g2o"), text + edge(2, 12, along) + edge(16, 6, back, 20.0));
  const auto chi2 = [](const Planar& expected, const Planar& z, double information) {
    const double x = expected.t.real() - z.t.real(), y = expected.t.imag() - z.t.imag(),
                 a = expected.angle - z.angle;
    return information * x * x + 4.0 * x * y + 2.0 * x * a + 2.0 * information * y * y +
           6.0 * y * a + 400.0 * a * a;
  };
  const double expected =
      chi2(seen(at[2], at[12]), along, 50.0) + chi2(seen(at[16], at[6]), back, 20.0);
  const auto before = [&](const Arguments& more) {
    Arguments all{"study",     "sparsify", folder_.file("in.g2o"),
                  "--initial", "as_given", "--iterations",
                  "0",         "--quiet",  "--json",
                  "-"};
    all.insert(all.end(), more.begin(), more.end());
    const Outcome run = cairn(all);
    EXPECT_EQ(run.exit_code, 4) << run.err;  // not a minimum
    return number(parse_json(run.out).at("chi2").at("before"));
  };
  EXPECT_NEAR(before({"--keep-every", "2", "--information-frame", "first"}), expected, 1e-9);
  EXPECT_NEAR(before({"--edges", "mac:part=0.5", "--information-frame", "first"}), expected, 1e-9);
  EXPECT_GT(std::abs(before({"--keep-every", "2"}) - expected), 0.01);
  const Outcome run = cairn({"study", "sparsify", "@sphere:turns=2,poses_per_turn=5",
                             "--keep-every", "2", "--information-frame", "first"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("EDGE_SE3:QUAT"));
}

}  // namespace
}  // namespace cairn::test
