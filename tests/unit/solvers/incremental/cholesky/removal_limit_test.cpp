// SPDX-License-Identifier: BSD-3-Clause
// Updates with a limit of work out of which something leaves: each solution ends, and nothing that
// has left is in what comes out.
#include <algorithm>
#include <memory>
#include <optional>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "cairn/lie/point.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/types/define_factor.hpp"
#include "counting_clock.hpp"
#include "incremental_cholesky.hpp"
#include "support/dense_algebra.hpp"
#include "support/planar_graph.hpp"

namespace cairn::incremental {
namespace {

/// Where a point is as seen from another, in the axes of the world: a linear measurement, so that
/// what marginalisation leaves is exact.
struct Apart {
  static constexpr std::string_view kTag = "TEST_APART";
  static constexpr int kResidual = 2, kMeasurement = 2;
  static inline int evaluations = 0;
  using Variables = std::tuple<PointXY, PointXY>;
  template <class S>
  static Vector<S, 2> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 2>& z) {
    ++evaluations;
    return b - a - z.template cast<S>();
  }
};

/// One of the two coordinates: what a point needs two of.
struct AlongX {
  static constexpr std::string_view kTag = "TEST_ALONG_X";
  static constexpr int kResidual = 1, kMeasurement = 1;
  using Variables = std::tuple<PointXY, PointXY>;
  template <class S>
  static Vector<S, 1> residual(const Vector<S, 2>& a, const Vector<S, 2>& b,
                               const Vector<double, 1>& z) {
    return Vector<S, 1>(b[0] - a[0] - z[0]);
  }
};

/// Changes nothing, and says that it could not.
class GivesUp final : public Optimizer {
 public:
  using Optimizer::optimize;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    (void)graph, (void)stop, (void)observer;
    return {};
  }
};

struct Measurement {
  int a, b;
  Eigen::Vector2d z;
  Eigen::Matrix2d information;
  FactorId factor = -1;
};

/// All that was ever measured and not removed: minimum and covariances are those of a dense matrix.
/// The first point is fixed at 0.
class Whole {
 public:
  std::vector<Measurement> measurements;

  void forget_variable(int id) {
    std::erase_if(measurements, [&](const Measurement& m) { return m.a == id || m.b == id; });
  }
  void solve() {
    place_.clear();
    std::set<int> ids;
    for (const Measurement& m : measurements) ids.insert({m.a, m.b});
    ids.erase(0);
    for (const int id : ids) place_.emplace_back(id);
    const Eigen::Index n = 2 * std::ssize(place_);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    for (const Measurement& m : measurements) {
      for (const auto& [u, sign_u] : {std::pair{m.a, -1.0}, std::pair{m.b, 1.0}}) {
        if (u == 0) continue;
        g.segment<2>(at(u)) += sign_u * m.information * m.z;
        for (const auto& [v, sign_v] : {std::pair{m.a, -1.0}, std::pair{m.b, 1.0}})
          if (v != 0) H.block<2, 2>(at(u), at(v)) += sign_u * sign_v * m.information;
      }
    }
    Sigma_ = test::inverse_of(H);
    x_ = Sigma_ * g;
  }
  bool has(int id) const { return id == 0 || std::ranges::binary_search(place_, id); }
  Eigen::Vector2d x(int id) const {
    return id == 0 ? Eigen::Vector2d::Zero() : Eigen::Vector2d(x_.segment<2>(at(id)));
  }
  Eigen::Matrix2d Sigma(int a, int b) const {
    if (a == 0 || b == 0) return Eigen::Matrix2d::Zero();
    return Sigma_.block<2, 2>(at(a), at(b));
  }

 private:
  Eigen::Index at(int id) const {
    return 2 * (std::ranges::lower_bound(place_, id) - place_.begin());
  }
  std::vector<int> place_;
  Eigen::MatrixXd Sigma_;
  Eigen::VectorXd x_;
};

