// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/online/conversation.hpp"
#include "cairn/online/online_session.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {

/// How a session of `cairn online` is set up.
struct SessionSettings {
  std::string estimator = "incremental_cholesky";
  OnlineSettings online;
};

/// Any of the settings, by the bits of a byte.
SessionSettings session_settings(std::uint8_t choice);

/// A session with all that it refers to.
class OwnedSession {
 public:
  explicit OwnedSession(const SessionSettings& settings);

  OnlineSession& lines() { return *lines_; }
  Estimator& estimator() { return *estimator_; }

 private:
  MapSparsifier remover_;
  std::unique_ptr<StreamFormat> format_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<OnlineSession> lines_;
};

/// A line that changed something, as a journal has it.
struct TakenLine {
  std::int64_t number;
  std::string text;
};

/// Feeds lines to a session, checks the form of each answer and that a line which no journal would
/// have changes nothing, and remembers the others.
class Stream {
 public:
  explicit Stream(LineSession& session) : session_(session), conversation_(session) {}
  /// After each line other clients ask, as those of `cairn online --listen` do.
  void ask_between() { asks_ = true; }

  /// At most so many lines of a text, but for SAVE, up to the one that ends the session; then the
  /// session has come to its end.
  void take_all(std::string_view text, int most);
  const std::vector<TakenLine>& taken() const { return taken_; }
  /// All answers to these lines.
  const std::string& answers() const { return answers_; }

 private:
  bool take(const std::string& line);
  void ask();

  LineSession& session_;
  Conversation conversation_;
  std::int64_t number_ = 0;
  std::vector<TakenLine> taken_;
  std::string answers_;
  bool asks_ = false;
};

/// Restores lines in another session; a `Finding` if one is refused.
void restore(const std::vector<TakenLine>& lines, LineSession& session);

/// Where two estimators differ: variables, factors, or a bit of an estimate. Empty if nowhere.
std::string difference(Estimator& a, Estimator& b);

/// Where two texts differ, as their first lines that do.
std::string first_difference(std::string_view a, std::string_view b);

/// The first word of a line, by which a session knows a command; empty if there is none.
std::string_view first_word(std::string_view line);
/// Whether a line is a SAVE: the one command that touches files, which no target may.
bool writes_a_file(std::string_view line);

/// What every session of poses needs, and what else this one does.
std::vector<Needed> session_needs(std::initializer_list<Needed> more);

/// Conversations of `cairn online`, without the settings.
std::vector<std::string> conversations();
/// Commands and tags of such lines.
std::vector<std::string> protocol_words();

}  // namespace cairn::fuzz
