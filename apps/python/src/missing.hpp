// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "cairn/graph/graph.hpp"
#include "cairn/io/file_error.hpp"
#include "cairn/runtime/error.hpp"

/// Errors of what is not there, which Python has kinds of exceptions for.
namespace cairn::python {

/// An id, or the position of a factor, that nothing has: a `KeyError` too.
class MissingKey : public Error {
 public:
  explicit MissingKey(const std::string& message) : Error(ErrorCode::usage, message) {}
};

/// A file, or the folder of one that is to be written: a `FileNotFoundError` too.
class MissingFile : public Error {
 public:
  MissingFile(const Error& error, std::filesystem::path file)
      : Error(error.code(), error.what()), file_(std::move(file)) {}
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
};

/// Of the variable with that id. Throws `MissingKey`.
int index_of(const Graph& graph, Id id);

/// `work()`, which reads or writes `file`: with the kind of error that it is where `needed`, the
/// file or the folder that it is to be in, does not exist.
template <class Work>
auto with_file(const std::filesystem::path& file, const std::filesystem::path& needed,
               const Work& work) {
  try {
    return work();
  } catch (const FileError&) {  // the system has said what it is
    throw;
  } catch (const Error& error) {
    std::error_code problem;
    const bool there = needed.empty() || std::filesystem::exists(needed, problem) || problem;
    if (error.code() != ErrorCode::input || there) throw;
    throw MissingFile(error, file);
  }
}

}  // namespace cairn::python
