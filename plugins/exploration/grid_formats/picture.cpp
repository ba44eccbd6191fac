// SPDX-License-Identifier: BSD-3-Clause
#include "picture.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstddef>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::grids {
namespace {

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw Error(ErrorCode::input, name + ": " + why);
}

/// The head of a PGM: words with white space and comments (# to the end of the line) between.
class PgmHead {
 public:
  PgmHead(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  /// The next whole number.
  int number(const char* what) {
    skip_space();
    int value = 0;
    const char* const begin = bytes_.data() + at_;
    const auto [end, error] = std::from_chars(begin, bytes_.data() + bytes_.size(), value);
    if (error != std::errc() || value < 0)
      refuse(name_, fmt::format("not a PGM: there is no {} where it should be", what));
    at_ += static_cast<std::size_t>(end - begin);
    return value;
  }
  std::size_t at() const { return at_; }
  /// Behind the last level in words: comments and white space alone.
  bool at_end() {
    skip_space();
    return at_ == bytes_.size();
  }

 private:
  void skip_space() {
    while (at_ < bytes_.size()) {
      if (bytes_[at_] == '#') {
        at_ = std::min(bytes_.find('\n', at_), bytes_.size());
      } else if (std::isspace(static_cast<unsigned char>(bytes_[at_])) != 0) {
        ++at_;
      } else {
        return;
      }
    }
  }

  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 2;  // behind the magic number
};

std::uint8_t scaled(int value, int white, const std::string& name) {
  if (value > white)
    refuse(name, fmt::format("a level of {}, and the largest is {} by its head", value, white));
  return static_cast<std::uint8_t>((255 * value + white / 2) / white);
}

bool is_white_space(std::string_view bytes) {
  return std::ranges::all_of(bytes, [](unsigned char c) { return std::isspace(c) != 0; });
}

}  // namespace

void check_size(std::int64_t width, std::int64_t height, const std::string& name) {
  constexpr std::int64_t kMost = 100'000'000;
  if (width < 1 || height < 1 || width > kMost || height > kMost || width * height > kMost)
    refuse(name, fmt::format("{} × {} pixels, expected 1 to {}", width, height, kMost));
}

Picture decode_pgm(std::string_view bytes, const std::string& name) {
  PgmHead head(bytes, name);
  Picture picture;
  picture.width = head.number("width");
  picture.height = head.number("height");
  const int white = head.number("largest level");
  check_size(picture.width, picture.height, name);
  if (white < 1 || white > 65535)
    refuse(name, fmt::format("a largest level of {}, expected 1 to 65535", white));
  const std::size_t count =
      static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  const bool in_words = bytes[1] == '2';
  const std::size_t each = white < 256 ? 1 : 2, begin = std::min(head.at() + 1, bytes.size());
  const std::string_view body = bytes.substr(begin);
  if (body.size() < (in_words ? count : each * count)) {
    refuse(name, fmt::format("the image is torn: {} bytes for {} × {} pixels; get or make it again",
                             body.size(), picture.width, picture.height));
  }
  picture.grey.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    if (in_words) {
      picture.grey[k] = scaled(head.number("level"), white, name);
      continue;
    }
    int value = static_cast<unsigned char>(body[each * k]);
    if (each == 2) value = 256 * value + static_cast<unsigned char>(body[2 * k + 1]);
    picture.grey[k] = scaled(value, white, name);
  }
  if (in_words ? !head.at_end() : !is_white_space(body.substr(each * count)))
    refuse(name, "bytes behind the image: another size is meant, or another image follows");
  return picture;
}

std::string encode_pgm(const Picture& picture) {
  std::string bytes = fmt::format("P5\n{} {}\n255\n", picture.width, picture.height);
  bytes.append(picture.grey.begin(), picture.grey.end());
  return bytes;
}

Picture read_picture(const std::filesystem::path& file) {
  const std::string bytes = read_file(file), name = file.string();
  if (bytes.starts_with("\x89PNG")) return decode_png(bytes, name);
  if (bytes.starts_with("P5") || bytes.starts_with("P2")) return decode_pgm(bytes, name);
  refuse(name, "neither a PNG nor a PGM (P5, P2), which floors are read from: convert it");
}

void refuse_opacity(const std::filesystem::path& file) {
  throw Error(ErrorCode::usage,
              fmt::format("{}: a PGM has no transparency for cells that are unknown (mode scale): "
                          "write a PNG, or mode=trinary",
                          file.string()));
}

void write_picture(const Picture& picture, const std::filesystem::path& file) {
  const std::string kind = file_ending(file);
  if (kind == "png") return write_file(file, encode_png(picture));
  if (kind != "pgm") {
    throw Error(ErrorCode::usage,
                fmt::format("{}: pictures of floors end in .png or .pgm", file.string()));
  }
  if (!picture.opacity.empty()) refuse_opacity(file);
  write_file(file, encode_pgm(picture));
}

}  // namespace cairn::grids
