// SPDX-License-Identifier: BSD-3-Clause
#include "trial_opening.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include <fmt/core.h>

namespace cairn {
namespace {

constexpr int kLongest = 10000;  // [ms]

// The first byte that the child writes: how it went.
constexpr char kReturned = 'r', kThrew = 't', kLackedMemory = 'm';

/// Of the child. A terminate handler can reach nothing but globals.
int report_to = -1;

void report(char outcome, std::string_view what = {}) {
  std::array<char, 1024> text;
  text[0] = outcome;
  const std::size_t size = what.copy(text.data() + 1, text.size() - 1);
  static_cast<void>(!::write(report_to, text.data(), size + 1));  // at once: shorter than PIPE_BUF
}

[[noreturn]] void report_exception() {
  try {
    if (std::current_exception()) throw;
    report(kThrew, "std::terminate was called");
  } catch (const std::bad_alloc&) {
    report(kLackedMemory);
  } catch (const std::exception& error) {
    report(kThrew, error.what());
  } catch (...) {
    report(kThrew, "it is not a std::exception");
  }
  ::_exit(EXIT_FAILURE);
}

/// Before all handlers of exit() that were registered in the parent, which would remove its files.
void leave(int status, void*) { ::_exit(status); }

[[noreturn]] void open_in_child(const char* library, int descriptor) {
  static_cast<void>(::prctl(PR_SET_PDEATHSIG, SIGKILL));  // it ends with its parent
  const rlimit no_core{0, 0};
  static_cast<void>(::setrlimit(RLIMIT_CORE, &no_core));
  for (const int signal :
       {SIGINT, SIGTERM, SIGHUP, SIGABRT, SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGALRM})
    static_cast<void>(std::signal(signal, SIG_DFL));
  const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    static_cast<void>(::dup2(nothing, standard));  // what is printed is printed again by the parent
  report_to = descriptor;
  std::set_terminate(report_exception);
  static_cast<void>(::on_exit(leave, nullptr));
  // The declaration of dlopen says that nothing is thrown, so that what is thrown would pass here.
  void* (*volatile const open)(const char*, int) = &::dlopen;
  try {
    static_cast<void>(open(library, RTLD_NOW | RTLD_LOCAL));
  } catch (...) {
    report_exception();
  }
  report(kReturned);
  ::_exit(EXIT_SUCCESS);
}

/// What the child has written: nothing where it ended without, or did not end in time.
std::string read_report(int descriptor, bool& in_time) {
  std::array<char, 1024> text;
  for (;;) {
    pollfd wait{descriptor, POLLIN, 0};
    const int ready = ::poll(&wait, 1, kLongest);
    if (ready < 0 && errno == EINTR) continue;
    in_time = ready > 0;
    if (!in_time) return {};
    const ssize_t count = ::read(descriptor, text.data(), text.size());
    if (count < 0 && errno == EINTR) continue;
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(0, count))};
  }
}

/// How a child ended that reported nothing; empty where that is not the library's doing.
std::string end_of(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return {};  // the process has another that waits for its children
  }
  if (WIFEXITED(status)) {
    return fmt::format("a static constructor ended the process with exit code {}",
                       WEXITSTATUS(status));
  }
  const int signal = WTERMSIG(status);
  for (const int from_outside : {SIGINT, SIGTERM, SIGHUP, SIGKILL}) {
    if (signal == from_outside) return {};
  }
  return fmt::format("a static constructor crashed ({})", ::strsignal(signal));
}

}  // namespace

std::string failure_of_static_constructors(const std::filesystem::path& library) {
  std::array<int, 2> ends{-1, -1};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return {};
  const pid_t child = ::fork();
  if (child == 0) open_in_child(library.c_str(), ends[1]);
  ::close(ends[1]);
  bool in_time = true;
  const std::string said = child > 0 ? read_report(ends[0], in_time) : std::string();
  ::close(ends[0]);
  if (child < 0) return {};
  if (!in_time || !said.empty()) ::kill(child, SIGKILL);
  const std::string end = end_of(child);
  if (!in_time || said.starts_with(kReturned)) return {};
  if (said.starts_with(kLackedMemory)) throw std::bad_alloc();
  if (said.starts_with(kThrew)) return "a static constructor threw an exception: " + said.substr(1);
  return end;
}

}  // namespace cairn
