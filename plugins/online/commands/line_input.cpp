// SPDX-License-Identifier: BSD-3-Clause
#include "line_input.hpp"

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

constexpr std::size_t kLongestLine = 16u << 20;
constexpr int kLookAtInterrupt = 100;  // [ms]: a signal may arrive just before the wait begins

}  // namespace

bool LineInput::next(std::string& line) {
  while (!interrupt_) {
    const std::size_t end = buffer_.find('\n', searched_);
    if (end != std::string::npos) {
      line.assign(buffer_, begin_, end - begin_);
      begin_ = searched_ = end + 1;
      return true;
    }
    searched_ = buffer_.size();
    if (searched_ - begin_ > kLongestLine) {
      throw Error(ErrorCode::input, "standard input: a line of more than 16 MB; expected text");
    }
    if (!ended_ && fill()) continue;
    return false;
  }
  return false;
}

/// Waits for more; false at the end of the input or when interrupted.
bool LineInput::fill() {
  buffer_.erase(0, begin_);
  searched_ -= begin_;
  begin_ = 0;
  pollfd waiting{STDIN_FILENO, POLLIN, 0};
  const int ready = ::poll(&waiting, 1, kLookAtInterrupt);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return !interrupt_;
  char more[1 << 16];
  const ssize_t got = ::read(STDIN_FILENO, more, sizeof more);
  if (got < 0 && errno == EINTR) return !interrupt_;
  if (got < 0) {
    throw Error(ErrorCode::input,
                fmt::format("standard input cannot be read: {}", std::strerror(errno)));
  }
  ended_ = got == 0;
  buffer_.append(more, static_cast<std::size_t>(got));
  return !ended_;
}

}  // namespace cairn::app
