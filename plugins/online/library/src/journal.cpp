// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <iterator>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr std::string_view kMagic = "cairn-journal 2 ", kUnchainedMagic = "cairn-journal 1 ";

std::uint32_t checksum(std::string_view text) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size())));
}

/// Calls again what a signal has interrupted.
template <class Call>
auto without_interrupts(const Call& call) {
  auto result = call();
  while (result < 0 && errno == EINTR) result = call();
  return result;
}

/// "number text"
std::optional<Journal::Record> parse_record(std::string_view rest) {
  Journal::Record record;
  const char* const end = rest.data() + rest.size();
  const auto [text, problem] = std::from_chars(rest.data(), end, record.number);
  if (problem != std::errc{} || text == end || *text != ' ') return std::nullopt;
  record.text.assign(text + 1, end);
  return record;
}

}  // namespace

Journal::Journal(std::filesystem::path file, std::string identity, Sync sync)
    : file_(std::move(file)), sync_(sync) {
  descriptor_ = without_interrupts(
      [&] { return ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0666); });
  if (descriptor_ < 0) fail("cannot be opened");
  try {
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
      throw Error(ErrorCode::usage,
                  fmt::format("{}: the journal is in use by another process", file_.string()));
    }
    load(identity);
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

Journal::~Journal() {
  try {
    commit();
  } catch (...) {  // a caller that needs to know calls commit
  }
  ::close(descriptor_);
}

/// "checksum rest\n"
std::string Journal::sealed(std::string_view rest) {
  chain_ = checksum(chained_ ? fmt::format("{:08x}{}", chain_, rest) : std::string(rest));
  return fmt::format("{:08x} {}\n", chain_, rest);
}

/// What was sealed, without the line break; none if it does not match its checksum.
std::optional<std::string_view> Journal::unsealed(std::string_view line) {
  std::uint32_t crc = 0;
  if (line.size() < 9 || line[8] != ' ') return std::nullopt;
  const auto [end, problem] = std::from_chars(line.data(), line.data() + 8, crc, 16);
  if (problem != std::errc{} || end != line.data() + 8) return std::nullopt;
  const std::string_view rest = line.substr(9);
  if (checksum(chained_ ? fmt::format("{:08x}{}", chain_, rest) : std::string(rest)) != crc)
    return std::nullopt;
  chain_ = crc;
  return rest;
}

void Journal::load(const std::string& identity) {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) fail("cannot be examined");
  if (!S_ISREG(status.st_mode)) {
    throw Error(ErrorCode::input,
                fmt::format("{}: a journal is a regular file, and this is none", file_.string()));
  }
  std::string bytes;
  char buffer[1 << 16];
  for (ssize_t got; (got = ::read(descriptor_, buffer, sizeof buffer)) != 0;) {
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail("cannot be read");
    bytes.append(buffer, static_cast<std::size_t>(got));
  }
  const std::size_t header_end = bytes.find('\n');
  const std::string_view header = std::string_view(bytes).substr(0, header_end);
  chained_ = !header.starts_with(kUnchainedMagic);
  if (header_end == std::string::npos) {
    // Nothing, or a first line that was being written.
    const std::string_view magic = chained_ ? kMagic : kUnchainedMagic;
    if (magic.substr(0, bytes.size()) != header.substr(0, magic.size()))
      throw Error(ErrorCode::input, fmt::format("{}: this is not a journal", file_.string()));
    chained_ = true;
    return begin(identity);
  }
  if (chained_ && !header.starts_with(kMagic))
    throw Error(ErrorCode::input, fmt::format("{}: this is not a journal", file_.string()));
  const auto owner = unsealed(header.substr(kMagic.size()));
  if (!owner)
    throw Error(ErrorCode::input, fmt::format("{}: the first line is damaged", file_.string()));
  if (*owner != identity) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: the journal belongs to '{}', and this is '{}'; give the same "
                            "options, or another journal",
                            file_.string(), *owner, identity));
  }
  load_records(bytes, header_end + 1);
  if (!chained_ && note_.empty()) {
    note_ = fmt::format("{}: a journal of format 1, in which a missing record is not noticed",
                        file_.string());
  }
}

