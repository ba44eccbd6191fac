// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "fault_record.hpp"

namespace cairn::faults {

/// A FaultRecord in a file, shared with the process that fills it.
class SharedRecord {
 public:
  /// Makes the file, or empties it. Throws `std::runtime_error`.
  explicit SharedRecord(const std::filesystem::path& file);
  SharedRecord(const SharedRecord&) = delete;
  SharedRecord& operator=(const SharedRecord&) = delete;
  ~SharedRecord();
  FaultRecord& operator*() const { return *record_; }
  FaultRecord* operator->() const { return record_; }

 private:
  FaultRecord* record_ = nullptr;
};

}  // namespace cairn::faults