/// A line of points, each measured from two or three before it, and the estimator that follows.
class Session {
 public:
  Session(unsigned seed, IncrementalCholeskyOptions options, std::shared_ptr<Rescuer> rescuer)
      : estimator(options, std::move(rescuer)), random(seed) {
    clock.drive(estimator);
  }
  void point(int k) { update_.variables.push_back({types.point, k, {1.0 * k, 0.0}, k == 0}); }
  void measure(int a, int b) {
    Measurement m{a, b, {b - a + noise(), noise()}, {}};
    m.information << 100.0 + 50.0 * noise(), 7.0, 7.0, 400.0;
    const Eigen::Matrix2d& I = m.information;
    update_.factors.push_back({apart, {a, b}, {m.z[0], m.z[1]}, {I(0, 0), I(0, 1), I(1, 1)}});
    added_.push_back(m);
  }
  /// The next point, measured from those before it, and from one that is further away.
  void step(int k, int lag) {
    point(k);
    for (const int a : {k - 1, k - 2})
      if (a >= 0 && estimator.has(a)) measure(a, k);
    if (k < 4) return;
    const int far =
        k - 3 - static_cast<int>(random() % static_cast<unsigned>(std::min(lag, k) - 3));
    if (estimator.has(far)) measure(far, k);
  }
  /// Of a point after `oldest`.
  void remove_loop(int oldest = -1) {
    std::vector<FactorId> loops;
    for (const Measurement& m : whole.measurements)
      if (m.b - m.a > 2 && m.a > oldest && estimator.has_factor(m.factor))
        loops.push_back(m.factor);
    if (loops.empty()) return;
    const FactorId gone = loops[random() % loops.size()];
    update_.removed_factors.push_back(gone);
    std::erase_if(whole.measurements, [&](const Measurement& m) { return m.factor == gone; });
  }
  void remove_point(int k) {
    update_.removed_variables.push_back(k);
    whole.forget_variable(k);
  }
  void marginalize(int k) { update_.marginalized.push_back(k); }
  UpdateReport carry_out(const UpdateOptions& options) {
    const GraphUpdate update = std::exchange(update_, {});
    UpdateReport report = estimator.update(update, options);
    for (std::size_t k = 0; k < added_.size(); ++k) {
      added_[k].factor = report.first_factor + static_cast<FactorId>(k);
      if (std::ranges::find(update.removed_variables, added_[k].a) ==
          update.removed_variables.end())
        whole.measurements.push_back(added_[k]);
    }
    added_.clear();
    return report;
  }
  double distance(const Whole& to) {
    double most = 0.0;
    for (const Id id : estimator.variables()) {
      if (!to.has(static_cast<int>(id))) continue;
      const std::span<const double> x = estimator.state(id);
      most = std::max(most, (Eigen::Vector2d(x[0], x[1]) - to.x(static_cast<int>(id))).norm());
    }
    return most;
  }
  /// Blocks on the diagonal, and a column of all.
  double distance_of_covariances(const Whole& to) {
    double most = 0.0;
    const std::vector<Id> all = estimator.variables();
    const int last = static_cast<int>(all.back());
    std::vector<double> column(all.size() * 4);
    EXPECT_TRUE(estimator.covariance_column(last, all, column));
    const Eigen::Map<const Eigen::MatrixXd> of_last(column.data(), 2 * std::ssize(all), 2);
    for (std::size_t k = 0; k < all.size(); ++k) {
      const int id = static_cast<int>(all[k]);
      Eigen::Matrix2d block;
      EXPECT_TRUE(estimator.covariance(id, id, {block.data(), 4}));
      const double scale = std::max(to.Sigma(last, last).norm(), to.Sigma(id, id).norm());
      const Eigen::Index row = 2 * static_cast<Eigen::Index>(k);
      most = std::max({most, (block - to.Sigma(id, id)).norm() / scale,
                       (of_last.middleRows<2>(row) - to.Sigma(id, last)).norm() / scale});
    }
    return most;
  }

  IncrementalCholesky estimator;
  CountingClock clock;
  Whole whole;
  test::PlanarTypes types;
  std::shared_ptr<const FactorType> apart = define_factor<Apart>();
  std::mt19937 random;

 private:
  double noise() { return normal_(random); }

  std::normal_distribution<double> normal_{0.0, 0.02};
  GraphUpdate update_;
  std::vector<Measurement> added_;
};

enum class Leaves { loops, points, pointsThatComeBack, theOldest, theOldestAndLoops };

struct Case {
  std::string name;
  Leaves what;
  int pieces;  ///< of an update
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const auto& [name, what] : {std::pair{"Loops", Leaves::loops},
                                   {"Points", Leaves::points},
                                   {"PointsThatComeBack", Leaves::pointsThatComeBack},
                                   {"TheOldest", Leaves::theOldest},
                                   {"TheOldestAndLoops", Leaves::theOldestAndLoops}}) {
    for (const int pieces : {1, 7, 60})
      all.push_back({std::string(name) + "By" + std::to_string(pieces), what, pieces});
  }
  return all;
}

