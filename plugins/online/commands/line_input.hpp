// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <string>

namespace cairn::app {

/// Lines of standard input, each as soon as it is there.
class LineInput {
 public:
  /// `interrupt`: ends the waiting once it is true.
  explicit LineInput(const std::atomic<bool>& interrupt) : interrupt_(interrupt) {}

  /// The next line, without its end; false at the end of the input or when interrupted. Throws
  /// `Error` (input) for a line of more than 16 MB, or where reading fails.
  bool next(std::string& line);
  /// After the end: a last line without its end, which may be the half of what was to be said.
  std::string rest() const { return ended_ ? buffer_.substr(begin_) : std::string(); }

 private:
  bool fill();

  const std::atomic<bool>& interrupt_;
  std::string buffer_;
  std::size_t begin_ = 0;     // of what was not handed out
  std::size_t searched_ = 0;  // up to here there is no end of line
  bool ended_ = false;
};

}  // namespace cairn::app
