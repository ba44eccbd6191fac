// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "cairn/runtime/api.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

/// An error (input) of the system about a file: it is not there, is a folder, or the disk is full.
class CAIRN_API FileError : public Error {
 public:
  /// `number`: of the system's error (errno).
  FileError(const std::string& message, std::filesystem::path file, int number)
      : Error(ErrorCode::input, message), file_(std::move(file)), number_(number) {}
  const std::filesystem::path& file() const { return file_; }
  int number() const { return number_; }

 private:
  std::filesystem::path file_;
  int number_;
};

}  // namespace cairn
