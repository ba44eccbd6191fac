// SPDX-License-Identifier: BSD-3-Clause
// Maps of floors. The first byte chooses: a YAML as ROS' map server reads it, a zero byte and its
// picture; or a picture alone. What is read is a map, the same once it was written and read, on
// which leaping rays meet what plain traversal meets, and whose survey adds up.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cairn/grid/floor_survey.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/grid/ray_caster.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

namespace fs = std::filesystem;

/// What the first byte chooses among; the first is for a YAML with a picture.
constexpr std::array kReaders = {
    "ros:mode=raw",
    "image:resolution=0.05",
    "image:resolution=0.1,mode=scale,x=-3.5,y=1e9,yaw=1.5",
    "image:resolution=1e6,mode=raw,negate=true",
};
/// Those that keep every percentage first.
constexpr std::array kWriters = {"ros:mode=raw", "ros:mode=raw,image=pgm", "ros:mode=scale",
                                 "ros:mode=trinary,image=pgm", "ros:mode=trinary"};
constexpr std::size_t kExact = 3;
/// Larger maps are only read.
constexpr std::int64_t kMostCells = 20000;

/// Each format, made once: none has a state of its own.
template <std::size_t count>
GridFormat& format(const std::array<const char*, count>& names, std::size_t index) {
  static const auto all = [&] {
    std::array<std::unique_ptr<GridFormat>, count> made;
    for (std::size_t k = 0; k < count; ++k)
      made[k] = registry().make<GridFormat>(parse_component(names[k]));
    return made;
  }();
  return *all[index];
}

/// So that no execution reads what another has left.
enum class Folder { yaml, picture, written };

const fs::path& folder(Folder which) {
  static const auto made = [] {
    std::array<fs::path, 3> paths;
    for (std::size_t k = 0; k < paths.size(); ++k) {
      paths[k] = fmt::format("{}/floors_{}", scratch_folder(), k);
      fs::create_directory(paths[k]);
    }
    return paths;
  }();
  return made[static_cast<std::size_t>(which)];
}

void put(const fs::path& file, std::string_view bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

/// What is refused is refused as bad input, by the name of the YAML or the picture.
std::optional<OccupancyGrid> read(GridFormat& from, const fs::path& file) {
  try {
    return from.read(file);
  } catch (const Error& error) {
    const std::string_view what = error.what();
    expect(error.code() == ErrorCode::input && what.find(scratch_folder()) != what.npos,
           [&] { return fmt::format("refused by: {}", what); });
    return std::nullopt;
  }
}

void expect_sound(const OccupancyGrid& grid) {
  check_frame(grid.frame, "what was read");
  expect(std::ssize(grid.occupancy) == grid.frame.size(), [] { return "cells are missing"; });
  const auto valid = [](int value) { return value >= kUnknownCell && value <= 100; };
  expect(std::ranges::all_of(grid.occupancy, valid), [] { return "an occupancy above 100 %"; });
}

void expect_round_trip(const OccupancyGrid& grid, std::size_t writer) {
  const fs::path file = folder(Folder::written) / "map.yaml";
  GridFormat& ros = format(kWriters, writer);
  ros.write(grid, file);
  const std::optional<OccupancyGrid> back = read(ros, file);
  expect(back.has_value(), [] { return "what was written is refused"; });
  const GridFrame &a = grid.frame, &b = back->frame;
  expect(a.width == b.width && a.height == b.height && a.resolution == b.resolution &&
             a.origin == b.origin && a.yaw == b.yaw,
         [] { return "written and read, it is elsewhere"; });
  for (std::size_t k = 0; k < grid.occupancy.size(); ++k) {
    const auto before = grid.occupancy[k], after = back->occupancy[k];
    const CellThresholds thresholds;
    expect(writer < kExact ? before == after : thresholds.state(before) == thresholds.state(after),
           [&] {
             return fmt::format("cell {}: {} % was written by {} and read as {} %", k, before,
                                kWriters[writer], after);
           });
  }
}

/// From a cell that the input chooses, in all directions.
void expect_same_rays(const OccupancyGrid& grid, Source& choices) {
  const RayCaster rays(grid);
  const GridFrame& frame = grid.frame;
  const Eigen::Vector2d from =
      frame.to_world({frame.width * std::abs(choices.unit()), frame.height * choices.unit()});
  constexpr int kDirections = 32;
  const double range = frame.resolution * (1 + choices.byte()), turn = choices.unit();
  std::vector<Eigen::Vector2d> beams;
  for (int k = 0; k < kDirections; ++k) beams.emplace_back(std::cos(0.2 * k), std::sin(0.2 * k));
  std::vector<RayHit> fast(beams.size()), exact(beams.size());
  rays.cast(from, turn, beams, range, fast);
  rays.cast_plainly(from, turn, beams, range, exact);
  for (std::size_t k = 0; k < beams.size(); ++k) {
    const RayHit &ray = fast[k], &plain = exact[k];
    expect(ray.hit == plain.hit && ray.range == plain.range && ray.x == plain.x && ray.y == plain.y,
           [&] {
             return fmt::format("ray {} from ({}, {}) at {} meets cell ({}, {}), not ({}, {})", k,
                                from.x(), from.y(), turn, ray.x, ray.y, plain.x, plain.y);
           });
  }
}

void expect_survey(const OccupancyGrid& grid, Source& choices) {
  static const std::unique_ptr<FloorSurveyor> surveyor =
      registry().has(FloorSurveyor::kKind, "round_body")
          ? registry().make<FloorSurveyor>("round_body")
          : nullptr;
  if (!surveyor) return;
  const GridFrame& frame = grid.frame;
  FloorSurveyOptions options{.radius = 0.1 * choices.byte() * frame.resolution};
  if (choices.below(2) == 1) {
    options.start = frame.to_world(
        {1.2 * frame.width * choices.unit(), 1.2 * frame.height * std::abs(choices.unit())});
  }
  FloorSurvey survey;
  try {
    survey = surveyor->survey(grid, options);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input,
           [&] { return fmt::format("no error of the map: {}", error.what()); });
    return;
  }
  const double cell = frame.cell_area(), all = cell * static_cast<double>(frame.size()),
               slack = 1e-9 * all;
  expect(std::abs(survey.free_area + survey.occupied_area + survey.unknown_area - all) <= slack &&
             survey.covered_area <= survey.free_area + slack &&
             survey.standing_area >= cell - slack &&
             survey.standing_area + survey.unreachable_area <= survey.free_area + slack,
         [&] { return fmt::format("areas of {} free m² do not add up", survey.free_area); });
}

