// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::grids {

/// An image in levels of grey, 0 black to 255 white, row by row from the top.
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> grey{};
  std::vector<std::uint8_t> opacity{};  ///< 255: opaque; empty: all are
};

/// PNG or PGM, by its content. Of colours the mean of red, green and blue is taken. Throws `Error`
/// (input) with the file's name where the image is torn, too large or of another kind.
Picture read_picture(const std::filesystem::path& file);
/// PNG or PGM, by the ending. Throws `Error` (usage) for another ending, and for opacity in a PGM.
void write_picture(const Picture& picture, const std::filesystem::path& file);

/// Throws the latter.
[[noreturn]] void refuse_opacity(const std::filesystem::path& file);

// The parts of these two.
Picture decode_pgm(std::string_view bytes, const std::string& name);
std::string encode_pgm(const Picture& picture);
Picture decode_png(std::string_view bytes, const std::string& name);
std::string encode_png(const Picture& picture);

/// Throws `Error` (input) unless there are 1 to 10⁸ pixels.
void check_size(std::int64_t width, std::int64_t height, const std::string& name);

}  // namespace cairn::grids
