// SPDX-License-Identifier: BSD-3-Clause
// Files that are packed: the first byte says how the file is made of the rest, as it is or as gzip
// members with some bytes changed and its end cut off. It is read as zlib's own functions read it,
// or refused; what is written packed is read as it was.
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

enum Making { as_it_is, packed, changed, ways };

/// One gzip member.
std::string member(std::string_view text, int level) {
  z_stream z{};
  if (deflateInit2(&z, level, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  std::string out(deflateBound(&z, static_cast<uLong>(text.size())), '\0');
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  z.avail_in = static_cast<uInt>(text.size());
  z.next_out = reinterpret_cast<Bytef*>(out.data());
  z.avail_out = static_cast<uInt>(out.size());
  deflate(&z, Z_FINISH);
  out.resize(z.total_out);
  deflateEnd(&z);
  return out;
}

/// Members of the text that is left, each of up to 64 repetitions of up to 255 bytes of it.
std::string members(Source& source) {
  std::string all;
  const int count = 1 + source.below(3);
  for (int k = 0; k < count; ++k) {
    const int level = source.below(10), times = 1 + source.below(64), length = source.byte();
    std::string text, part;
    while (std::ssize(part) < length && !source.empty()) part += static_cast<char>(source.byte());
    for (int n = 0; n < times; ++n) text += part;
    all += member(text, level);
  }
  return all;
}

std::string file_of(Source& source) {
  const int making = source.below(ways);
  if (making == as_it_is) return std::string(text_of(source.rest()));
  struct Change {
    int at;
    std::uint8_t bits;
  };
  std::vector<Change> changes;
  int cut = 0, zeros = 0;
  if (making == changed) {
    for (int k = source.below(4); k > 0; --k) {
      const int high = source.byte();
      changes.push_back({256 * high + source.byte(), source.byte()});
    }
    cut = source.below(32);
    zeros = source.below(4);
  }
  std::string bytes = members(source);
  for (const Change& change : changes) {
    char& byte = bytes[static_cast<std::size_t>(change.at) % bytes.size()];
    byte = static_cast<char>(byte ^ change.bits);
  }
  bytes.resize(bytes.size() - std::min<std::size_t>(static_cast<std::size_t>(cut), bytes.size()));
  return bytes + std::string(static_cast<std::size_t>(zeros), '\0');
}

/// As zlib's functions for files read it, which leave out what follows the last member; nothing
/// where they report an error.
std::optional<std::string> as_zlib_reads(const std::string& file) {
  const gzFile stream = gzopen(file.c_str(), "rb");
  if (!stream) return std::nullopt;
  std::string text, part(std::size_t{1} << 16, '\0');
  int got = 0;
  while ((got = gzread(stream, part.data(), static_cast<unsigned>(part.size()))) > 0)
    text.append(part, 0, static_cast<std::size_t>(got));
  const bool ended = gzclose_r(stream) == Z_OK;
  if (got < 0 || !ended) return std::nullopt;
  return text;
}

std::optional<std::string> as_read(const std::string& file) {
  try {
    return read_file(file);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input && std::string_view(error.what()).starts_with(file),
           [&] { return fmt::format("refused by: {}", error.what()); });
    return std::nullopt;
  }
}

void run(Bytes bytes) {
  static const std::string file = scratch_folder() + "/input.gz",
                           written = scratch_folder() + "/written.gz";
  Source source(bytes);
  const std::string content = file_of(source);
  std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
  const std::optional<std::string> text = as_read(file), other = as_zlib_reads(file);
  expect(!text || text == other, [] { return "read otherwise than zlib does"; });
  if (text) {
    write_file(written, *text);
    expect(as_read(written) == text, [] { return "what was packed is read as something else"; });
  } else {
    expect(content.starts_with("\x1f\x8b"), [] { return "a file without packing is refused"; });
  }
}

std::vector<std::string> seeds() {
  const std::string line = "VERTEX_SE2 0 0 0 0\n";
  std::vector<std::string> all = {std::string(1, as_it_is) + line,
                                  std::string(1, as_it_is) + member(line, 6),
                                  std::string(1, as_it_is) + member(line, 0) + member("", 9),
                                  std::string(1, as_it_is) + member(line, 9) + "more"};
  const std::string parts = std::string("\x02\x06\x00\x13", 4) + line +
                            std::string("\x00\x3f\x04", 3) + "1.5\n" + std::string("\x09\x01", 2);
  all.push_back(std::string(1, packed) + parts);
  all.push_back(std::string(1, changed) + std::string("\x01\x00\x0c\x20\x00\x00", 6) + parts);
  all.push_back(std::string(1, changed) + std::string("\x00\x09\x00", 3) + parts);
  all.push_back(std::string(1, changed) + std::string("\x00\x00\x03", 3) + parts);
  return all;
}

std::vector<std::string> words() { return {"\x1f\x8b\x08", std::string("\0\0\xff\xff", 4)}; }

}  // namespace

Target packed_file() { return {"packed_file", &run, &seeds, &words, {}, 512}; }

}  // namespace cairn::fuzz
