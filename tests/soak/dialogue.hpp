// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "live_process.hpp"

namespace cairn::soak {

/// The lines that a session was sent, by the numbers that it gives them: what a robot knows.
class Ledger {
 public:
  using OnConfirmed = std::function<void(const std::string&)>;

  /// `confirmed` gets each line that changes the graph once it is known to be in it.
  explicit Ledger(OnConfirmed confirmed) : confirmed_(std::move(confirmed)) {}

  /// A line is sent; its number. `changes`: the journal will have it.
  long sent(std::string text, bool changes);
  /// An answer acknowledges line `number`, and so all before.
  void acknowledged(long number);
  /// A session was restored up to line `number`. Returns the lines that it has to be sent again.
  /// Throws `Violated` if what was acknowledged is not there, or what was not sent is.
  std::vector<std::string> restored(long number);
  long confirmed_lines() const { return lines_; }
  long last_sent() const { return last_; }

 private:
  struct Sent {
    long number;
    std::string text;
    bool changes;
  };
  void confirm(const Sent& line);

  OnConfirmed confirmed_;
  std::deque<Sent> open_;  // not acknowledged
  long last_ = 0;          // number of the last line that was sent
  long safe_ = 0;          // … of the last that changes the graph and is acknowledged
  long lines_ = 0;         // that are confirmed
};

/// A robot's talk with `cairn online`, over as many processes as it takes.
class Dialogue {
 public:
  /// `launch` as of each process; a journal is named there, or there is none.
  Dialogue(faults::Launch launch, std::filesystem::path errors, Ledger::OnConfirmed confirmed);

  /// Starts a process.
  void start() { process_.emplace(launch_, errors_); }
  /// Starts a process that has a journal, and waits until it is restored. Returns the lines that
  /// must be sent again. Throws `Violated`.
  std::vector<std::string> restore();
  /// Sends lines that change the graph, and takes the answers that are there. False if the process
  /// reads no more.
  bool send(const std::vector<std::string>& lines);
  /// The same while nobody reads the answers, until the process waits for that.
  void send_unheard(const std::vector<std::string>& lines);
  /// Sends a question; the lines of the answer, but for the last. Throws `Violated`.
  std::string ask(const std::string& question);
  /// Ends the input, and takes all answers; the status of waitpid(2).
  int finish();

  LiveProcess& process() { return *process_; }
  const Ledger& ledger() const { return ledger_; }

 private:
  /// Whether it acknowledges something: the number. Throws `Violated` for an ERROR.
  long take(const std::string& answer);

  faults::Launch launch_;
  std::filesystem::path errors_;
  Ledger ledger_;
  std::optional<LiveProcess> process_;
};

}  // namespace cairn::soak
