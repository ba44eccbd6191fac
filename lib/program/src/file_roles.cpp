// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/file_roles.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <new>
#include <system_error>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

/// The same for all names of a file, be it there or not; empty for what has no identity.
std::string identity_of(const std::string& file) {
  if (file.empty() || file == "-" || file.starts_with('@')) return {};
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0)
    return S_ISREG(status.st_mode) ? fmt::format("{} {}", status.st_dev, status.st_ino) : "";
  std::error_code error;
  std::filesystem::path path = std::filesystem::absolute(file, error);
  for (int depth = 0; depth < 40 && std::filesystem::is_symlink(path, error); ++depth)
    path = path.parent_path() / std::filesystem::read_symlink(path, error);
  path = std::filesystem::weakly_canonical(path, error);
  if (error == std::errc::not_enough_memory) throw std::bad_alloc();
  return error ? file : path.string();
}

[[noreturn]] void refuse(const std::string& input) {
  throw Error(ErrorCode::usage,
              fmt::format("{} is read, and an output would replace it; name another", input));
}

}  // namespace

void FileRoles::add_graph(const std::string& file) { read(file, true); }
void FileRoles::add_input(const std::string& file) { read(file, false); }
void FileRoles::add_result(const std::string& file) { write(file, true); }
void FileRoles::add_output(const std::string& file) { write(file, false); }

void FileRoles::read(const std::string& file, bool exchangeable) {
  const File input{file, identity_of(file == "-" ? "/dev/stdin" : file), exchangeable};
  if (input.identity.empty()) return;
  for (const File& output : outputs_) {
    if (output.identity == input.identity && !(exchangeable && output.exchangeable)) refuse(file);
  }
  inputs_.push_back(input);
}

void FileRoles::write(const std::string& file, bool exchangeable) {
  const File output{file, identity_of(file), exchangeable};
  if (output.identity.empty()) return;
  for (const File& other : outputs_) {
    if (other.identity != output.identity) continue;
    const std::string names = other.name == file ? file : other.name + " and " + file;
    throw Error(ErrorCode::usage,
                fmt::format("two outputs go to one file, {}; name another for one of them", names));
  }
  for (const File& input : inputs_) {
    if (input.identity == output.identity && !(exchangeable && input.exchangeable)) refuse(file);
  }
  outputs_.push_back(output);
}

}  // namespace cairn::app
