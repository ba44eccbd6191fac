// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "cairn/io/stream_format.hpp"
#include "cairn/online/line_session.hpp"
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
class CAIRN_API OnlineSession final : public LineSession {
 public:
  /// What is referred to must outlive the session.
  OnlineSession(Estimator& estimator, StreamFormat& format, Registry& registry,
                OnlineSettings settings);

  Estimator& estimator() override { return estimator_; }
  std::int64_t variable_count() const override { return estimator_.variable_count(); }
  std::int64_t factor_count() const override { return estimator_.factor_count(); }
  bool is_variable_type(std::string_view tag) const override {
    return registry_.has("variable", tag);
  }
  /// Variables that are not in the graph, for want of a measurement: their number, and the first.
  std::string waiting() const override;

 private:
  using Command = void (OnlineSession::*)(const Words&, Reply&);
  using NamedCommand = std::pair<std::string_view, Command>;
  static std::span<const NamedCommand> commands();
  static Command find_command(std::string_view word);
  void perform(std::string_view line, const Words& words, Reply& reply) override;

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
  void report_chi2(const Words& words, Reply& reply);
  void save(const Words& words, Reply& reply);
  void help(const Words& words, Reply& reply);
  void quit(const Words& words, Reply& reply);

  void take_data(std::string_view text, Reply& reply);
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
  void note_waiting(Reply& reply) const;
  void write_estimate(Id id, std::string& text) const;
  bool write_covariance(Id a, Id b, std::string& text);
  const VariableType& type_of(Id id) const;

  Estimator& estimator_;
  StreamFormat& format_;
  Registry& registry_;
  OnlineSettings settings_;
  int owed_ = 0;
  std::string noted_;  ///< why fewer poses have left than should have, as it was last reported
  bool noted_unwritable_ = false;  ///< that SAVE cannot write what MARGINALIZE leaves
  /// Variables that no measurement has touched yet: the estimator gets them with the first that
  /// does.
  std::vector<Variable> waiting_;
  std::int64_t left_out_ = 0;  ///< factors on variables that never came (`skip_dangling`)
  std::vector<Id> known_;      ///< those that the estimator has, in the order of arrival
  std::unordered_map<Id, std::shared_ptr<const VariableType>> types_;
  std::unordered_map<Id, std::vector<double>> reported_;  ///< estimates, for `changed`
};

}  // namespace cairn
