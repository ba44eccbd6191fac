// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/stream_format.hpp"
#include "cairn/online/command_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/update/pose_remover.hpp"

namespace cairn {

struct OnlineSettings {
  ReadOptions read;
  bool automatic = true;           ///< solve after every line that leaves nothing dangling
  std::string output = "last";     ///< estimates after a solve: none, last, changed or all
  std::string marginals = "none";  ///< covariances after a solve: none, last or diagonal
  double budget = 0.0;             ///< [s] of an update; 0: no limit
  PoseRemover* remover = nullptr;  ///< for SPARSIFY; null: that is refused
  int keep = 0;  ///< poses that the map has at most, until SPARSIFY KEEP changes it; 0: any number
};

/// Everything that arrives is taken into the graph of an estimator.
class CAIRN_API OnlineSession final : public CommandSession {
 public:
  /// What is referred to must outlive the session.
  OnlineSession(Estimator& estimator, StreamFormat& format, Registry& registry,
                OnlineSettings settings);

  Estimator& estimator() override { return estimator_; }
  std::int64_t variable_count() const override { return estimator_.variable_count(); }
  std::int64_t factor_count() const override { return estimator_.factor_count(); }
  /// Variables that are not in the graph, for want of a measurement: their number, and the first.
  std::string waiting() const override;

 private:
  // A command each; the words are those of its line.
  void declare(const Words& words, Reply& reply);
  void remove(const Words& words, Reply& reply);
  void change(const Words& words, Reply& reply);
  void marginalize(const Words& words, Reply& reply);
  void sparsify(const Words& words, Reply& reply);
  void keep(const Words& words, Reply& reply);
  void solve(const Words& words, Reply& reply);
  void solve_fully(const Words& words, Reply& reply);
  void report_covariance(const Words& words, Reply& reply);
  void report_estimate(const Words& words, Reply& reply);

  void take_data(std::string_view text, Reply& reply) override;
  void take_variable(Variable variable);
  std::string leave_out(const Factor& factor);
  void take_factor(Factor factor, Reply& reply);
  void hold(Id id);
  const Variable* find_waiting(Id id) const;

  /// Hands an update over; solves where that is due or asked for. `removal` becomes a part of it.
  UpdateReport update(GraphUpdate update, bool solve, bool full, Reply& reply,
                      const PoseRemover::Removal& removal = {});
  UpdateReport hand_over(const GraphUpdate& update, bool solve, bool full, Reply& reply);
  void solve_now(const GraphUpdate& update, bool full, Reply& reply);
  /// The poses that leave if the map has too many with those of `coming`.
  PoseRemover::Removal make_room(const GraphUpdate& coming);
  void write_removal(const PoseRemover::Removal& removal, FactorId first_factor, Reply& reply);
  void follow(const GraphUpdate& update);
  void write_results(const UpdateReport& report, Reply& reply);
  /// If variables wait: that they are not in what is answered.
  std::string caveats() const override;
  void answer(Reply& reply, std::string text) override;
  std::string estimate_of(Id id) const;
  const VariableType& type_of(Id id) const;

  Estimator& estimator_;
  OnlineSettings settings_;
  int owed_ = 0;
  std::string noted_;  ///< why fewer poses have left than should have, as it was last reported
  bool noted_unwritable_ = false;  ///< that SAVE cannot write what MARGINALIZE leaves
  /// Variables that no measurement has touched yet: the estimator gets them with the first that
  /// does.
  std::vector<Variable> waiting_;
  std::int64_t left_out_ = 0;  ///< factors on variables that never came (`skip_dangling`)
  std::optional<Id> newest_;   ///< of the variables that the estimator has
};

}  // namespace cairn
