// SPDX-License-Identifier: BSD-3-Clause
#include "isolated_work.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <random>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

constexpr std::size_t kPrinted = 2000;  // bytes
constexpr int kFinished = 0;            // exit code of the child

/// In memory that both processes have: read by this one when the other has crashed.
struct SharedCall {
  std::array<char, 128> function;
  std::array<char, 4096> arguments;
};

template <std::size_t N>
void copy_text(std::string_view text, std::array<char, N>& to) {
  const std::size_t size = std::min(text.size(), N - 1);
  std::memcpy(to.data(), text.data(), size);
  to[size] = '\0';
}

/// Instead of the program's own, which says that this is a bug of cairn.
[[noreturn]] void abort_with_reason() {
  try {
    if (std::current_exception()) throw;
    std::fputs("std::terminate was called\n", stderr);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "an exception that nothing caught: %s\n", error.what());
  } catch (...) {
    std::fputs("an exception that nothing caught\n", stderr);
  }
  std::abort();
}

[[noreturn]] void run_child(const std::function<void(const IsolatedWork::Sender&)>& work,
                            const IsolatedWork::Sender& sender, int output) {
  static_cast<void>(::prctl(PR_SET_PDEATHSIG, SIGKILL));  // it ends with its parent
  const rlimit no_core{0, 0};
  static_cast<void>(::setrlimit(RLIMIT_CORE, &no_core));
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (nothing >= 0) static_cast<void>(::dup2(nothing, STDIN_FILENO));
  static_cast<void>(::dup2(output, STDOUT_FILENO));
  static_cast<void>(::dup2(output, STDERR_FILENO));
  std::set_terminate(abort_with_reason);
  try {
    work(sender);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    std::_Exit(static_cast<int>(ErrorCode::plugin));
  }
  sender.send("");  // the work is finished; an exit code alone could be the plugin's
  std::_Exit(kFinished);
}

}  // namespace

void IsolatedWork::Sender::send(std::string_view line) const {
  std::string text = mark_;
  text += line;
  text += '\n';
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count = ::write(pipe_, text.data() + done, text.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) std::_Exit(kFinished);  // the parent is gone
    done += static_cast<std::size_t>(count);
  }
}

void IsolatedWork::Sender::calling(std::string_view function, std::string_view arguments) const {
  auto& call = *static_cast<SharedCall*>(shared_);
  copy_text(function, call.function);
  copy_text(arguments, call.arguments);
}

IsolatedWork::IsolatedWork(const std::function<void(const Sender&)>& work)
    : mark_(fmt::format("{:08x} ", std::random_device()())) {
  const auto refuse = [] {
    return Error(ErrorCode::numerical,
                 fmt::format("a child process cannot be started ({})", std::strerror(errno)));
  };
  shared_ = ::mmap(nullptr, sizeof(SharedCall), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS,
                   -1, 0);
  if (shared_ == MAP_FAILED) throw refuse();
  new (shared_) SharedCall{};
  std::array<int, 2> ends{-1, -1};
  output_ = ::memfd_create("output", MFD_CLOEXEC);
  if (output_ < 0 || ::pipe2(ends.data(), O_CLOEXEC) != 0) throw refuse();
  std::fflush(nullptr);  // or the child would write what is waiting here
  child_ = ::fork();
  if (child_ == 0) {
    ::close(ends[0]);
    run_child(work, Sender(ends[1], shared_, mark_), output_);
  }
  ::close(ends[1]);
  pipe_ = ends[0];
  if (child_ < 0) throw refuse();
}

IsolatedWork::~IsolatedWork() {
  kill_child();
  ::close(pipe_);
  ::close(output_);
  ::munmap(shared_, sizeof(SharedCall));
}

std::optional<std::string> IsolatedWork::next_line(double seconds) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  for (;;) {
    if (const std::size_t at = buffer_.find('\n'); at != std::string::npos) {
      std::string line = buffer_.substr(0, at);
      buffer_.erase(0, at + 1);
      foreign_ = !line.starts_with(mark_);
      finished_ = !foreign_ && line.size() == mark_.size();
      if (!foreign_ && !finished_) return line.substr(mark_.size());
      kill_child();
      return {};
    }
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count();
    pollfd descriptor{pipe_, POLLIN, 0};
    const int ready = left > 0 ? ::poll(&descriptor, 1, static_cast<int>(left)) : 0;
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) {
      waited_ = seconds;
      kill_child();
      return {};
    }
    std::array<char, 4096> bytes;
    const ssize_t count = ::read(pipe_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {  // it ended, or closed the pipe and goes on: it must not be waited for long
      status_ = W_EXITCODE(1, 0);
      for (int k = 0; k < 200 && child_ > 0; ++k) {
        if (::waitpid(child_, &status_, WNOHANG) == child_) child_ = -1;
        if (child_ > 0) ::usleep(10000);
      }
      kill_child();
      return {};
    }
    buffer_.append(bytes.data(), static_cast<std::size_t>(count));
  }
}

void IsolatedWork::kill_child() {
  if (child_ <= 0) return;
  ::kill(child_, SIGKILL);
  while (::waitpid(child_, &status_, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
}

std::string IsolatedWork::failure() const {
  if (finished_) return {};
  if (foreign_) return "wrote to a descriptor that it has not opened";
  if (waited_ > 0.0) return fmt::format("did not return within {:g} s", waited_);
  if (WIFSIGNALED(status_)) return fmt::format("crashed ({})", ::strsignal(WTERMSIG(status_)));
  return fmt::format("ended the process with exit code {}", WEXITSTATUS(status_));
}

std::string IsolatedWork::function() const {
  return static_cast<const SharedCall*>(shared_)->function.data();
}

std::string IsolatedWork::arguments() const {
  return static_cast<const SharedCall*>(shared_)->arguments.data();
}

std::string IsolatedWork::printed() const {
  const off_t size = ::lseek(output_, 0, SEEK_END);
  const off_t begin = std::max<off_t>(0, size - static_cast<off_t>(kPrinted));
  std::string text(static_cast<std::size_t>(std::max<off_t>(0, size - begin)), '\0');
  const ssize_t count = ::pread(output_, text.data(), text.size(), begin);
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, count)));
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

}  // namespace cairn::app