void PrintTo(const Case& of, std::ostream* out) { *out << of.name; }

std::shared_ptr<Rescuer> rescuer_of(std::unique_ptr<Optimizer> optimizer) {
  auto rescuer = std::make_shared<Rescuer>();
  rescuer->optimizer = std::move(optimizer);
  return rescuer;
}

IncrementalCholeskyOptions exact() {
  IncrementalCholeskyOptions options;
  options.settings.accuracy = 0.0;
  options.settings.iterations = 100;
  return options;
}

/// So many pieces of work: the time before the first, which is real, is less than a half.
UpdateOptions limit(int pieces) { return {.max_seconds = pieces + 0.5}; }

class RemovalInEveryUpdate : public testing::TestWithParam<Case> {
 protected:
  static constexpr int kLag = 12, kSteps = 60;

  /// What leaves in step k, and what comes back.
  void happen(Session& session, int k, std::optional<int>& away) const {
    switch (GetParam().what) {
      case Leaves::loops:
        return session.remove_loop();
      case Leaves::points:
        if (k % 2 == 0) session.remove_point(k - 6);
        return;
      case Leaves::pointsThatComeBack:
        if (away) {
          session.point(*away);
          for (const int from : {*away - 1, *away + 1}) session.measure(from, *away);
          away.reset();
        } else {
          away = k - 5;
          session.remove_point(*away);
        }
        return;
      case Leaves::theOldestAndLoops:
        session.remove_loop(k - kLag);
        [[fallthrough]];
      case Leaves::theOldest:
        if (k >= kLag) session.marginalize(k - kLag);
        return;
    }
  }
};

TEST_P(RemovalInEveryUpdate, EndsEachSolutionAndAllIsAsIfSolvedAtOnce) {
  int left = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Session session(seed, exact(), rescuer_of(std::make_unique<GivesUp>()));
    IncrementalCholesky& estimator = session.estimator;
    estimator.keep_marginals(KeptMarginals::diagonal);
    std::optional<int> away;
    Whole before;
    for (int k = 0; k < kSteps; ++k) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", step " << k);
      session.step(k, kLag);
      if (k >= 8) happen(session, k, away);
      const UpdateReport report = session.carry_out(limit(GetParam().pieces));
      ASSERT_TRUE(report.ok);
      left += report.owed > 0;
      if (k < 2) continue;
      session.whole.solve();
      // Either this update's solution is there, or the one before, which it has ended.
      if (k > 12 && (GetParam().what != Leaves::points || k % 2 == 0)) {
        ASSERT_LT(std::min(session.distance(session.whole), session.distance(before)), 1e-7);
      }
      if (k % 10 == 0) {
        ASSERT_LT(session.distance_of_covariances(session.whole), 1e-8);
      }
      before = session.whole;
    }
    int updates = 0;
    while (session.carry_out(limit(GetParam().pieces)).owed > 0) ASSERT_LT(++updates, 20000);
    EXPECT_LT(session.distance(session.whole), 1e-9) << "seed " << seed;
    EXPECT_LT(session.distance_of_covariances(session.whole), 1e-9) << "seed " << seed;
    // What is taken out of the arrays in the end changes nothing.
    for (int update = 0; update < 2; ++update) session.carry_out({});
    EXPECT_LT(session.distance(session.whole), 1e-9) << "seed " << seed;
    EXPECT_LT(session.distance_of_covariances(session.whole), 1e-9) << "seed " << seed;
  }
  if (GetParam().pieces == 1) {
    EXPECT_GT(left, 100) << "a limit that is no limit";
  }
}

INSTANTIATE_TEST_SUITE_P(Random, RemovalInEveryUpdate, testing::ValuesIn(cases()),
                         [](const auto& named) { return named.param.name; });

TEST(RemovalWithALimit, NumbersNothingAnewUntilAnUpdateHasNoLimit) {
  constexpr int kPoints = 300;
  Session session(1, {}, rescuer_of(std::make_unique<GivesUp>()));
  for (int k = 0; k < kPoints; ++k) {
    session.step(k, 12);
    session.carry_out({});
  }
  for (int k = kPoints; k < kPoints + 10; ++k) {
    session.step(k, 12);
    session.remove_loop(k - 15);
    EXPECT_LT(session.carry_out(limit(1)).affected_variables, kPoints / 2) << k;
  }
  while (session.carry_out(limit(1)).owed > 0) {
  }
  EXPECT_GT(session.carry_out({}).affected_variables, kPoints);
  EXPECT_EQ(session.carry_out({}).affected_variables, 0);
}

