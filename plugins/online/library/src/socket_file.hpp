// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <filesystem>

namespace cairn {

/// The file of a Unix domain socket that this process listens on. It replaces one that nothing
/// listens on, which a process that was killed leaves, and nothing else. Removed at the end.
class SocketFile {
 public:
  /// Throws `Error`: see `LineServer`.
  explicit SocketFile(std::filesystem::path file);
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(const SocketFile&) = delete;
  ~SocketFile();

  /// The descriptor, which listens and does not block; the caller closes it.
  int take_descriptor();

 private:
  SocketFile() = default;

  std::filesystem::path file_;
  int descriptor_ = -1;
  bool bound_ = false;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace cairn
