// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/graph/factor_selector.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/io/stream_format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/types/loss.hpp"

namespace cairn {

/// The protocol of docs/online.md, whatever carries its lines: text in, text out. A line is taken
/// in whole or not at all. Only SAVE touches a file.
class CAIRN_API LineSession {
 public:
  /// What a line came to.
  struct Reply {
    std::string text;      ///< lines to be written; empty: nothing
    bool changes = false;  ///< belongs in a journal, before `text` is written
    bool refused = false;  ///< the text says why
    bool solved = false;
    double seconds = 0.0;  ///< that solving took
    bool quit = false;
  };

  virtual ~LineSession();

  /// Takes line `number` of the input. One that cannot be taken is answered by "ERROR line N: …".
  Reply take(std::string_view line, std::int64_t number);
  /// Answers a question (`is_question`) without any effect: neither on the estimate nor on what
  /// `take` answers later. For clients that do not send the measurements; `number` is of their
  /// lines.
  Reply ask(std::string_view line, std::int64_t number);
  /// The same without an answer: lines that were taken before, from a journal. Throws `Error` where
  /// one is refused.
  void restore(std::string_view line, std::int64_t number);
  /// The first word of a line; empty if there is none, or a comment.
  static std::string_view first_word(std::string_view line);
  /// Of a first word: ESTIMATE, COVARIANCE, CHI2 and HELP.
  static bool is_question(std::string_view word);
  /// SAVE must not replace this file: the journal.
  void protect(std::filesystem::path file, std::string what) {
    protected_.emplace_back(std::move(file), std::move(what));
  }
  /// No line follows. Not for a journal: a restored session goes on from before this.
  virtual void finish();

  /// The graph and its estimate. Only to be read.
  virtual Estimator& estimator() = 0;
  virtual std::int64_t variable_count() const = 0;
  virtual std::int64_t factor_count() const = 0;
  /// Whether lines of answers that begin with this word are estimates of variables.
  virtual bool is_variable_type(std::string_view tag) const = 0;
  /// Poses that came and are not in the graph, put back as well as is known, with all others.
  /// Throws `Error` (usage) where everything that comes is in the graph.
  virtual Graph trajectory();
  /// What was counted besides variables and factors, for reports: "loops.kept" is `kept` of
  /// `loops`.
  virtual std::vector<std::pair<std::string_view, std::int64_t>> counts() const { return {}; }
  /// After `finish`: sentences that no answer has.
  virtual std::vector<std::string> unread_notes() const { return {}; }
  /// After `finish`: whether the estimate is what was asked for, solved to convergence.
  virtual bool succeeded() const { return true; }
  /// What has come and is not in the graph, as a clause without its end; empty: there is nothing.
  virtual std::string waiting() const;

 protected:
  using Words = std::vector<std::string_view>;
  /// What the format's messages call the stream.
  static constexpr const char* kStreamName = "input";

  /// Does what a line with these words asks for; never called without any. Throws `Error` where it
  /// cannot. Nothing has changed then, or `reply.changes` says so.
  virtual void perform(std::string_view line, const Words& words, Reply& reply) = 0;

  /// Whether a line in which a plugin has failed (`Error` of code plugin) has changed nothing, and
  /// is answered like any other that is refused; otherwise `take` throws that error.
  virtual bool undoes_failures() const { return true; }

  std::int64_t line() const { return line_; }
  /// Within `ask`: nothing may change.
  bool asking() const { return asking_; }
  /// Restoring: answers are not read.
  bool silent() const { return silent_; }
  /// Puts what reading a line changed in front of its answer.
  void put_notes(const std::vector<std::string>& notes, Reply& reply) const;
  /// The line that ends an answer.
  void acknowledge(Reply& reply, int owed = 0, std::string_view word = "OK") const;

  // Words of a line; `what` names what was expected, for messages.
  static Error bad_line(const std::string& message);
  static std::int64_t parse_whole(std::string_view word, std::string_view what);
  static double parse_real(std::string_view word, std::string_view what);
  static std::vector<std::int64_t> parse_ids(std::span<const std::string_view> words,
                                             std::string_view what);
  /// Refuses a command with more or fewer words than its form.
  static void expect_words(const Words& words, std::size_t count, std::string_view form);
  /// The file of "SAVE file". Refuses standard output, and files that are protected.
  std::string file_to_save(const Words& words) const;

 private:
  std::int64_t line_ = 0;
  bool asking_ = false;
  bool silent_ = false;
  std::vector<std::pair<std::filesystem::path, std::string>> protected_;
};

/// What the sessions of a `LineSessionKind` are opened with.
struct LineSessionRequest {
  ComponentSpec component;  ///< what decides, such as a policy
  /// Options of it that were given by themselves: `estimator`, `keep`, `select`, `sparsifier`.
  /// Giving one twice is an error (usage).
  OptionValues given;
  std::string thresholds;  ///< a file with more of its options; empty: none
  ReadOptions read;
  std::string output = "last";     ///< estimates that answers have: none, last, changed or all
  std::string marginals = "none";  ///< covariances that they have: none, last or diagonal
  bool trajectory = false;         ///< whether `LineSession::trajectory` will be asked for
  std::shared_ptr<const Loss> loss;
  FactorSelector loss_on;
  const Graph* map = nullptr;  ///< that what comes continues
};

/// Sessions in which a component of another kind decides what is taken into the graph: the name is
/// that kind, as in `line_session|pose_policy` of a plugin's manifest.
class CAIRN_API LineSessionKind : public Component {
 public:
  static constexpr std::string_view kKind = "line_session";
  struct Opened {
    std::unique_ptr<Component> component;  ///< which the session refers to
    std::unique_ptr<LineSession> lines;
    std::string identity;  ///< what must be the same for a journal to give the same estimate again
  };
  /// `format` and `registry` must outlive the session. Throws `Error` for names, options and files
  /// that there are not.
  virtual Opened open(const LineSessionRequest& request, StreamFormat& format,
                      Registry& registry) const = 0;
};

}  // namespace cairn