/// Reads whole lines, each of which must fit its place; what follows the last of them is cut off.
void Journal::load_records(const std::string& bytes, std::size_t begin) {
  std::int64_t line = 1;
  for (std::size_t end; (end = bytes.find('\n', begin)) != std::string::npos; begin = end + 1) {
    ++line;
    const auto rest = unsealed(std::string_view(bytes).substr(begin, end - begin));
    auto record = rest ? parse_record(*rest) : std::nullopt;
    if (record && !records_.empty() && record->number <= records_.back().number) record.reset();
    if (!record) {
      throw Error(ErrorCode::input,
                  fmt::format("{}:{}: the record does not fit its checksum and the line before it: "
                              "one is damaged, missing, doubled or moved. What stands before it "
                              "can be saved by cutting the file there",
                              file_.string(), line));
    }
    records_.push_back(std::move(*record));
  }
  if (begin < bytes.size()) cut(bytes, begin);
  size_ = static_cast<std::int64_t>(begin);
  if (::lseek(descriptor_, size_, SEEK_SET) < 0) fail("cannot be written");
}

/// Keeps what is after the first `size` bytes in FILE.cut, and cuts it off.
void Journal::cut(const std::string& bytes, std::size_t size) {
  const std::filesystem::path kept = file_.string() + ".cut";
  const int descriptor = ::open(
      kept.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  const std::string tail = bytes.substr(size) + "\n";
  struct stat status {};
  const bool saved =
      descriptor >= 0 && ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) &&
      ::write(descriptor, tail.data(), tail.size()) == std::ssize(tail) && ::fsync(descriptor) == 0;
  if (descriptor >= 0) ::close(descriptor);
  if (!saved) {
    throw Error(ErrorCode::input,
                fmt::format("{}: the last line is not whole, and cannot be kept in {}; make room "
                            "for that file, or cut the journal by hand",
                            file_.string(), kept.string()));
  }
  note_ = fmt::format("{}: the last line was not whole: {} bytes were cut off, and kept in {}",
                      file_.string(), bytes.size() - size, kept.string());
  const auto cut_off = [&] { return ::ftruncate(descriptor_, static_cast<off_t>(size)); };
  if (without_interrupts(cut_off) != 0) fail("cannot be cut");
}

void Journal::begin(const std::string& identity) {
  if (without_interrupts([&] { return ::ftruncate(descriptor_, 0); }) != 0 ||
      ::lseek(descriptor_, 0, SEEK_SET) < 0)
    fail("cannot be written");
  size_ = 0;
  write_all(fmt::format("{}{}", kMagic, sealed(identity)));
  if (sync_ == Sync::none) return;
  synchronise();
  // The name of a new file is on the disk once its folder is.
  std::filesystem::path folder = file_.parent_path();
  if (folder.empty()) folder = ".";
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened >= 0) {
    ::fsync(opened);
    ::close(opened);
  }
}

void Journal::append(std::int64_t number, std::string_view text) {
  pending_ += sealed(fmt::format("{} {}", number, text));
  if (sync_ == Sync::every) commit();
}

void Journal::commit() {
  if (pending_.empty()) return;
  write_all(std::exchange(pending_, {}));
  if (sync_ != Sync::none) synchronise();
}

void Journal::write_all(std::string_view bytes) {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) fail("cannot be examined");
  if (status.st_nlink == 0 || status.st_size != size_) {
    throw Error(ErrorCode::input,
                fmt::format("{}: the journal was {} while it was in use", file_.string(),
                            status.st_nlink == 0 ? "removed" : "changed"));
  }
  for (std::string_view left = bytes; !left.empty();) {
    const ssize_t written = ::write(descriptor_, left.data(), left.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int reason = errno;
      // Or the next record would continue half a line.
      const auto cut_back = [&] { return ::ftruncate(descriptor_, size_); };
      if (without_interrupts(cut_back) != 0 || ::lseek(descriptor_, size_, SEEK_SET) < 0)
        fail("cannot be written, nor cut where its last whole record ends");
      errno = reason;
      fail("cannot be written");
    }
    left.remove_prefix(static_cast<std::size_t>(written));
  }
  size_ += std::ssize(bytes);
}

void Journal::synchronise() {
  if (without_interrupts([&] { return ::fdatasync(descriptor_); }) != 0)
    fail("cannot be written to the disk");
}

void Journal::fail(const std::string& what) const {
  throw Error(ErrorCode::input,
              fmt::format("{}: the journal {}: {}", file_.string(), what, std::strerror(errno)));
}

}  // namespace cairn
