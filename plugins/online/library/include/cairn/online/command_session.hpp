// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cairn/io/stream_format.hpp"
#include "cairn/online/line_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// What answers have of the estimate without being asked for it.
struct AnswerSettings {
  std::string output = "last";     ///< estimates: none, last, changed or all
  std::string marginals = "none";  ///< covariances: none, last or diagonal
};

/// A session that is spoken to by commands, such as "SOLVE", among lines of data in a format: the
/// commands that all of these have, and the lines of their answers.
class CAIRN_API CommandSession : public LineSession {
 public:
  bool is_variable_type(std::string_view tag) const final { return registry_.has("variable", tag); }

 protected:
  struct Command {
    std::string_view word;
    std::function<void(CommandSession&, const Words&, Reply&)> run;
    bool offered = true;  ///< or `run` says why it is not for this session
  };
  template <class Session>
  static Command command(std::string_view word, void (Session::*run)(const Words&, Reply&)) {
    return {word, [run](CommandSession& session, const Words& words, Reply& reply) {
              (static_cast<Session&>(session).*run)(words, reply);
            }};
  }
  /// Of other sessions: it is not offered.
  template <class Session>
  static Command refused(std::string_view word, void (Session::*run)(const Words&, Reply&)) {
    Command one = command(word, run);
    one.offered = false;
    return one;
  }

  /// `commands`: besides CHI2, SAVE, HELP and QUIT. `format` and `registry` must outlive the
  /// session.
  CommandSession(StreamFormat& format, Registry& registry, AnswerSettings settings,
                 std::vector<Command> commands);

  void perform(std::string_view line, const Words& words, Reply& reply) override;
  /// A line that begins with none of the commands.
  virtual void take_data(std::string_view line, Reply& reply) = 0;
  /// Takes in what lines before have left to be done, for an answer that depends on it.
  virtual void settle(Reply& /*reply*/) {}
  /// Notes that belong before what is said of the whole estimate.
  virtual std::string caveats() const { return {}; }
  /// Ends the answer to a command, of which `text` is the last but its closing line.
  virtual void answer(Reply& reply, std::string text) = 0;

  StreamFormat& format() { return format_; }
  Registry& registry() { return registry_; }

  /// What "NEW TAG id" declares.
  Variable declared_variable(const Words& words);

  // Lines of answers.
  /// "VERTEX_SE2 7 x y theta"
  static std::string estimate_line(const VariableType& type, Id id, std::span<const double> state);
  /// "COVARIANCE a b rows columns" and the numbers row by row; empty if there is none.
  static std::string covariance_line(Estimator& estimator, Id a, const VariableType& type_a, Id b,
                                     const VariableType& type_b);
  /// The same, to who asks for it; throws `Error` (numerical) if there is none.
  static std::string wanted_covariance(Estimator& estimator, Id a, const VariableType& type_a, Id b,
                                       const VariableType& type_b);
  /// Of one variable; "NOTE there is no covariance of 7: …" if there is none.
  static std::string covariance_or_note(Estimator& estimator, Id id, const VariableType& type);

  /// Takes the type and the state of a variable.
  using Estimate = std::function<void(const VariableType&, std::span<const double>)>;
  using Ids = std::function<std::vector<Id>()>;
  /// The estimates that the settings ask for, of `newest` or of `all`, by `look_up`.
  std::string wanted_estimates(Id newest, const Ids& all,
                               const std::function<void(Id, const Estimate&)>& look_up);
  /// It has left: an estimate that comes of it is new.
  void forget_estimate(Id id) { reported_.erase(id); }
  /// Those whose covariances the settings ask for.
  std::vector<Id> wanted_covariances(std::optional<Id> newest, const Ids& all) const;

 private:
  void report_chi2(const Words& words, Reply& reply);
  void save(const Words& words, Reply& reply);
  void help(const Words& words, Reply& reply);
  void quit(const Words& words, Reply& reply);

  StreamFormat& format_;
  Registry& registry_;
  AnswerSettings settings_;
  std::vector<Command> commands_;
  std::unordered_map<Id, std::vector<double>> reported_;  ///< estimates, for `changed`
};

}  // namespace cairn