TEST(RemovalWithALimit, ArraysThatAreMostlyEmptyWaitForTheSolutionThatGoesOn) {
  constexpr int kPoints = 120, kLeave = 80;
  Session session(2, exact(), rescuer_of(std::make_unique<GivesUp>()));
  for (int k = 0; k < kPoints; ++k) {
    session.step(k, 12);
    session.carry_out({});
  }
  for (int k = 0; k < kLeave; ++k) session.marginalize(k);
  EXPECT_GT(session.carry_out(limit(1)).owed, 0);
  session.step(kPoints, 12);
  Apart::evaluations = 0;
  EXPECT_GT(session.carry_out(limit(1)).owed, 0);
  EXPECT_LT(Apart::evaluations, 3 * (kPoints - kLeave) / 2) << "all is linearised anew";
  while (session.carry_out(limit(1)).owed > 0) {
  }
  session.whole.solve();
  EXPECT_LT(session.distance(session.whole), 1e-9);
  EXPECT_LT(session.distance_of_covariances(session.whole), 1e-9);
}

// The solution that an update ends before it takes something out may be the last that is told of.
TEST(RemovalWithALimit, HowTheSolutionEndedThatWasLeftIsInTheReport) {
  for (const bool full : {false, true}) {
    Session session(3, {}, rescuer_of(std::make_unique<GivesUp>()));
    GraphUpdate first;
    for (int k = 0; k < 30; ++k) {
      session.step(k, 12);
      session.carry_out({});
    }
    GraphUpdate singular;
    singular.variables.push_back({session.types.point, 99, {2.0, 0.0}, false});
    singular.factors.push_back({define_factor<AlongX>(), {3, 99}, {1.0}, {1.0}});
    ASSERT_GT(session.estimator.update(singular, limit(1)).owed, 0);
    session.remove_loop();
    const UpdateReport report = session.carry_out({.defer = !full, .full = full});
    EXPECT_FALSE(report.ok);
    EXPECT_EQ(std::ranges::count_if(report.notes,
                                    [](const std::string& note) {
                                      return note.find("99 is free along") != std::string::npos;
                                    }),
              1)
        << testing::PrintToString(report.notes);
  }
}

// Where rows are is remembered from one column to the next, and forgotten where it may change.
TEST(CovarianceColumns, OfTheSameRowsAreRightAfterNumbersHaveChanged) {
  Session session(4, exact(), rescuer_of(std::make_unique<GivesUp>()));
  IncrementalCholesky& estimator = session.estimator;
  std::vector<Id> rows;
  for (int k = 0; k < 30; ++k) {
    session.step(k, 12);
    session.carry_out({});
    if (k % 3 == 2) rows.push_back(k);
  }
  const auto distance = [&] {
    session.whole.solve();
    double most = 0.0;
    for (const int id : {29, 11, 20}) {
      Eigen::MatrixXd column(2 * std::ssize(rows), 2);
      EXPECT_TRUE(
          estimator.covariance_column(id, rows, {column.data(), rows.size() * std::size_t{4}}));
      for (std::size_t k = 0; k < rows.size(); ++k) {
        const Eigen::Matrix2d wanted = session.whole.Sigma(static_cast<int>(rows[k]), id);
        const Eigen::Index row = 2 * static_cast<Eigen::Index>(k);
        most = std::max(most, (column.middleRows<2>(row) - wanted).norm() / wanted.norm());
      }
    }
    return most;
  };
  EXPECT_LT(distance(), 1e-9);
  session.remove_point(4);
  for (int update = 0; update < 3; ++update) {
    session.carry_out({});
    EXPECT_LT(distance(), 1e-9) << "update " << update << " after a removal";
  }
  session.remove_loop();
  session.step(30, 12);
  EXPECT_GT(session.carry_out(limit(1)).owed, 0);
  EXPECT_LT(distance(), 1e-9) << "in the middle of a solution";
  session.marginalize(0);
  session.carry_out({});
  EXPECT_LT(distance(), 1e-9);
  estimator.set_loss(nullptr, {});
  session.carry_out({});
  EXPECT_LT(distance(), 1e-9) << "after all was numbered anew";
  std::vector<double> column(rows.size() * 4);
  session.remove_point(11);
  session.carry_out({});
  EXPECT_THROW(estimator.covariance_column(29, rows, column), Error);
  estimator.reset();
  EXPECT_THROW(estimator.covariance_column(29, rows, column), Error);
}

}  // namespace
}  // namespace cairn::incremental
