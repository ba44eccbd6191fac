// SPDX-License-Identifier: BSD-3-Clause
#include "process.hpp"

#include <fcntl.h>
#include <sys/personality.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

namespace cairn::faults {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error(what + ": " + std::strerror(errno));
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> all;
  for (std::string& word : words) all.push_back(word.data());
  all.push_back(nullptr);
  return all;
}

}  // namespace

Descriptor::Descriptor(const fs::path& file, int flags)
    : number_(::open(file.c_str(), flags | O_CLOEXEC, 0600)) {
  if (number_ < 0) fail(file.string());
}

Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(number_, other.number_);
  return *this;
}

void Descriptor::close() {
  if (number_ >= 0) ::close(std::exchange(number_, -1));
}

pid_t start_process(Launch launch, const Streams& streams) {
  const std::vector<char*> argv = pointers(launch.command), envp = pointers(launch.environment);
  const pid_t child = ::fork();
  if (child < 0) fail("fork");
  if (child > 0) return child;
  const bool ready = ::chdir(launch.folder.c_str()) == 0 && ::dup2(streams.in, STDIN_FILENO) >= 0 &&
                     ::dup2(streams.out, STDOUT_FILENO) >= 0 &&
                     ::dup2(streams.err, STDERR_FILENO) >= 0;
  if (!ready) ::_exit(126);
  ::signal(SIGPIPE, SIG_DFL);
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  ::personality(ADDR_NO_RANDOMIZE);
  ::alarm(launch.seconds);
  ::execve(argv[0], argv.data(), envp.data());
  ::_exit(126);
}

int wait_for(pid_t process) {
  int status = 0;
  while (::waitpid(process, &status, 0) < 0) {
    if (errno != EINTR) fail("waitpid");
  }
  return status;
}

std::vector<std::string> plain_environment(const fs::path& nowhere) {
  std::vector<std::string> all{"PATH=/usr/bin:/bin", "LC_ALL=C.UTF-8", "OPENBLAS_NUM_THREADS=1",
                               "XDG_DATA_HOME=" + nowhere.string()};
  if (const char* libraries = std::getenv("LD_LIBRARY_PATH"))  // of a program that was moved
    all.push_back(std::string("LD_LIBRARY_PATH=") + libraries);
  return all;
}

std::string read_bytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream stream(file, std::ios::binary);
  stream << bytes;
  stream.close();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace cairn::faults