void run(Bytes bytes) {
  Source source(bytes);
  const int choice = source.byte();
  const std::size_t reader = static_cast<std::size_t>(choice) % kReaders.size();
  const std::string_view text = text_of(source.rest());
  fs::path file = folder(Folder::picture) / "map.png";
  if (reader == 0) {
    file = folder(Folder::yaml) / "map.yaml";
    const std::size_t end = std::min(text.find('\0'), text.size());
    put(file, text.substr(0, end));
    put(folder(Folder::yaml) / "map.pgm", text.substr(std::min(end + 1, text.size())));
  } else {
    put(file, text);
  }
  const std::optional<OccupancyGrid> grid = read(format(kReaders, reader), file);
  if (!grid) return;
  expect_sound(*grid);
  if (grid->frame.size() > kMostCells) return;
  expect_round_trip(*grid, static_cast<std::size_t>(choice) / kReaders.size() % kWriters.size());
  Source choices(bytes.last(std::min<std::size_t>(bytes.size(), 8)));
  expect_same_rays(*grid, choices);
  expect_survey(*grid, choices);
}

/// A room with a doorway and unknown ground behind it.
OccupancyGrid room() {
  OccupancyGrid grid{{.width = 9, .height = 7, .resolution = 0.1, .origin = {-1.0, 2.5}}, {}};
  for (int y = 0; y < grid.frame.height; ++y) {
    for (int x = 0; x < grid.frame.width; ++x) {
      const bool wall = x == 0 || y == 0 || x == 8 || y == 6 || (x == 5 && y != 3);
      grid.occupancy.push_back(wall ? 100 : x > 5 ? kUnknownCell : static_cast<std::int8_t>(x * y));
    }
  }
  return grid;
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  const fs::path& out = folder(Folder::written);
  for (std::size_t writer = 0; writer < kWriters.size(); ++writer) {
    format(kWriters, writer).write(room(), out / "seed.yaml");
    std::string yaml = read_file(out / "seed.yaml");
    const std::size_t name = yaml.find("seed.p"), length = std::string_view("seed.png").size();
    const std::string picture = read_file(out / yaml.substr(name, length));
    yaml.replace(name, length, "map.pgm");
    const auto choice = static_cast<char>(kReaders.size() * writer);
    all.push_back(std::string(1, choice) + yaml + '\0' + picture);
    for (std::size_t reader = 1; reader < kReaders.size(); ++reader)
      all.push_back(std::string(1, static_cast<char>(choice + static_cast<int>(reader))) + picture);
  }
  const std::string words = "P2 # a comment\n3 2 100\n0 50 100 7 99 100\n";
  const std::string wide("P5 2 2 65535\n\0\1\xff\xff\x7f\0\0\0", 21);
  const std::string head = "image: map.pgm\nresolution: 0.05\norigin: [-1, 2, 0.5]\n";
  for (const std::string& more :
       {std::string("negate: 1\noccupied_thresh: 0.9\nfree_thresh: 0.1\nmode: scale\n"),
        std::string("mode: raw\n"), std::string("{}"), std::string()}) {
    all.push_back('\0' + head + more + '\0' + words);
    all.push_back('\0' + head + more + '\0' + wide);
  }
  all.push_back('\1' + words);
  all.push_back('\3' + wide);
  all.push_back(std::string(1, '\0') + "image: none.pgm\nresolution: 1\norigin: [0, 0, 0]\n");
  return all;
}

std::vector<std::string> words() {
  return {"image: map.pgm\n",
          "image: map.yaml\n",
          "resolution: 0.05\n",
          "resolution: .nan\n",
          "resolution: 1e-320\n",
          "origin: [0, 0, 0]\n",
          "origin: [1e308, -.inf, 9]\n",
          "negate: 1\n",
          "occupied_thresh: 0.65\n",
          "free_thresh: 0.196\n",
          "mode: trinary\n",
          "mode: scale\n",
          "mode: raw\n",
          "&a ",
          "*a",
          "<<: ",
          "!!str ",
          "? ",
          "|\n",
          "%YAML 1.2\n---\n",
          std::string("\0", 1) + "P5\n",
          "P2\n",
          " 65535\n",
          " 255\n",
          " 2147483647 ",
          "\x89PNG\r\n\x1a\n",
          "IHDR",
          "IDAT",
          "IEND",
          "PLTE",
          "tRNS",
          "gAMA",
          "\x1f\x8b"};
}

}  // namespace

Target grid() {
  return {"grid", &run, &seeds, &words, {{GridFormat::kKind, "ros"}, {GridFormat::kKind, "image"}},
          768};
}

}  // namespace cairn::fuzz
