// SPDX-License-Identifier: BSD-3-Clause
#include "file_roles.hpp"

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

}  // namespace

void FileRoles::refuse(const std::string& input) {
  throw Error(ErrorCode::usage,
              fmt::format("{} is read, and an output would replace it; name another", input));
}

void FileRoles::add_input(const std::string& file) {
  const std::string identity = identity_of(file == "-" ? "/dev/stdin" : file);
  if (identity.empty()) return;
  for (const Output& output : outputs_) {
    if (output.identity == identity && !output.may_replace_an_input) refuse(file);
  }
  inputs_.push_back(identity);
}

void FileRoles::add_output(const std::string& file, bool may_replace_an_input) {
  const std::string identity = identity_of(file);
  if (identity.empty()) return;
  for (const Output& output : outputs_) {
    if (output.identity != identity) continue;
    const std::string names = output.name == file ? file : output.name + " and " + file;
    throw Error(ErrorCode::usage,
                fmt::format("two outputs go to one file, {}; name another for one of them", names));
  }
  if (!may_replace_an_input && std::ranges::find(inputs_, identity) != inputs_.end()) refuse(file);
  outputs_.push_back({file, identity, may_replace_an_input});
}

}  // namespace cairn::app
