// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <new>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kNewFile = 0666;
constexpr int kMostAttempts = 100;  // to find a name that is free

std::string system_message(int number) { return std::generic_category().message(number); }

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw Error(ErrorCode::input, fmt::format("{}: {}", file.string(), what));
}

/// Calls again what a signal has interrupted.
template <class Call>
auto without_interrupts(const Call& call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// The file that a chain of symbolic links ends in, so that replacing it keeps the links.
fs::path follow_links(fs::path file) {
  std::error_code ignored;
  for (int depth = 0; depth < 40 && fs::is_symlink(file, ignored); ++depth) {
    const fs::path next = fs::read_symlink(file, ignored);
    if (ignored == std::errc::not_enough_memory) throw std::bad_alloc();
    if (ignored) break;
    file = next.is_absolute() ? next : file.parent_path() / next;
  }
  return file;
}

}  // namespace

OutputFile::OutputFile(const fs::path& file) : file_(file), target_(follow_links(file)) {
  struct stat status {};
  const bool exists = ::stat(target_.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) refuse(file_, "is a folder; expected a file name");
  if (exists && !S_ISREG(status.st_mode)) {
    // Renaming a file over these would remove them.
    descriptor_ = without_interrupts([&] { return ::open(target_.c_str(), O_WRONLY | O_CLOEXEC); });
    if (descriptor_ < 0) fail(errno);
    return;
  }
  open_beside(exists ? static_cast<int>(status.st_mode & 07777) : -1);
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!beside_.empty()) ::unlink(beside_.c_str());
}

/// `mode`: of the file that is to be replaced; negative if there is none.
void OutputFile::open_beside(int mode) {
  for (int attempt = 0;; ++attempt) {
    fs::path name = target_;
    name += fmt::format(".{}-{}.part", ::getpid(), attempt);
    descriptor_ = without_interrupts(
        [&] { return ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kNewFile); });
    if (descriptor_ >= 0) {
      beside_.swap(name);
      break;
    }
    if (errno != EEXIST || attempt == kMostAttempts) fail(errno);
  }
  if (mode >= 0) ::fchmod(descriptor_, static_cast<mode_t>(mode));
}

void OutputFile::write(std::string_view bytes) noexcept {
  while (!bytes.empty() && failure_ == 0) {
    const ssize_t put =
        without_interrupts([&] { return ::write(descriptor_, bytes.data(), bytes.size()); });
    if (put < 0) failure_ = errno;
    if (put > 0) bytes.remove_prefix(static_cast<std::size_t>(put));
  }
}

void OutputFile::finish() {
  if (failure_ != 0) fail(failure_);
  // On the disk before the name is: a power cut leaves the old file or the new one.
  const bool synchronised =
      beside_.empty() || without_interrupts([&] { return ::fsync(descriptor_); }) == 0;
  if (!synchronised && errno != EINVAL) fail(errno);
  // Errors may show only now (a network share). After EINTR the file is closed all the same.
  if (::close(std::exchange(descriptor_, -1)) != 0 && errno != EINTR) fail(errno);
  if (beside_.empty()) return;
  if (::rename(beside_.c_str(), target_.c_str()) != 0) fail(errno);
  beside_.clear();
}

void OutputFile::fail(int reason) const {
  refuse(file_, "cannot be written: " + system_message(reason));
}

void check_writable(const fs::path& file) {
  if (file == "-") return;
  const fs::path target = follow_links(file);
  struct stat status {};
  const bool exists = ::stat(target.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) refuse(file, "is a folder; expected a file name");
  if (exists && !S_ISREG(status.st_mode)) return;
  const fs::path folder = target.has_parent_path() ? target.parent_path() : ".";
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    refuse(file,
           fmt::format("cannot be written: folder {}: {}", folder.string(), system_message(errno)));
  }
  const OutputFile attempt(file);
}

}  // namespace cairn
