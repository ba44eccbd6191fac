// SPDX-License-Identifier: BSD-3-Clause
// Bytes of files, packed or not: read_file and write_file of format.hpp.

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <system_error>

#include <fmt/core.h>

#include "cairn/io/descriptor.hpp"
#include "cairn/io/file_error.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/output_file.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kChunk = std::size_t{1} << 18;
// Text packs to a tenth, repetitive text to a hundredth. gzip can make a thousandth of zeros.
constexpr std::size_t kMostUnpacked = std::size_t{1} << 28, kMostExpansion = 200;

[[noreturn]] void fail(const fs::path& file, const std::string& what) {
  throw Error(ErrorCode::input, fmt::format("{}: {}", file.string(), what));
}

/// For what the system has refused: `number` is its errno.
[[noreturn]] void fail(const fs::path& file, const std::string& what, int number) {
  throw FileError(
      fmt::format("{}: {}: {}", file.string(), what, std::generic_category().message(number)), file,
      number);
}

std::string read_bytes(const fs::path& file) {
  Descriptor input(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (input.number() < 0) fail(file, "cannot be opened", errno);
  struct stat status {};
  if (::fstat(input.number(), &status) != 0) fail(file, "cannot be examined", errno);
  if (S_ISDIR(status.st_mode))
    throw FileError(file.string() + ": is a folder; expected a file", file, EISDIR);
  // Others, such as /dev/zero, may never end.
  const bool null = status.st_rdev == makedev(1, 3);
  if (S_ISCHR(status.st_mode) && !null && ::isatty(input.number()) == 0)
    fail(file, "is a device; expected a file");

  // The size is only a hint: pipes have none, and a file may grow while it is read.
  std::string bytes;
  std::size_t used = 0;
  bytes.resize(static_cast<std::size_t>(std::max<off_t>(status.st_size, 0)) + 1);
  for (;;) {
    if (used == bytes.size()) bytes.resize(bytes.size() + std::max(kChunk, bytes.size() / 2));
    const ssize_t got = ::read(input.number(), bytes.data() + used, bytes.size() - used);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(file, "cannot be read", errno);
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
  }
  bytes.resize(used);
  return bytes;
}

bool is_gzip(std::string_view bytes) {
  return bytes.size() >= 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b';
}

/// Owns zlib's state for unpacking.
struct Inflater {
  z_stream stream{};
  Inflater() {
    if (inflateInit2(&stream, 15 + 16) != Z_OK) throw std::bad_alloc();
  }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  ~Inflater() { inflateEnd(&stream); }
};

/// Unpacks one gzip member from the front of `packed`, what is left of `whole` bytes, onto the end
/// of `out`; returns its packed size.
std::size_t unpack_member(const fs::path& file, std::string_view packed, std::size_t whole,
                          std::string& out) {
  Inflater inflater;
  z_stream& z = inflater.stream;
  std::size_t taken = 0;
  for (;;) {
    // zlib counts in unsigned int: feed it piecewise.
    const std::size_t feed =
        std::min<std::size_t>(packed.size() - taken, std::numeric_limits<uInt>::max() / 2);
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + taken));
    z.avail_in = static_cast<uInt>(feed);
    const std::size_t used = out.size();
    out.resize(used + std::max(kChunk, used / 2 < (std::size_t{1} << 30) ? used / 2 : kChunk));
    z.next_out = reinterpret_cast<Bytef*>(out.data() + used);
    z.avail_out = static_cast<uInt>(out.size() - used);
    const std::size_t room = z.avail_out;
    const int status = inflate(&z, Z_NO_FLUSH);
    taken += feed - z.avail_in;
    out.resize(used + (room - z.avail_out));
    if (out.size() > kMostUnpacked && out.size() / kMostExpansion > whole) {
      fail(file,
           fmt::format("is gzip data of {} bytes that unpacks to more than {} MB: graphs do not "
                       "pack that well; if it is right, unpack it yourself",
                       whole, kMostUnpacked >> 20));
    }
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status == Z_STREAM_END) return taken;
    const bool starved = taken == packed.size() && z.avail_out > 0;
    if (status == Z_BUF_ERROR || (status == Z_OK && starved)) {
      fail(file,
           fmt::format("is gzip data that breaks off after {} bytes ({} unpacked); the file is "
                       "truncated, get it again",
                       packed.size(), out.size()));
    }
    if (status != Z_OK) {
      fail(file, fmt::format("is gzip data that is damaged near byte {} ({}); get the file again",
                             taken, z.msg ? z.msg : "unknown reason"));
    }
  }
}

std::string unpack(const fs::path& file, std::string_view packed) {
  const std::size_t whole = packed.size();
  std::string out;
  while (!packed.empty()) {
    if (!is_gzip(packed)) {
      // Tapes and some tools pad with zeros; anything else is not ours to ignore.
      if (packed.find_first_not_of('\0') == std::string_view::npos) break;
      fail(file, fmt::format("has {} bytes after the end of its gzip data", packed.size()));
    }
    packed.remove_prefix(unpack_member(file, packed, whole, out));
  }
  return out;
}

/// Owns zlib's state for packing.
struct Deflater {
  z_stream stream{};
  Deflater() {
    const int status =
        deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
    if (status != Z_OK) throw std::bad_alloc();
  }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;
  ~Deflater() { deflateEnd(&stream); }
};

std::string pack(const fs::path& file, std::string_view bytes) {
  Deflater deflater;
  z_stream& z = deflater.stream;
  std::string out;
  int status = Z_OK;
  do {
    const std::size_t feed = std::min<std::size_t>(bytes.size(), std::size_t{1} << 30);
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    z.avail_in = static_cast<uInt>(feed);
    const std::size_t used = out.size();
    out.resize(used + kChunk);
    z.next_out = reinterpret_cast<Bytef*>(out.data() + used);
    z.avail_out = static_cast<uInt>(kChunk);
    status = deflate(&z, feed == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    bytes.remove_prefix(feed - z.avail_in);
    out.resize(used + kChunk - z.avail_out);
  } while (status == Z_OK || (status == Z_BUF_ERROR && !bytes.empty()));
  if (status != Z_STREAM_END) fail(file, "could not be packed");
  return out;
}

void write_to_standard_output(std::string_view bytes) {
  std::fflush(stdout);  // what the program has printed itself comes first
  while (!bytes.empty()) {
    const ssize_t put = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0 && errno == EPIPE) return;  // `cairn … | head`: its reader has enough
    if (put < 0) fail("standard output", "cannot be written", errno);
    bytes.remove_prefix(static_cast<std::size_t>(put));
  }
}

}  // namespace

std::string read_file(const fs::path& file) {
  std::string bytes = read_bytes(file);
  return is_gzip(bytes) ? unpack(file, bytes) : bytes;
}

void write_file(const fs::path& file, std::string_view bytes) {
  if (file == "-") return write_to_standard_output(bytes);
  std::string packed;
  if (file.extension() == ".gz") {
    packed = pack(file, bytes);
    bytes = packed;
  }
  OutputFile output(file);
  output.write(bytes);
  output.finish();
}

}  // namespace cairn
