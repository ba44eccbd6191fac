// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/graph/graph.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/graph_update.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {

/// What an estimator goes through, as bytes decide: poses and points come and go, measurements are
/// added, changed and removed, variables are marginalised, several of these in one update; solving
/// is deferred, ordinary or full; states, chi2, covariances and copies are asked for in between.
///
/// A plain graph is updated likewise. Measurements are those of random true poses with noise of a
/// standard deviation or less, so that a minimum is near, and (unless the first byte wants it)
/// updates that would leave H badly conditioned are not made. `run` throws `Finding` where the two
/// differ; its message has all that was done before.
class IncrementalLife {
 public:
  explicit IncrementalLife(Bytes bytes);
  void run();

 private:
  enum class Solve { ordinary, deferred, full };

  // What may happen: each reads its own decisions.
  void propose();
  void add_pose(bool connected);
  void add_point();
  void add_measurement(Id a, Id b);
  void add_prior(Id a);
  void change_factor();
  void remove_factor();
  void remove_variable();
  void marginalize();
  void ask();
  void finish_update(Solve how);

  // What must hold.
  void expect_same_graph(const Graph& estimated);
  void expect_chi2();
  void expect_minimum(double fraction, double slack);
  void expect_covariances(const Graph& graph, double tolerance);
  void expect_unchanged(const std::map<Id, std::vector<double>>& states);
  /// Throws `Finding` unless `holds`; `what()` is called only then.
  template <class What>
  void require(bool holds, const What& what) const {
    expect(holds, [&] { return std::string(what()) + "\nafter\n" + log_; });
  }

  static bool well_posed(const Graph& graph);
  std::map<Id, std::vector<double>> states();
  bool is_pose(Id id) const;
  Id some(bool pose);
  std::vector<double> random_pose();
  std::vector<double> measured(Id a, Id b);
  std::vector<double> noisy(const VariableType& type, std::vector<double> z);
  std::vector<double> information(int size);
  void log(const std::string& line) { log_ += line + "\n"; }

  Source source_;
  bool spatial_, only_well_posed_;
  std::shared_ptr<const VariableType> pose_, point_;
  std::shared_ptr<const FactorType> relative_pose_, prior_, point_seen_;
  std::unique_ptr<Estimator> estimator_;
  double accuracy_;
  std::map<Id, std::vector<double>> truth_;  ///< of all variables ever
  Graph mirror_;
  FactorIds ids_;
  GraphUpdate update_;  ///< being put together
  Id next_id_ = 0, last_pose_ = -1;
  std::string log_;
};

}  // namespace cairn::fuzz
