// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// A write-ahead log of lines: what was committed is there again after the process was killed, or,
/// where it is synchronised, the machine lost its power.
///
/// The file is text. Its first line names the format and an identity (what the log belongs to);
/// every other is a record: the CRC-32 of the rest in hexadecimal, a number, and the text. What
/// stands behind the last good record (a line that was being written) is cut off when the file is
/// opened; a bad record with a good one behind it is damage, and refused. The file is locked while
/// it is open. Records that were not committed may be missing, but none is ever read in part.
class CAIRN_API Journal {
 public:
  struct Record {
    std::int64_t number = 0;  ///< the caller's, such as that of a line
    std::string text;         ///< without a line break
  };
  /// When `commit` waits until the disk has what was written.
  enum class Sync {
    every,  ///< each record is committed when it is appended
    batch,  ///< at every `commit`
    none,   ///< never: safe against the end of the process, not of the machine
  };

  /// Opens a journal, or begins one. Throws `Error` (usage) if it belongs to another identity or is
  /// in use, and `Error` (input) if it is damaged, is no journal, or cannot be read or written.
  Journal(std::filesystem::path file, std::string identity, Sync sync);
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;
  ~Journal();

  /// What was there when the journal was opened, handed over once.
  std::vector<Record> take_records() { return std::move(records_); }
  /// What was cut off then, as a sentence; empty if nothing was.
  const std::string& note() const { return note_; }

  /// Adds a record. Throws `Error` (input) where it cannot be written.
  void append(std::int64_t number, std::string_view text);
  /// Writes what was appended, and waits for the disk if so agreed.
  void commit();

 private:
  void load(const std::string& identity);
  void begin(const std::string& identity);
  void write_all(std::string_view bytes);
  void synchronise();
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path file_;
  Sync sync_;
  int descriptor_ = -1;
  std::vector<Record> records_;
  std::string note_;
  std::string pending_;
};

}  // namespace cairn
