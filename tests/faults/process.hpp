// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace cairn::faults {

/// What a process is started with.
struct Launch {
  std::vector<std::string> command;      ///< the program's path, and its arguments
  std::vector<std::string> environment;  ///< NAME=value, and nothing of the caller's
  std::filesystem::path folder;          ///< it runs there
  unsigned seconds = 60;                 ///< it is killed after so many; 0: never
};

/// Descriptors that become a process's standard input, output and error.
struct Streams {
  int in = -1, out = -1, err = -1;
};

/// A descriptor that is closed with this object, and that no process inherits.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int number) : number_(number) {}
  /// Opens a file as open(2) does. Throws `std::runtime_error`.
  Descriptor(const std::filesystem::path& file, int flags);
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  ~Descriptor() { close(); }
  int number() const { return number_; }
  bool is_open() const { return number_ >= 0; }
  void close();

 private:
  int number_ = -1;
};

/// Starts a process: without core files, and with the same addresses, and so the same order, in
/// every run. Throws `std::runtime_error` if there can be none.
pid_t start_process(Launch launch, const Streams& streams);

/// Waits for the end of a process; the status of waitpid(2).
int wait_for(pid_t process);

/// The environment of programs under test: neither plugins nor numbers of threads of the caller.
/// `nowhere` is a folder that is not there.
std::vector<std::string> plain_environment(const std::filesystem::path& nowhere);

/// The whole content of a file; empty if there is none.
std::string read_bytes(const std::filesystem::path& file);
/// Throws `std::runtime_error` where that is impossible.
void write_bytes(const std::filesystem::path& file, const std::string& bytes);

}  // namespace cairn::faults
