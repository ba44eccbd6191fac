// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace cairn::performance {

/// A program that is spoken to line by line while it runs, such as `cairn online`.
class LiveProgram {
 public:
  /// Starts it. Throws `std::runtime_error` if that fails.
  explicit LiveProgram(const std::vector<std::string>& words);
  /// Kills it if `finish` was not called.
  ~LiveProgram();
  LiveProgram(const LiveProgram&) = delete;
  LiveProgram& operator=(const LiveProgram&) = delete;

  /// Sends whole lines. Throws `std::runtime_error` if the program has ended.
  void tell(const std::string& lines);
  /// The next line, without its end. Throws `std::runtime_error` if there are no more.
  std::string answer();
  /// Memory that is resident now [bytes].
  double resident_memory() const;
  /// Ends its input, and waits for its end. Returns the exit code; -1: a signal ended it.
  int finish();

 private:
  pid_t child_ = -1;
  int to_ = -1, from_ = -1;  ///< its standard input and output
  std::string heard_;
  std::size_t at_ = 0;  ///< where in that the next line begins
};

}  // namespace cairn::performance
