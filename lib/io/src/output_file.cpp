// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/output_file.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <mutex>
#include <new>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/file_error.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kNewFile = 0666;
constexpr int kMostAttempts = 100;  // to find a name that is free
constexpr int kPause = 20;  // [ms] between looks for an interrupt, while a reader is waited for

std::string system_message(int number) { return std::generic_category().message(number); }

/// `number`: the system's errno, or that which fits.
[[noreturn]] void refuse(const fs::path& file, const std::string& what, int number) {
  throw FileError(fmt::format("{}: {}", file.string(), what), file, number);
}

/// Calls again what a signal has interrupted.
template <class Call>
auto without_interrupts(const Call& call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// Where a chain of symbolic links ends, so that replacing that keeps the links.
struct Target {
  fs::path file;
  std::optional<int> descriptor;  // of this process, which has the file open
};

void refuse_no_memory(const std::error_code& error) {
  if (error == std::errc::not_enough_memory) throw std::bad_alloc();
}

/// 3 of "/proc/self/fd/3", whose link leads to a name that need not be the file's any more.
std::optional<int> descriptor_of(const fs::path& file) {
  const std::string name = file.filename().string();
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc() || end != name.data() + name.size()) return std::nullopt;
  std::error_code none;
  const fs::path folder = fs::canonical(file.parent_path(), none);
  refuse_no_memory(none);
  if (none || folder != fs::path(fmt::format("/proc/{}/fd", ::getpid()))) return std::nullopt;
  return number;
}

Target follow_links(fs::path file) {
  std::error_code error;
  for (int depth = 0; depth < 40 && fs::is_symlink(file, error); ++depth) {
    if (const std::optional<int> number = descriptor_of(file)) return {file, number};
    const fs::path next = fs::read_symlink(file, error);
    refuse_no_memory(error);
    if (error) break;
    file = next.is_absolute() ? next : file.parent_path() / next;
  }
  return {file, std::nullopt};
}

/// Of the outputs that lie beside their names, and of those files.
std::mutex& unfinished_outputs() {
  static std::mutex mutex;
  return mutex;
}

std::atomic<const std::atomic<bool>*>& reader_interrupt() {
  static std::atomic<const std::atomic<bool>*> flag{nullptr};
  return flag;
}

bool is_interrupted() {
  const std::atomic<bool>* interrupt = reader_interrupt().load();
  return interrupt && interrupt->load();
}

/// Why no other file can be renamed over this one, and what helps; empty if one can, as far as can
/// be told beforehand.
std::string why_not_replaced(const fs::path& file, const fs::path& folder) {
  struct statx found {
  }, holder{};
  const auto look = [](const fs::path& name, struct statx& into) {
    return ::statx(AT_FDCWD, name.c_str(), 0, STATX_BASIC_STATS, &into) == 0;
  };
  if (!look(file, found) || !look(folder, holder)) return {};
  if ((found.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0)
    return "is mounted by itself, so that it cannot be replaced; mount its folder instead";
  if ((found.stx_attributes & (STATX_ATTR_IMMUTABLE | STATX_ATTR_APPEND)) != 0)
    return "cannot be replaced: it is immutable or append-only (chattr -i -a)";
  const uid_t user = ::geteuid();
  if ((holder.stx_mode & S_ISVTX) != 0 && user != 0 && user != found.stx_uid &&
      user != holder.stx_uid)
    return fmt::format("cannot be replaced: it belongs to another user, and folder {} is sticky",
                       folder.string());
  return {};
}

/// A file that will not be finished takes no room on a full disk from those that follow; its name
/// goes with the `OutputFile`.
void empty_unfinished(const fs::path& beside) noexcept {
  if (!beside.empty() && ::truncate(beside.c_str(), 0) != 0) errno = 0;  // nothing else to be done
}

OutputFile*& first_unfinished() {
  static OutputFile* first = nullptr;
  return first;
}

}  // namespace

OutputFile::OutputFile(const fs::path& file) : file_(file) {
  Target target = follow_links(file);
  if (target.descriptor) {
    open_descriptor(*target.descriptor);
    return;
  }
  target_ = std::move(target.file);
  struct stat status {};
  const bool exists = ::stat(target_.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) refuse(file_, "is a folder; expected a file name", EISDIR);
  if (exists && !S_ISREG(status.st_mode)) {
    // Renaming a file over these would remove them.
    if (S_ISFIFO(status.st_mode)) {
      open_fifo();
      return;
    }
    descriptor_ = without_interrupts([&] { return ::open(target_.c_str(), O_WRONLY | O_CLOEXEC); });
    if (descriptor_ < 0) fail(errno);
    return;
  }
  open_beside(exists ? static_cast<int>(status.st_mode & 07777) : -1);
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (beside_.empty()) return;
  const std::lock_guard lock(unfinished_outputs());
  ::unlink(beside_.c_str());
  unlist();
}

