// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/peak_memory.hpp"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <fstream>
#include <string>

namespace cairn::app {
namespace {

constexpr int kLookAtInterrupt = 100;  // [ms] between two looks

/// What a child writes, to its end. An interrupt of this process alone does not reach the child.
std::string read_all(int descriptor, pid_t child, const std::atomic<bool>& interrupt) {
  std::string text;
  char buffer[4096];
  for (;;) {
    pollfd end{descriptor, POLLIN, 0};
    const int ready = ::poll(&end, 1, kLookAtInterrupt);
    if (interrupt.load()) ::kill(child, SIGTERM);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const ssize_t count = ::read(descriptor, buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(buffer, static_cast<std::size_t>(count));
  }
}

bool exited(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return false;
  }
  return WIFEXITED(status);
}

}  // namespace

std::int64_t peak_memory_bytes() {
  // getrusage would do, but its figure survives exec: started from a large process, a small program
  // would inherit that one's peak. The kernel's mark of this address space does not.
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::int64_t kilobytes = 0;
    if (word == "VmHWM:" && status >> kilobytes) return kilobytes * 1024;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
}

std::optional<std::string> output_of_self(const std::vector<std::string>& arguments,
                                          const std::atomic<bool>& interrupt) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return std::nullopt;
  std::vector<std::string> words{"cairn"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed =
      ::posix_spawn(&child, "/proc/self/exe", &actions, nullptr, argv.data(), ::environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text = failed ? std::string() : read_all(ends[0], child, interrupt);
  ::close(ends[0]);
  if (failed || !exited(child)) return std::nullopt;
  return text;
}

}  // namespace cairn::app
