// SPDX-License-Identifier: BSD-3-Clause
#include <png.h>

#include <cstddef>
#include <memory>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "picture.hpp"

namespace cairn::grids {
namespace {

struct Release {
  void operator()(png_image* image) const { png_image_free(image); }
};

[[noreturn]] void fail(const std::string& name, const png_image& image) {
  if (std::string_view(image.message).find("insufficient memory") != std::string_view::npos)
    throw std::bad_alloc();
  throw Error(ErrorCode::input,
              fmt::format("{}: not a whole PNG: {}; get or make it again", name, image.message));
}

/// Deflate makes at most 1032 bytes of one, with eight pixels in each: more pixels than that are
/// not there, and take no memory.
void check_bytes(std::string_view bytes, const png_image& image, const std::string& name) {
  constexpr std::size_t kMostPixelsPerByte = 8 * 1032;
  const std::size_t pixels = std::size_t{image.width} * image.height;
  if (pixels / kMostPixelsPerByte <= bytes.size()) return;
  throw Error(ErrorCode::input,
              fmt::format("{}: not a whole PNG: {} bytes for {} × {} pixels; get or make it again",
                          name, bytes.size(), image.width, image.height));
}

}  // namespace

Picture decode_png(std::string_view bytes, const std::string& name) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const std::unique_ptr<png_image, Release> released(&image);
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0) fail(name, image);
  check_size(image.width, image.height, name);
  check_bytes(bytes, image, name);
  image.format = PNG_FORMAT_RGBA;
  image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;  // levels are taken as they are
  Picture picture{.width = static_cast<int>(image.width), .height = static_cast<int>(image.height)};
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(image));
  if (png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr) == 0) fail(name, image);
  const std::size_t count = pixels.size() / 4;
  picture.grey.resize(count);
  picture.opacity.resize(count);
  bool opaque = true;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint8_t* const pixel = &pixels[4 * k];
    picture.grey[k] = static_cast<std::uint8_t>((pixel[0] + pixel[1] + pixel[2]) / 3);
    picture.opacity[k] = pixel[3];
    opaque = opaque && pixel[3] == 255;
  }
  if (opaque) picture.opacity.clear();
  return picture;
}

std::string encode_png(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  const std::unique_ptr<png_image, Release> released(&image);
  std::vector<std::uint8_t> pixels = picture.grey;
  image.format = PNG_FORMAT_GRAY;
  if (!picture.opacity.empty()) {
    image.format = PNG_FORMAT_GA;
    pixels.resize(2 * picture.grey.size());
    for (std::size_t k = 0; k < picture.grey.size(); ++k) {
      pixels[2 * k] = picture.grey[k];
      pixels[2 * k + 1] = picture.opacity[k];
    }
  }
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels.data(), 0, nullptr) == 0)
    fail("the image", image);
  bytes.resize(size);
  return bytes;
}

}  // namespace cairn::grids
