// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

constexpr std::string_view kMagic = "cairn-journal 1 ";

std::uint32_t checksum(std::string_view text) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size())));
}

/// "crc rest\n"
std::string sealed(std::string_view rest) {
  return fmt::format("{:08x} {}\n", checksum(rest), rest);
}

/// What was sealed, without the line break; none if it does not match its checksum.
std::optional<std::string_view> unsealed(std::string_view line) {
  std::uint32_t crc = 0;
  if (line.size() < 9 || line[8] != ' ') return std::nullopt;
  const auto [end, problem] = std::from_chars(line.data(), line.data() + 8, crc, 16);
  if (problem != std::errc{} || end != line.data() + 8) return std::nullopt;
  const std::string_view rest = line.substr(9);
  return checksum(rest) == crc ? std::optional(rest) : std::nullopt;
}

std::optional<Journal::Record> parse_record(std::string_view line) {
  const auto rest = unsealed(line);
  if (!rest) return std::nullopt;
  Journal::Record record;
  const char* const end = rest->data() + rest->size();
  const auto [text, problem] = std::from_chars(rest->data(), end, record.number);
  if (problem != std::errc{} || text == end || *text != ' ') return std::nullopt;
  record.text.assign(text + 1, end);
  return record;
}

}  // namespace

Journal::Journal(std::filesystem::path file, std::string identity, Sync sync)
    : file_(std::move(file)), sync_(sync) {
  descriptor_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
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
  } catch (const Error&) {  // who wanted to know has committed
  }
  ::close(descriptor_);
}

void Journal::load(const std::string& identity) {
  std::string bytes;
  char buffer[1 << 16];
  for (ssize_t got; (got = ::read(descriptor_, buffer, sizeof buffer)) != 0;) {
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail("cannot be read");
    bytes.append(buffer, static_cast<std::size_t>(got));
  }
  const std::size_t header_end = bytes.find('\n');
  if (header_end == std::string::npos) {
    // Nothing, or a first line that was being written.
    if (kMagic.substr(0, bytes.size()) != std::string_view(bytes).substr(0, kMagic.size()))
      throw Error(ErrorCode::input, fmt::format("{}: this is no journal", file_.string()));
    return begin(identity);
  }
  const std::string_view header = std::string_view(bytes).substr(0, header_end);
  if (!header.starts_with(kMagic))
    throw Error(ErrorCode::input, fmt::format("{}: this is no journal", file_.string()));
  const auto owner = unsealed(header.substr(kMagic.size()));
  if (!owner)
    throw Error(ErrorCode::input, fmt::format("{}: the first line is damaged", file_.string()));
  if (*owner != identity) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: the journal belongs to '{}', and this is '{}'; give the same "
                            "options, or another journal",
                            file_.string(), *owner, identity));
  }

  std::size_t good = header_end + 1;  // where the last good record ends
  std::int64_t line = 1, bad_line = 0;
  for (std::size_t at = good; at < bytes.size();) {
    const std::size_t end = bytes.find('\n', at);
    ++line;
    auto record = end == std::string::npos
                      ? std::nullopt
                      : parse_record(std::string_view(bytes).substr(at, end - at));
    at = end == std::string::npos ? bytes.size() : end + 1;
    if (!record) {
      if (bad_line == 0) bad_line = line;
      continue;
    }
    if (bad_line > 0) {
      throw Error(ErrorCode::input,
                  fmt::format("{}:{}: the record is damaged, and good ones follow it; expected its "
                              "checksum to fit. What stands before it can be saved by cutting the "
                              "file there",
                              file_.string(), bad_line));
    }
    records_.push_back(std::move(*record));
    good = at;
  }
  if (good < bytes.size()) {
    note_ = fmt::format("{}: {} bytes at the end were no whole record and were cut off",
                        file_.string(), bytes.size() - good);
    if (::ftruncate(descriptor_, static_cast<off_t>(good)) != 0) fail("cannot be cut");
  }
  if (::lseek(descriptor_, static_cast<off_t>(good), SEEK_SET) < 0) fail("cannot be written");
}

void Journal::begin(const std::string& identity) {
  if (::ftruncate(descriptor_, 0) != 0 || ::lseek(descriptor_, 0, SEEK_SET) < 0)
    fail("cannot be written");
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
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("cannot be written");
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void Journal::synchronise() {
  if (::fdatasync(descriptor_) != 0) fail("cannot be written to the disk");
}

void Journal::fail(const std::string& what) const {
  throw Error(ErrorCode::input,
              fmt::format("{}: the journal {}: {}", file_.string(), what, std::strerror(errno)));
}

}  // namespace cairn
