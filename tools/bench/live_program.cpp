// SPDX-License-Identifier: BSD-3-Clause
#include "live_program.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <fstream>
#include <stdexcept>

#include "child_process.hpp"

namespace cairn::performance {

LiveProgram::LiveProgram(const std::vector<std::string>& words) {
  std::signal(SIGPIPE, SIG_IGN);  // a program that has ended is an error of `tell`
  std::array<int, 2> in{}, out{};
  if (::pipe2(in.data(), O_CLOEXEC) != 0 || ::pipe2(out.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("no pipe to " + words.front());
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in[0], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
  to_ = in[1];
  from_ = out[0];
  try {
    child_ = spawn_program(words, actions);
  } catch (...) {
    for (const int end : {in[0], in[1], out[0], out[1]}) ::close(end);
    throw;
  }
  ::close(in[0]);
  ::close(out[1]);
}

LiveProgram::~LiveProgram() {
  if (child_ > 0) {
    ::kill(child_, SIGKILL);
    finish();
  }
  if (from_ >= 0) ::close(from_);
}

void LiveProgram::tell(const std::string& lines) {
  for (std::size_t done = 0; done < lines.size();) {
    const ssize_t written = ::write(to_, lines.data() + done, lines.size() - done);
    if (written < 0 && errno != EINTR) throw std::runtime_error("the program has ended");
    if (written > 0) done += static_cast<std::size_t>(written);
  }
}

std::string LiveProgram::answer() {
  for (;;) {
    const std::size_t end = heard_.find('\n', at_);
    if (end != std::string::npos) {
      std::string line = heard_.substr(at_, end - at_);
      at_ = end + 1;
      return line;
    }
    heard_.erase(0, at_);
    at_ = 0;
    std::array<char, 65536> some{};
    const ssize_t count = ::read(from_, some.data(), some.size());
    if (count == 0 || (count < 0 && errno != EINTR))
      throw std::runtime_error("the program has ended");
    if (count > 0) heard_.append(some.data(), static_cast<std::size_t>(count));
  }
}

double LiveProgram::resident_memory() const {
  std::ifstream pages("/proc/" + std::to_string(child_) + "/statm");
  double all = 0.0, resident = 0.0;
  pages >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

int LiveProgram::finish() {
  ::close(to_);
  int status = 0;
  while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace cairn::performance
