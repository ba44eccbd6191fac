// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace cairn::performance {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kShareOfMemory = 0.8;
constexpr double kGrace = 5.0;  // seconds from the interrupt to the kill

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string last_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  const std::size_t newline = text.rfind('\n');
  return newline == std::string::npos ? text : text.substr(newline + 1);
}

pid_t start(const std::vector<std::string>& words, const fs::path& out, const fs::path& error) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  constexpr int kWrite = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), kWrite, 0644);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, error.c_str(), kWrite, 0644);
  const pid_t child = spawn_program(words, actions);
  const auto bytes = static_cast<rlim_t>(allowed_memory());
  const rlimit limit{bytes, bytes};
  ::prlimit(child, RLIMIT_AS, &limit, nullptr);
  return child;
}

/// Whether the child ended within that many seconds; asks seldom, so as not to disturb it.
bool wait_for(pid_t child, double seconds, int& status) {
  const Clock::time_point end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                                   std::chrono::duration<double>(seconds));
  while (Clock::now() < end) {
    if (::waitpid(child, &status, WNOHANG) == child) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return false;
}

void wait_for_ever(pid_t child, int& status) {
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace

pid_t spawn_program(const std::vector<std::string>& words, posix_spawn_file_actions_t& actions) {
  std::vector<std::string> copies = words;
  std::vector<char*> argv;
  for (std::string& word : copies) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t child = 0;
  const int failed = ::posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), ::environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed) throw std::runtime_error("cannot start " + words.front());
  return child;
}

double allowed_memory() {
  return kShareOfMemory * static_cast<double>(::sysconf(_SC_PHYS_PAGES)) *
         static_cast<double>(::sysconf(_SC_PAGESIZE));
}

Outcome run_program(const std::vector<std::string>& words, const fs::path& work, double limit) {
  fs::create_directories(work);
  const fs::path out = work / "child.out", error = work / "child.err";
  const Clock::time_point begin = Clock::now();
  const pid_t child = start(words, out, error);
  Outcome outcome;
  int status = 0;
  if (limit <= 0.0) {
    wait_for_ever(child, status);
  } else if (!wait_for(child, limit, status)) {
    outcome.in_time = false;
    ::kill(child, SIGINT);  // cairn then reports how far it came
    if (!wait_for(child, kGrace, status)) {
      ::kill(child, SIGKILL);
      wait_for_ever(child, status);
    }
  }
  outcome.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  outcome.output = content(out);
  outcome.complaint = last_line(content(error));
  return outcome;
}

}  // namespace cairn::performance
