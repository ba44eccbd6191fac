// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "cairn/solve/estimator.hpp"
#include "throwing_types.hpp"

namespace cairn::test {

/// A robot in the plane, updates of all kinds by chance, some of which fail: each update is first
/// tried with a factor that throws once, at one evaluation after the other. Beside the estimator a
/// twin goes the same way, but for the failures. Both must have the same bits all the time.
class FailingUpdates {
 public:
  /// `types`: that of the factors; all other parts are of any. `at_most`: of the evaluations of an
  /// update, so many are failed at, spread evenly.
  FailingUpdates(Estimator& estimator, Estimator& twin, const ThrowingTypes& types, unsigned seed,
                 int at_most);

  void run(int updates);
  /// What was done, for messages.
  const std::string& log() const { return log_; }
  /// Updates that have failed so far.
  int failures() const { return failures_; }

 private:
  void once();
  void try_to_fail(const GraphUpdate& update, const UpdateOptions& options);
  void change_settings();
  int evaluations_of(const GraphUpdate& update, const UpdateOptions& options);
  void expect_twins();

  GraphUpdate propose();
  void add_pose(GraphUpdate& update);
  void add_point(GraphUpdate& update);
  void add_between(GraphUpdate& update, Id a, Id b);
  void change(GraphUpdate& update);
  void leave(GraphUpdate& update);

  bool chance(double p) { return std::uniform_real_distribution<double>(0.0, 1.0)(random_) < p; }
  double noise() { return normal_(random_); }
  std::size_t up_to(std::size_t count) { return random_() % count; }
  /// None where there is none.
  std::optional<Id> some_variable(bool pose);
  bool is_pose(Id id) const;

  Estimator& estimator_;
  Estimator& twin_;
  const ThrowingTypes& types_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_{0.0, 0.05};
  int at_most_;
  int lag_ = 0;  ///< poses that stay; 0: all
  Id next_ = 0;
  int failures_ = 0;
  std::string log_;
};

}  // namespace cairn::test
