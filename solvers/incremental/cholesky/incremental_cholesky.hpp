// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "answers.hpp"
#include "cairn/plugin/option_fields.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/update/freedom_watch.hpp"
#include "cairn/update/loss_rule.hpp"
#include "engine.hpp"

namespace cairn::incremental {

/// Options of the estimator `incremental_cholesky`.
struct IncrementalCholeskyOptions {
  Settings settings{};
  int solve_every = 1;  ///< updates that are solved for together
  int full_every = 0;   ///< updates from one full step to the next; 0: never by itself
  double budget = 0.0;  ///< of an update [s]; 0: no limit
  bool hints = true;    ///< new variables may start where a measurement puts them
  std::string rescuer = "levenberg_marquardt";  ///< optimises where a step has raised chi2

  static auto fields() {
    using O = IncrementalCholeskyOptions;
    return OptionFields<O>()
        .part(&O::settings, accuracy_fields())
        .integer("solve_every", &O::solve_every, 1, 1e9, "updates that are solved for together")
        .integer("full_every", &O::full_every, 0, 1e9,
                 "updates from one full batch step to the next; 0: only on demand")
        .real("budget", &O::budget, 0.0, 1e9,
              "seconds that an update may take; what is left goes on in the next ones; 0: no limit")
        .boolean(
            "hints", &O::hints,
            "a new variable whose state its measurements contradict starts from where one of them "
            "puts it")
        .component<Optimizer>(
            "rescuer", &O::rescuer,
            "fallback optimizer: runs on the whole graph where a step has raised chi2")
        .part(&O::settings,
              OptionFields<Settings>().choice("kernels", &Settings::kernels,
                                              {"auto", "portable", "avx2", "avx512"},
                                              "instruction set, as far as the machine has it"));
  }

 private:
  static OptionFields<Settings> accuracy_fields() {
    return OptionFields<Settings>()
        .real("accuracy", &Settings::accuracy, 0.0, 1.0,
              "relative amount by which chi2 may exceed that of a full batch solution; 0: none")
        .real(
            "significance", &Settings::significance, 0.0, 1e300,
            "a step that lowers chi2 by less than this, and than the accuracy allows, is deferred")
        .integer("iterations", &Settings::iterations, 1, 1e9,
                 "maximum number of linear systems solved per update")
        .integer("recent", &Settings::recent, 0, 1e9,
                 "variables touched in so many updates, and near them, are ordered last");
  }
};

/// The estimator `incremental_cholesky`: `Engine` behind the interface, which speaks of ids.
class IncrementalCholesky final : public Estimator {
 public:
  IncrementalCholesky(const IncrementalCholeskyOptions& options, std::shared_ptr<Rescuer> rescuer);
  IncrementalCholesky(const IncrementalCholesky& other);
  IncrementalCholesky& operator=(const IncrementalCholesky&) = delete;
  ~IncrementalCholesky() override;

  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override;
  void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) override;
  bool has(Id id) const override { return find(id).has_value(); }
  int variable_count() const override { return refuse_if_lost(), variables_; }
  int factor_count() const override { return refuse_if_lost(), factors_; }
  std::vector<Id> variables() const override;
  std::shared_ptr<const VariableType> type(Id id) const override;
  std::vector<FactorId> factors() const override { return engine().problem().live_ids(); }
  bool has_factor(FactorId id) const override { return position(id).has_value(); }
  Factor factor(FactorId id) const override;
  std::span<const double> state(Id id) override;
  double chi2() override { return engine().chi2(); }
  Graph graph() override { return engine().snapshot(); }
  void keep_marginals(KeptMarginals kept) override;
  void keep_cross(Id a, Id b) override;
  bool covariance(Id a, Id b, std::span<double> block) override;
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override;
  void reset() override;
  std::unique_ptr<Estimator> clone() const override;
  std::int64_t memory() const override { return engine().problem().doubles() * 8; }
  /// The clock that limits refer to, for tests.
  void set_clock(Pace::Clock clock) { engine().set_clock(std::move(clock)); }

 private:
  class Target;
  struct Record;
  /// Variables whose rows of a covariance are asked for.
  struct Rows {
    std::vector<Id> ids;
    std::vector<std::int32_t> places;  ///< in the engine
    std::int64_t height = 0;           ///< rows of all together
  };
  std::optional<int> find(Id id) const;
  std::optional<int> position(FactorId id) const;
  int index(Id id) const;
  int block_size(int a, int b) const;
  const Rows& rows_of(std::span<const Id> variables);
  UpdateReport carry_out(const GraphUpdate& update, const UpdateOptions& options);
  double change_graph(const GraphUpdate& update, bool full, bool limited, UpdateReport& report);
  void refuse_if_lost() const;
  Engine& engine() { return refuse_if_lost(), *engine_; }
  const Engine& engine() const { return refuse_if_lost(), *engine_; }
  bool may_throw(const GraphUpdate& update);
  void begin_step(const UpdateOptions& options);
  void forget_step();
  void keep_answers(Answers* answers);
  void go_back();
  void become(IncrementalCholesky&& other);
  bool compaction_is_due(bool limited) const;
  void compact();
  bool brings_back(const GraphUpdate& update) const;
  bool can_be_foreseen(const GraphUpdate& update) const;
  void forget_what_was_read() {
    read_.clear();
    all_.reset();
    finished_.reset();
    rows_ = {};
  }
  Engine& solved();
  int place_in(const Engine& engine, Id id) const;
  GraphUpdate placed(const GraphUpdate& update);
  double end_solution(bool full, UpdateReport& report);
  void note_gauge(UpdateReport& report);
  void look_for_freedom();
  void report_free(UpdateReport& report);

  IncrementalCholeskyOptions options_;
  std::shared_ptr<Rescuer> rescuer_;
  std::unique_ptr<Engine> engine_;  // moves when it is reset; never null
  int variables_ = 0, factors_ = 0;
  LossRule losses_;
  int since_solved_ = 0, since_full_ = 0;
  KeptMarginals kept_ = KeptMarginals::none;
  std::map<int, std::vector<double>> read_;  // states by variable, since the last update
  std::optional<Estimate> all_;              // or all of them
  int next_to_read_ = 0;                     // a guess
  std::unique_ptr<Engine> finished_;         // see solved()
  Rows rows_;                                // that were asked for last, since the last update
  std::set<Id> told_;                        // anchors that a note has named
  /// Something has been removed, not marginalised, and is still in the engine's arrays: the next
  /// update without a time limit takes it out.
  bool has_removed_ = false;
  FreedomWatch watch_;
  std::int64_t watched_load_ = 0;  // of the engine, whose numbers the watch has

  // What is gone back to where an update fails while it is carried out:
  bool changes_ = false;                         ///< one is being carried out, and is so in part
  std::unique_ptr<IncrementalCholesky> before_;  ///< a copy, made for this update
  bool may_throw_ = false;          ///< something of the graph may throw where it is evaluated, …
  std::unique_ptr<Record> record_;  ///< … and then there is this
  std::shared_ptr<const FactorType> harmless_;  ///< the last type that never throws
  AnswersKept answers_;
  bool lost_ = false;  ///< an update has failed that could not be undone
};

}  // namespace cairn::incremental
