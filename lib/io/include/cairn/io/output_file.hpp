// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// A file that is written from front to back, and replaces what was there only when it is whole:
/// it is written beside its name, synchronised to the disk and renamed. Until `finish` has returned
/// the old file stands, and if it never does, nothing is left but that. Pipes, terminals and
/// devices are written in place. Names of links stay links. A name of a descriptor that the process
/// has open (/dev/stdout, /dev/fd/3, also of a regular file) is written to that descriptor.
class CAIRN_API OutputFile {
 public:
  /// Throws `Error` (input) where nothing can be written under that name.
  explicit OutputFile(const std::filesystem::path& file);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  /// Adds bytes. What fails is remembered, and nothing is written after it: a full disk need not
  /// end what goes on meanwhile.
  void write(std::string_view bytes) noexcept;
  /// The file has all its bytes. Throws `Error` (input) if any could not be written.
  void finish();

 private:
  void open_descriptor(int number);
  void open_fifo();
  void open_beside(int mode);
  void unlist() noexcept;
  friend void remove_unfinished_outputs() noexcept;
  [[noreturn]] void fail(int reason) const;

  std::filesystem::path file_;    // as it was named
  std::filesystem::path target_;  // that, with links followed
  std::filesystem::path beside_;  // empty: in place
  int descriptor_ = -1;
  bool is_fifo_ = false;        // its reader is not waited for after an interrupt
  int failure_ = 0;             // of the first write that failed
  OutputFile* next_ = nullptr;  // of those that lie beside their names
};

/// Outputs that are FIFOs are not waited for any longer once this is true; null: for ever. It must
/// live until another is set.
CAIRN_API void end_waiting_for_readers_on(const std::atomic<bool>* interrupt) noexcept;

/// For a process that must end in any of its threads, without the destructors of what others have:
/// removes what lies beside its name. None is opened or finished after that: who tries waits.
CAIRN_API void remove_unfinished_outputs() noexcept;

}  // namespace cairn
