// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <stdexcept>
#include <string>
#include <string_view>

#include "faults/process.hpp"

namespace cairn::soak {

/// Something that must not happen has happened; `what()` says what.
class Violated : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A process that is talked to by lines, while it runs. What it answers is read while lines are
/// written, so that neither waits for the other for ever.
class LiveProcess {
 public:
  /// Standard error is added to the file `errors`. Throws `std::runtime_error`.
  LiveProcess(faults::Launch launch, const std::filesystem::path& errors);
  LiveProcess(const LiveProcess&) = delete;
  LiveProcess& operator=(const LiveProcess&) = delete;
  ~LiveProcess();  ///< kills it

  /// Writes text to its standard input; false if it reads no more. Throws `Violated` if it does not
  /// take it in two minutes.
  bool write(std::string_view text);
  /// The same, but reads no answers meanwhile: how much it took in so many milliseconds.
  std::size_t write_unheard(std::string_view text, int milliseconds);
  /// The next whole line of its answers, without the end; false after the last. Throws `Violated`
  /// if there is none in so many milliseconds.
  bool read_line(std::string& line, int patience = 120'000);
  /// The same without waiting: false also if there is none yet.
  bool next_line(std::string& line);
  /// Nobody reads its answers any more.
  void close_answers() { out_.close(); }
  void end_input() { in_.close(); }
  void send_signal(int number) const;
  /// Ends its input, reads its answers to the end, and waits for it; the status of waitpid(2).
  /// `on_line` gets each line. Throws `Violated` if it does not end in two minutes.
  template <class OnLine>
  int finish(OnLine on_line) {
    end_input();
    for (std::string line; out_.is_open() && read_line(line);) on_line(line);
    return wait();
  }

  /// Resident memory [kB].
  long memory() const;

 private:
  bool wait_until_ready(bool to_write, bool to_read, int milliseconds);
  bool read_some();
  int wait();

  pid_t process_ = -1;
  faults::Descriptor in_, out_;
  std::string answers_;  // read, and not yet handed out
  bool ended_ = false;
};

}  // namespace cairn::soak
