// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace cairn::app {

/// Work in a child process, which may crash, loop for ever or end itself: none of that ends this
/// one. The work sends lines to this process, and keeps it informed of the call that it is about to
/// make. To be started while this process has one thread only (it is a fork without exec).
class IsolatedWork {
 public:
  /// What the work has of its connection to this process.
  class Sender {
   public:
    Sender(int pipe, void* shared, std::string_view mark)
        : pipe_(pipe), shared_(shared), mark_(mark) {}
    /// One line; `line` must hold no line break.
    void send(std::string_view line) const;
    /// A call that may not return: its function and its arguments in words.
    void calling(std::string_view function, std::string_view arguments) const;

   private:
    int pipe_;
    void* shared_;
    std::string mark_;  // before each line
  };

  /// Starts the work. Throws `Error` (numerical) where the system has no process for it.
  explicit IsolatedWork(const std::function<void(const Sender&)>& work);
  IsolatedWork(const IsolatedWork&) = delete;
  IsolatedWork& operator=(const IsolatedWork&) = delete;
  /// Kills the child if it has not ended.
  ~IsolatedWork();

  /// The next line that the work sends; none once it has ended, or when it has sent nothing for so
  /// many seconds: it is killed then.
  std::optional<std::string> next_line(double seconds);

  /// After the last line: how the process ended where its work did not: "crashed (Segmentation
  /// fault)", "ended the process with exit code 3", "did not return within 10 s", "wrote to a
  /// descriptor that it has not opened". Empty: the work was finished.
  std::string failure() const;
  /// Whether it was killed since it did not return.
  bool timed_out() const { return waited_ > 0.0; }
  /// Whether the work wrote where only this process's lines belong.
  bool wrote_elsewhere() const { return foreign_; }
  /// The call during which that was.
  std::string function() const;
  std::string arguments() const;
  /// The last of what the child wrote to standard output and standard error, which both lead here.
  std::string printed() const;

 private:
  void kill_child();

  int child_ = -1;
  int pipe_ = -1;
  int output_ = -1;  // a file in memory
  void* shared_ = nullptr;
  std::string buffer_;
  int status_ = 0;
  std::string mark_;  // a random word: what has none was not sent by the work
  bool finished_ = false;
  bool foreign_ = false;  // something without the mark came
  double waited_ = 0.0;   // seconds, when it was killed for that
};

}  // namespace cairn::app
