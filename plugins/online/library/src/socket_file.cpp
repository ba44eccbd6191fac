// SPDX-License-Identifier: BSD-3-Clause
#include "socket_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/descriptor.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kOwnerOnly = 0600;
constexpr int kLockAttempts = 200;
constexpr std::chrono::milliseconds kPause{10};

[[noreturn]] void fail(const fs::path& file, const std::string& what, int reason) {
  throw Error(ErrorCode::input, fmt::format("{}: {}: {}", file.string(), what,
                                            std::generic_category().message(reason)));
}

sockaddr_un address_of(const fs::path& file) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& name = file.native();
  if (name.empty() || name.size() >= sizeof address.sun_path) {
    throw Error(ErrorCode::usage,
                fmt::format("'{}' cannot be the name of a socket; expected 1 to {} bytes", name,
                            sizeof address.sun_path - 1));
  }
  std::memcpy(address.sun_path, name.c_str(), name.size() + 1);
  return address;
}

/// One process at a time looks at the names of a folder and replaces one: the lock is that of the
/// folder itself, so that no file is left.
class FolderLock {
 public:
  explicit FolderLock(const fs::path& file)
      : folder_(::open(file.has_parent_path() ? file.parent_path().c_str() : ".",
                       O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (folder_.number() < 0) fail(file, "its folder cannot be opened", errno);
    for (int k = 0; ::flock(folder_.number(), LOCK_EX | LOCK_NB) != 0; ++k) {
      if (errno != EWOULDBLOCK && errno != EINTR) fail(file, "its folder cannot be locked", errno);
      if (k == kLockAttempts)
        fail(file, "its folder is locked by another process; try again", errno);
      std::this_thread::sleep_for(kPause);
    }
  }

 private:
  Descriptor folder_;
};

const sockaddr* generic(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// Nothing, or a socket that nothing listens on, which is removed. Under the lock.
void make_room(const fs::path& file, const sockaddr_un& address) {
  struct stat there {};
  if (::lstat(file.c_str(), &there) != 0) {
    if (errno == ENOENT) return;
    fail(file, "cannot be examined", errno);
  }
  if (!S_ISSOCK(there.st_mode)) {
    throw Error(ErrorCode::usage,
                fmt::format("{} is there and is no socket; name another file, or remove this one",
                            file.string()));
  }
  const Descriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (probe.number() < 0) fail(file, "no socket can be made", errno);
  const bool connected = ::connect(probe.number(), generic(address), sizeof address) == 0;
  const int reason = connected ? 0 : errno;
  if (reason == EACCES || reason == EPERM) fail(file, "is the socket of another user", reason);
  if (reason != ECONNREFUSED) {  // EAGAIN: somebody listens, whose queue is full
    throw Error(ErrorCode::usage,
                fmt::format("{}: another process listens there; end it, or name another file",
                            file.string()));
  }
  if (::unlink(file.c_str()) != 0)
    fail(file, "is the socket of a process that has ended, and cannot be removed", errno);
}

}  // namespace

SocketFile::SocketFile(fs::path file) : SocketFile() {
  file_ = std::move(file);
  const sockaddr_un address = address_of(file_);
  const FolderLock lock(file_);
  make_room(file_, address);
  descriptor_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor_ < 0) fail(file_, "no socket can be made", errno);
  if (::bind(descriptor_, generic(address), sizeof address) != 0)
    fail(file_, "cannot be made", errno);
  bound_ = true;
  struct stat made {};
  // Nobody can connect before it listens, and then its permissions are what they shall be.
  if (::lstat(file_.c_str(), &made) != 0 || ::chmod(file_.c_str(), kOwnerOnly) != 0)
    fail(file_, "its permissions cannot be set", errno);
  device_ = made.st_dev;
  inode_ = made.st_ino;
  if (::listen(descriptor_, SOMAXCONN) != 0) fail(file_, "cannot be listened on", errno);
}

SocketFile::~SocketFile() {
  struct stat there {};
  if (bound_ && ::lstat(file_.c_str(), &there) == 0 && there.st_dev == device_ &&
      there.st_ino == inode_)
    ::unlink(file_.c_str());
  if (descriptor_ >= 0) ::close(descriptor_);
}

int SocketFile::take_descriptor() { return std::exchange(descriptor_, -1); }

}  // namespace cairn
