// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <boost/json/object.hpp>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"

namespace cairn::app {

/// One conversation with `cairn online`: takes lines, and says what to answer (docs/online.md). A
/// line is taken in whole or not at all.
class LineSession {
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

  virtual ~LineSession() = default;

  /// Takes line `number` of the input. One that cannot be taken is answered by "ERROR line N: …".
  Reply take(std::string_view line, std::int64_t number);
  /// The same without an answer: lines that were taken before, from a journal. Throws `Error` where
  /// one is refused.
  void restore(std::string_view line, std::int64_t number);
  /// No line follows. Not in a journal: a restored session continues from before this.
  virtual void finish() {}

  /// The graph and its estimate. Only to be read.
  virtual Estimator& estimator() = 0;
  virtual std::int64_t variable_count() const = 0;
  virtual std::int64_t factor_count() const = 0;
  /// What the report of the run should say besides.
  virtual void add_to(boost::json::object& /*report*/) const {}

 protected:
  using Words = std::vector<std::string_view>;

  /// Does what a line with these words asks for; never called without any. Throws `Error` where it
  /// cannot. Nothing has changed then, or `reply.changes` says so.
  virtual void perform(std::string_view line, const Words& words, Reply& reply) = 0;

  std::int64_t line() const { return line_; }
  /// Restoring: answers are discarded.
  bool silent() const { return silent_; }
  /// The line that ends an answer.
  void acknowledge(Reply& reply, int owed = 0, std::string_view word = "OK") const;

 private:
  std::int64_t line_ = 0;
  bool silent_ = false;
};

/// What the format's messages call the stream.
inline constexpr const char* kStreamName = "input";

// Words of a line ---------------------------------------------------------------------------------

Error bad_line(const std::string& message);

std::int64_t parse_whole(std::string_view word, std::string_view what);
double parse_real(std::string_view word, std::string_view what);
std::vector<std::int64_t> parse_ids(std::span<const std::string_view> words, std::string_view what);

/// Refuses a command with more or fewer words than its form.
void expect_words(const std::vector<std::string_view>& words, std::size_t count,
                  std::string_view form);

/// What "NEW TAG id" declares.
Variable declared_variable(const std::vector<std::string_view>& words, Registry& registry);

// Lines of answers --------------------------------------------------------------------------------

/// "VERTEX_SE2 7 x y theta"
std::string estimate_line(const VariableType& type, Id id, std::span<const double> state);
/// "COVARIANCE a b rows columns" and the numbers row by row; empty if there is none.
std::string covariance_line(Estimator& estimator, Id a, const VariableType& type_a, Id b,
                            const VariableType& type_b);

}  // namespace cairn::app
