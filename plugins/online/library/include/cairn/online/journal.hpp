// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// A write-ahead log of lines: what was committed is there again after the process was killed, or,
/// where it is synchronised, the machine lost its power.
///
/// The file is text. Its first line names the format and an identity (what the log belongs to);
/// every other is a record: a checksum in hexadecimal, a number, and the text. The checksum is the
/// CRC-32 of the checksum of the line before followed by number and text, so that a record that is
/// damaged, missing, doubled or moved does not fit its place: that is refused. A last line without
/// its line break, which was being written, is cut off when the file is opened, and kept in
/// FILE.cut. The file is locked while it is open. Records that were not committed may be missing,
/// but none is ever read in part.
///
/// Files of format 1, whose checksums were of each line alone, are read and continued as such;
/// there the numbers must rise, and a record that is missing goes unnoticed.
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
  /// in use, and `Error` (input) if it is damaged, is not a journal or no regular file, or cannot
  /// be read or written.
  Journal(std::filesystem::path file, std::string identity, Sync sync);
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;
  ~Journal();

  /// What was there when the journal was opened, handed over once.
  std::vector<Record> take_records() { return std::move(records_); }
  /// What was cut off then, as a sentence; empty if nothing was.
  const std::string& note() const { return note_; }

  /// Adds a record; numbers must rise. Throws `Error` (input) where it cannot be written.
  void append(std::int64_t number, std::string_view text);
  /// Writes what was appended, and waits for the disk if so agreed. Throws `Error` (input) where
  /// that fails, or the file was removed or changed meanwhile; what was written in part is taken
  /// back.
  void commit();

 private:
  void load(const std::string& identity);
  void load_records(const std::string& bytes, std::size_t begin);
  void cut(const std::string& bytes, std::size_t size);
  void begin(const std::string& identity);
  std::string sealed(std::string_view rest);
  std::optional<std::string_view> unsealed(std::string_view line);
  void write_all(std::string_view bytes);
  void synchronise();
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path file_;
  Sync sync_;
  int descriptor_ = -1;
  bool chained_ = true;      // format 2
  std::uint32_t chain_ = 0;  // checksum of the line before
  std::int64_t size_ = 0;    // of what is written, in bytes
  std::vector<Record> records_;
  std::string note_;
  std::string pending_;
};

}  // namespace cairn