/// It goes on where the descriptor stands, after what the program has printed there itself.
void OutputFile::open_descriptor(int number) {
  if (number == STDOUT_FILENO) std::fflush(stdout);
  if (number == STDERR_FILENO) std::fflush(stderr);
  if (const int flags = ::fcntl(number, F_GETFL); flags >= 0 && (flags & O_ACCMODE) == O_RDONLY)
    fail(EBADF);
  descriptor_ = ::fcntl(number, F_DUPFD_CLOEXEC, 0);
  if (descriptor_ < 0) fail(errno);
}

/// Waits for somebody to read it, for ever if need be. The system's own waiting goes on after a
/// signal, so that the flag would never be seen.
void OutputFile::open_fifo() {
  is_fifo_ = true;
  const auto open = [&] { return ::open(target_.c_str(), O_WRONLY | O_CLOEXEC | O_NONBLOCK); };
  while ((descriptor_ = without_interrupts(open)) < 0) {
    if (errno != ENXIO) fail(errno);
    if (is_interrupted()) refuse(file_, "interrupted before anything reads it", EINTR);
    static_cast<void>(::poll(nullptr, 0, kPause));
  }
}

/// `mode`: of the file that is to be replaced; negative if there is none.
void OutputFile::open_beside(int mode) {
  for (int attempt = 0;; ++attempt) {
    fs::path name = target_;
    name += fmt::format(".{}-{}.part", ::getpid(), attempt);
    const std::lock_guard lock(unfinished_outputs());
    descriptor_ = without_interrupts(
        [&] { return ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kNewFile); });
    if (descriptor_ >= 0) {
      beside_.swap(name);
      next_ = std::exchange(first_unfinished(), this);
      break;
    }
    if (errno != EEXIST || attempt == kMostAttempts) fail(errno);
  }
  if (mode >= 0) ::fchmod(descriptor_, static_cast<mode_t>(mode));
}

/// Precondition: the mutex is held.
void OutputFile::unlist() noexcept {
  OutputFile** at = &first_unfinished();
  while (*at != this) at = &(*at)->next_;
  *at = next_;
}

void OutputFile::write(std::string_view bytes) noexcept {
  while (!bytes.empty() && failure_ == 0) {
    const ssize_t put =
        without_interrupts([&] { return ::write(descriptor_, bytes.data(), bytes.size()); });
    if (put < 0 && errno == EAGAIN) {  // a FIFO, or what another process has made non-blocking
      pollfd ready{descriptor_, POLLOUT, 0};
      static_cast<void>(::poll(&ready, 1, kPause));
      if (is_fifo_ && is_interrupted()) failure_ = EINTR;
      continue;
    }
    if (put < 0) {
      failure_ = errno;
      empty_unfinished(beside_);
    }
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
  const std::lock_guard lock(unfinished_outputs());
  if (::rename(beside_.c_str(), target_.c_str()) != 0) fail(errno);
  beside_.clear();
  unlist();
}

void OutputFile::fail(int reason) const {
  empty_unfinished(beside_);
  refuse(file_, "cannot be written: " + system_message(reason), reason);
}

void end_waiting_for_readers_on(const std::atomic<bool>* interrupt) noexcept {
  reader_interrupt().store(interrupt);
}

void remove_unfinished_outputs() noexcept {
  // Who holds it is this thread itself only where no memory is left for an error's message.
  for (int attempt = 0; attempt < 1000 && !unfinished_outputs().try_lock(); ++attempt)
    ::usleep(1000);
  for (const OutputFile* output = first_unfinished(); output; output = output->next_)
    ::unlink(output->beside_.c_str());
}

void check_writable(const fs::path& file) {
  if (file == "-") return;
  const auto [target, descriptor] = follow_links(file);
  if (descriptor) return static_cast<void>(OutputFile(file));
  struct stat status {};
  const bool exists = ::stat(target.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) refuse(file, "is a folder; expected a file name", EISDIR);
  if (exists && !S_ISREG(status.st_mode)) return;
  const fs::path folder = target.has_parent_path() ? target.parent_path() : ".";
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    const int reason = errno;
    refuse(file,
           fmt::format("cannot be written: folder {}: {}", folder.string(), system_message(reason)),
           reason);
  }
  if (exists) {
    if (const std::string why = why_not_replaced(target, folder); !why.empty())
      refuse(file, why, EACCES);
  }
  const OutputFile attempt(file);
}

}  // namespace cairn
