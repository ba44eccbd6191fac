// SPDX-License-Identifier: BSD-3-Clause
#include "ros_format.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn::grids {
namespace {

namespace fs = std::filesystem;

/// The keys of a map's YAML.
class MapKeys {
 public:
  explicit MapKeys(const fs::path& file) : name_(file.string()) {
    constexpr std::size_t kMost = 1 << 20;
    const std::string text = read_file(file);
    if (text.size() > kMost)
      fail(fmt::format("{} bytes, expected the few lines of a map", text.size()));
    try {
      const std::vector<YAML::Node> documents = YAML::LoadAll(text);
      if (documents.size() > 1)
        fail("more than one document of YAML, expected the keys of one map");
      if (!documents.empty()) keys_ = documents.front();
    } catch (const YAML::Exception& error) {
      fail(fmt::format("line {}: no YAML: {}", error.mark.line + 1, error.msg));
    }
    if (!keys_.IsMap()) fail("expected the keys image, resolution and origin");
    check_names();
  }

  bool has(const char* key) const { return keys_[key].IsDefined(); }

  template <class T>
  T get(const char* key, const char* expected) const {
    const YAML::Node node = keys_[key];
    if (!node.IsDefined()) fail(fmt::format("there is no key '{}', expected {}", key, expected));
    return convert<T>(node, key, expected);
  }
  template <class T>
  T get_or(const char* key, const T& otherwise, const char* expected) const {
    return has(key) ? get<T>(key, expected) : otherwise;
  }

  /// x, y [m], yaw [rad].
  std::array<double, 3> origin() const {
    constexpr const char* kExpected = "three numbers [x, y, yaw]";
    const YAML::Node node = keys_["origin"];
    if (!node.IsDefined()) fail(fmt::format("there is no key 'origin', expected {}", kExpected));
    if (!node.IsSequence() || node.size() != 3)
      fail(fmt::format("line {}: origin: expected {}", node.Mark().line + 1, kExpected));
    std::array<double, 3> numbers{};
    for (std::size_t k = 0; k < 3; ++k) numbers[k] = convert<double>(node[k], "origin", kExpected);
    return numbers;
  }

  [[noreturn]] void fail(const std::string& why) const {
    throw Error(ErrorCode::input, name_ + ": " + why);
  }

 private:
  /// Each key once: which of two counts is not known. Others have keys of their own, which are left
  /// alone, unless one is nearly one of these.
  void check_names() const {
    const std::vector<std::string> known{"image",           "resolution",  "origin", "negate",
                                         "occupied_thresh", "free_thresh", "mode"};
    std::vector<std::string> met;
    for (const auto& entry : keys_) {
      if (!entry.first.IsScalar()) continue;
      const std::string& name = entry.first.Scalar();
      const int line = entry.first.Mark().line + 1;
      if (std::ranges::find(met, name) != met.end())
        fail(fmt::format("line {}: {} is given twice", line, name));
      met.push_back(name);
      if (std::ranges::find(known, name) != known.end()) continue;
      if (const std::string nearest = nearest_spelling(name, known); !nearest.empty())
        fail(fmt::format("line {}: there is no key '{}'; did you mean '{}'?", line, name, nearest));
    }
  }

  template <class T>
  T convert(const YAML::Node& node, const char* key, const char* expected) const {
    T value{};
    if (node.IsScalar() && YAML::convert<T>::decode(node, value)) return value;
    fail(fmt::format("line {}: {} is {}, expected {}", node.Mark().line + 1, key,
                     node.IsScalar() ? "'" + node.Scalar() + "'" : "no single value", expected));
  }

  std::string name_;
  YAML::Node keys_;
};

bool negated(const MapKeys& keys) {
  const auto text = keys.get_or<std::string>("negate", "0", "0 or 1");
  if (text == "0" || text == "false") return false;
  if (text == "1" || text == "true") return true;
  keys.fail(fmt::format("negate is '{}', expected 0 or 1", text));
}

fs::path picture_of(const MapKeys& keys, const fs::path& file) {
  return file.parent_path() / keys.get<std::string>("image", "the name of a PNG or PGM");
}

PictureMeaning meaning_of(const MapKeys& keys) {
  const auto mode = keys.get_or<std::string>("mode", "trinary", "trinary, scale or raw");
  const auto known = find_enum<PictureMode>(mode);
  if (!known) keys.fail(fmt::format("mode is '{}', expected trinary, scale or raw", mode));
  const PictureMeaning usual;
  return {.mode = *known,
          .negate = negated(keys),
          .occupied = keys.get_or("occupied_thresh", usual.occupied, "a number from 0 to 1"),
          .free = keys.get_or("free_thresh", usual.free, "a number from 0 to 1")};
}

}  // namespace

std::vector<fs::path> RosFormat::files_read(const fs::path& file) const {
  return {file, picture_of(MapKeys(file), file)};
}

std::vector<fs::path> RosFormat::files_written(const fs::path& file) const {
  if (options_.mode == PictureMode::scale && options_.picture == "pgm") refuse_opacity(file);
  return {file, written_picture(file)};
}

fs::path RosFormat::written_picture(const fs::path& file) const {
  fs::path picture = file;
  return picture.replace_extension(options_.picture);
}

OccupancyGrid RosFormat::read(const fs::path& file) {
  const MapKeys keys(file);
  const fs::path picture = picture_of(keys, file);
  const auto [x, y, yaw] = keys.origin();
  const GridFrame frame{.resolution = keys.get<double>("resolution", "metres per pixel"),
                        .origin = {x, y},
                        .yaw = yaw};
  const PictureMeaning meaning = meaning_of(keys);
  try {
    return to_grid(read_picture(picture), meaning, frame, file.string());
  } catch (const Error& error) {
    if (!std::string_view(error.what()).starts_with(picture.string())) throw;
    throw Error(error.code(),
                fmt::format("{} (the image that {} names by its key 'image', as seen from its "
                            "folder)",
                            error.what(), file.string()));
  }
}

void RosFormat::write(const OccupancyGrid& grid, const fs::path& file) {
  // Between 0.1 and 0.9 there are two levels of grey for each per cent.
  PictureMeaning meaning{.mode = options_.mode};
  if (options_.mode == PictureMode::scale) meaning = {PictureMode::scale, false, 0.9, 0.1};
  const fs::path picture = written_picture(file);
  write_picture(to_picture(grid, meaning), picture);
  YAML::Emitter keys;
  const GridFrame& frame = grid.frame;
  keys << YAML::BeginMap << YAML::Key << "image" << YAML::Value << picture.filename().string()
       << YAML::Key << "mode" << YAML::Value << std::string(to_string(options_.mode)) << YAML::Key
       << "resolution" << YAML::Value << fmt::format("{}", frame.resolution) << YAML::Key
       << "origin" << YAML::Value << YAML::Flow << YAML::BeginSeq
       << fmt::format("{}", frame.origin.x()) << fmt::format("{}", frame.origin.y())
       << fmt::format("{}", frame.yaw) << YAML::EndSeq << YAML::Key << "negate" << YAML::Value << 0
       << YAML::Key << "occupied_thresh" << YAML::Value << fmt::format("{}", meaning.occupied)
       << YAML::Key << "free_thresh" << YAML::Value << fmt::format("{}", meaning.free)
       << YAML::EndMap;
  write_file(file, std::string(keys.c_str()) + "\n");
}

}  // namespace cairn::grids
