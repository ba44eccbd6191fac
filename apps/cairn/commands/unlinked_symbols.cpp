// SPDX-License-Identifier: BSD-3-Clause
#include "unlinked_symbols.hpp"

#include <cxxabi.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

namespace cairn::app {
namespace {

namespace fs = std::filesystem;

/// The dynamic linker that this program was started with.
std::string dynamic_linker() {
  std::string path;
  ::dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* out) {
        for (int k = 0; k < info->dlpi_phnum; ++k) {
          if (info->dlpi_phdr[k].p_type != PT_INTERP) continue;
          // NOLINTNEXTLINE(performance-no-int-to-ptr): so the ELF headers have it
          *static_cast<std::string*>(out) =
              reinterpret_cast<const char*>(info->dlpi_addr + info->dlpi_phdr[k].p_vaddr);
        }
        return 1;  // the first is the program
      },
      &path);
  return path;
}

/// What the dynamic linker says of a file when it is asked to resolve all, but to run nothing.
std::optional<std::string> linker_output(const fs::path& plugin) {
  const std::string linker = dynamic_linker();
  if (linker.empty()) return {};
  std::array<int, 2> ends{-1, -1};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return {};
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  std::vector<std::string> settings{"LD_TRACE_LOADED_OBJECTS=1", "LD_WARN=yes", "LD_BIND_NOW=yes"};
  if (const char* path = std::getenv("LD_LIBRARY_PATH"))
    settings.push_back(std::string("LD_LIBRARY_PATH=") + path);
  std::vector<char*> environment;
  for (std::string& setting : settings) environment.push_back(setting.data());
  environment.push_back(nullptr);
  std::string program = linker, file = fs::absolute(plugin);
  std::array<char*, 3> arguments{program.data(), file.data(), nullptr};
  pid_t child = -1;
  const int failed = ::posix_spawn(&child, linker.c_str(), &actions, nullptr, arguments.data(),
                                   environment.data());
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text;
  if (failed == 0) {
    std::array<char, 4096> bytes;
    for (ssize_t count = 0; (count = ::read(ends[0], bytes.data(), bytes.size())) > 0;)
      text.append(bytes.data(), static_cast<std::size_t>(count));
    while (::waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  ::close(ends[0]);
  return failed == 0 ? std::optional(text) : std::nullopt;
}

std::string readable(const std::string& symbol) {
  int status = 0;
  const std::unique_ptr<char, void (*)(void*)> name(
      abi::__cxa_demangle(symbol.c_str(), nullptr, nullptr, &status), std::free);
  return status == 0 ? std::string(name.get()) : symbol;
}

/// The library of cairn that has the symbol in this process; empty if none has.
std::string library_of(const std::string& symbol) {
  void* const address = ::dlsym(RTLD_DEFAULT, symbol.c_str());
  Dl_info info{};
  if (!address || ::dladdr(address, &info) == 0 || !info.dli_fname) return {};
  std::string name = fs::path(info.dli_fname).filename();
  return name.starts_with("libcairn") ? name : std::string();
}

}  // namespace

std::vector<std::string> unlinked_symbols(const fs::path& plugin) {
  const std::optional<std::string> output = linker_output(plugin);
  if (!output) return {};
  constexpr std::string_view kUndefined = "undefined symbol: ", kMissing = " => not found";
  std::istringstream lines(*output);
  std::set<std::string> missing;  // linked with, and found by this process in another way
  std::vector<std::string> symbols, found;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find_first_not_of(" \t");
    if (line.ends_with(kMissing))
      missing.insert(line.substr(begin, line.size() - kMissing.size() - begin));
    if (begin == std::string::npos || line.compare(begin, kUndefined.size(), kUndefined) != 0)
      continue;
    const std::size_t from = begin + kUndefined.size();
    symbols.push_back(line.substr(from, line.find_first_of(" \t,(", from) - from));
  }
  for (const std::string& symbol : symbols) {
    const std::string library = library_of(symbol);
    if (!library.empty() && !missing.contains(library))
      found.push_back(library + ": " + readable(symbol));
  }
  return found;
}

}  // namespace cairn::app
