// SPDX-License-Identifier: BSD-3-Clause
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/grid/grid_format.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

/// 2 × 1 pixels of a PNG with colours: red (255, 0, 0), and white half transparent.
constexpr unsigned char kColours[] = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x06, 0x00, 0x00, 0x00, 0xf4,
    0x22, 0x7f, 0x8a, 0x00, 0x00, 0x00, 0x0f, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xf8,
    0xcf, 0xc0, 0xf0, 0x1f, 0x08, 0x1a, 0x00, 0x16, 0x73, 0x05, 0x7c, 0x26, 0x97, 0x01, 0xd2,
    0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

class GridFormats : public testing::Test {
 protected:
  GridFormats() {
    std::string name = (fs::temp_directory_path() / "cairn-grid-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = name;
  }
  ~GridFormats() override { fs::remove_all(folder_); }

  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  std::string text(const std::string& name, const std::string& bytes) const {
    std::ofstream(file(name), std::ios::binary) << bytes;
    return file(name);
  }
  OccupancyGrid read(const std::string& name) { return read_grid(name, registry_); }
  /// What `read` says when it refuses.
  std::string refusal(const std::string& name) {
    try {
      read(name);
    } catch (const Error& error) {
      return error.what();
    }
    return "read";
  }
  static OccupancyGrid grid_of(int width, std::vector<std::int8_t> occupancy) {
    return {{.width = width,
             .height = static_cast<int>(std::ssize(occupancy)) / width,
             .resolution = 0.1,
             .origin = {-1.25, 3.5},
             .yaw = 0.25},
            std::move(occupancy)};
  }

  Registry registry_;
  fs::path folder_;
};

TEST_F(GridFormats, EveryOccupancyComesBackFromScaleAndRaw) {
  std::vector<std::int8_t> all;
  for (int value = -1; value <= 100; ++value) all.push_back(static_cast<std::int8_t>(value));
  const OccupancyGrid grid = grid_of(17, all);
  for (const std::string mode : {"scale", "raw"}) {
    write_grid(grid, file(mode + ".yaml") + ":mode=" + mode, registry_);
    const OccupancyGrid back = read(file(mode + ".yaml"));
    EXPECT_EQ(back.occupancy, all) << mode;
    EXPECT_EQ(back.frame.width, 17);
    EXPECT_EQ(back.frame.height, 6);
    EXPECT_EQ(back.frame.resolution, 0.1);
    EXPECT_EQ(back.frame.origin, Eigen::Vector2d(-1.25, 3.5));
    EXPECT_EQ(back.frame.yaw, 0.25);
  }
}

TEST_F(GridFormats, TrinaryKeepsTheStateOfEachCell) {
  const OccupancyGrid grid = grid_of(3, {0, 100, -1, 20, 80, 50});
  for (const std::string picture : {"png", "pgm"}) {
    write_grid(grid, file("floor.yaml:image=" + picture), registry_);
    EXPECT_TRUE(fs::exists(file("floor." + picture)));
    EXPECT_THAT(read(file("floor.yaml")).occupancy, ElementsAre(0, 100, -1, 0, 100, -1));
  }
}

TEST_F(GridFormats, TheFirstRowOfAPictureIsTheUppermost) {
  const std::string name = text("two.pgm", "P5\n2 2\n255\n\xfe\xfe" + std::string(2, '\0'));
  EXPECT_THAT(read(name + ":resolution=0.5").occupancy, ElementsAre(100, 100, 0, 0));
  EXPECT_THAT(read(name + ":resolution=0.5,negate=true").occupancy, ElementsAre(0, 0, 100, 100));
}

TEST_F(GridFormats, ReadsPgmInWordsInTwoBytesAndWithComments) {
  EXPECT_THAT(read(text("w.pgm", "P2 # words\n# two\n2 1\n10\n10 0\n") + ":resolution=1").occupancy,
              ElementsAre(0, 100));
  const std::string wide = std::string("P5\n2 1\n65535\n") + "\xff\xff" + std::string(2, '\0');
  EXPECT_THAT(read(text("b.pgm", wide) + ":resolution=1").occupancy, ElementsAre(0, 100));
}

TEST_F(GridFormats, ThresholdsAreThoseOfTheMapServer) {
  // 205 is unknown by the defaults: p = 0.196 is not below 0.196.
  text("grey.pgm", "P2 5 1 255 254 206 205 90 89\n");
  const std::string keys = "image: grey.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n";
  EXPECT_THAT(read(text("a.yaml", keys)).occupancy, ElementsAre(0, 0, -1, -1, 100));
  EXPECT_THAT(read(text("b.yaml", keys + "free_thresh: 0.1\noccupied_thresh: 0.64\n")).occupancy,
              ElementsAre(0, -1, -1, 100, 100));
}

TEST_F(GridFormats, OfColoursTheMeanIsTakenAndTransparentCellsAreUnknown) {
  const std::string name =
      text("colours.png", {reinterpret_cast<const char*>(kColours), std::size(kColours)});
  // Red is 85, p = 0.67.
  EXPECT_THAT(read(name + ":resolution=1").occupancy, ElementsAre(100, -1));
}

TEST_F(GridFormats, BadFilesAreRefusedWithWhatIsWrong) {
  text("good.pgm", "P2 1 1 255 254\n");
  const std::string keys = "image: good.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"resolution: 0.05\norigin: [0, 0, 0]\n", "there is no key 'image'"},
      {"image: good.pgm\norigin: [0, 0, 0]\n", "there is no key 'resolution'"},
      {"image: good.pgm\nresolution: 0.05\n", "there is no key 'origin'"},
      {"image: good.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nresolution: 0.1\n",
       "line 4: resolution is given twice"},
      {"image: good.pgm\nresolution: 0.05\norigin: [0, 0, 0]\noccupied_tresh: 0.9\n",
       "line 4: there is no key 'occupied_tresh'; did you mean 'occupied_thresh'?"},
      {"image: good.pgm\nresolution: 0\norigin: [0, 0, 0]\n", "a resolution of 0"},
      {"image: good.pgm\nresolution: wide\norigin: [0, 0, 0]\n", "line 2: resolution is 'wide'"},
      {"image: good.pgm\nresolution: .nan\norigin: [0, 0, 0]\n", "a resolution of nan"},
      {"image: good.pgm\nresolution: 1\norigin: [0, 0]\n", "line 3: origin"},
      {"image: none.pgm\nresolution: 1\norigin: [0, 0, 0]\n", "none.pgm"},
      {keys + "mode: colour\n", "mode is 'colour'"},
      {keys + "negate: maybe\n", "negate is 'maybe'"},
      {keys + "free_thresh: 0.7\n", "the first must be the smaller one"},
      {"image: [good.pgm\n", "no YAML"},
      {"a line\n", "expected the keys"},
      {keys + "---\nimage: other.pgm\n", "more than one document"},
      {"", "expected the keys"},
      {std::string(100000, '['), "no YAML"}};
  for (const auto& [content, expected] : cases)
    EXPECT_THAT(refusal(text("bad.yaml", content)), HasSubstr(expected)) << content.substr(0, 80);
  EXPECT_THAT(refusal(text("torn.pgm", "P5\n9 9\n255\nabc") + ":resolution=1"), HasSubstr("torn"));
  EXPECT_THAT(refusal(text("torn.png", "\x89PNG\r\n\x1a\nabc") + ":resolution=1"),
              HasSubstr("not a whole PNG"));
  EXPECT_THAT(refusal(text("vast.pgm", "P5\n99999999 99999999\n255\n") + ":resolution=1"),
              HasSubstr("pixels"));
  for (const char* bytes : {"P2 2 1 99 98 100\n", "P5 2 1 99\n\x62\x64"}) {
    EXPECT_THAT(refusal(text("white.pgm", bytes) + ":resolution=1"),
                HasSubstr("a level of 100, and the largest is 99"));
  }
  for (const char* bytes :
       {"P2 1 1 255 254 253\n", "P5 1 1 255\naa", "P5 1 1 255\na\nP5 1 1 255\na"}) {
    EXPECT_THAT(refusal(text("more.pgm", bytes) + ":resolution=1"), HasSubstr("behind the image"));
  }
  EXPECT_THAT(refusal(text("no.png", "GIF89a") + ":resolution=1"), HasSubstr("neither"));
  EXPECT_THAT(refusal(file("good.pgm")), HasSubstr("resolution=0.05"));
  EXPECT_THAT(refusal(file("floor.tiff")), HasSubstr(".yaml"));
  EXPECT_THAT(refusal(file("good.pgm") + ":resolutio=1"), HasSubstr("resolution"));
}

TEST_F(GridFormats, APictureThatIsMissingOrTornIsNamedWithItsYaml) {
  const std::string keys = "resolution: 0.05\norigin: [0, 0, 0]\nimage: ";
  text("torn.pgm", "P5\n9 9\n255\nabc");
  for (const char* picture : {"none.png", "torn.pgm"}) {
    const std::string said = refusal(text("floor.yaml", keys + picture + "\n"));
    EXPECT_THAT(said, testing::StartsWith(file(picture) + ": "));
    EXPECT_THAT(said, HasSubstr(file("floor.yaml") + " names by its key 'image'"));
  }
  EXPECT_THAT(refusal(text("floor.yaml", keys + "/nowhere/x.png\n")), HasSubstr("/nowhere/x.png"));
}

TEST_F(GridFormats, AFrameWithoutAreaOrFarAwayIsRefused) {
  text("good.pgm", "P2 1 1 255 254\n");
  for (const char* resolution : {"0", "-0.05", ".nan", ".inf", "1e300", "1e-300"}) {
    EXPECT_THAT(refusal(text("bad.yaml", fmt::format("image: good.pgm\nresolution: {}\n"
                                                     "origin: [0, 0, 0]\n",
                                                     resolution))),
                HasSubstr("bad.yaml: a resolution of"))
        << resolution;
  }
  EXPECT_THAT(refusal(text("bad.yaml", "image: good.pgm\nresolution: 1\norigin: [1e300, 0, 0]\n")),
              HasSubstr("the origin is (1e+300, 0, 0)"));
}

/// A PNG's head may claim any size: what its bytes cannot hold takes no memory.
TEST_F(GridFormats, APngOfMorePixelsThanItsBytesHoldIsRefusedByItsHead) {
  std::string bytes(std::begin(kColours), std::end(kColours));
  // 10,000 × 10,000 pixels, and the checksum of that head.
  bytes.replace(16, 8, std::string("\0\0\x27\x10\0\0\x27\x10", 8));
  bytes.replace(29, 4, std::string("\xba\x4e\x62\x27", 4));
  EXPECT_THAT(refusal(text("vast.png", bytes) + ":resolution=1"),
              HasSubstr("72 bytes for 10000 × 10000 pixels"));
}

TEST_F(GridFormats, AllFilesOfAMapAreKnown) {
  text("good.pgm", "P2 1 1 255 254\n");
  const std::string yaml =
      text("floor.yaml", "image: good.pgm\nresolution: 1\norigin: [0, 0, 0]\n");
  EXPECT_THAT(grid_files_read(yaml, registry_), ElementsAre(yaml, file("good.pgm")));
  EXPECT_THAT(grid_files_read(file("good.pgm:resolution=1"), registry_),
              ElementsAre(file("good.pgm")));
  EXPECT_THAT(grid_files_written(file("x.yaml"), registry_),
              ElementsAre(file("x.yaml"), file("x.png")));
  EXPECT_THAT(grid_files_written(file("x.yaml:image=pgm"), registry_),
              ElementsAre(file("x.yaml"), file("x.pgm")));
  EXPECT_THROW(grid_files_read(file("none.yaml"), registry_), Error);
  // Known before anything is written: no unknown cells in a PGM of that mode.
  EXPECT_THROW(grid_files_written(file("x.yaml:mode=scale,image=pgm"), registry_), Error);
  EXPECT_THROW(grid_files_written(file("x.pgm:mode=scale"), registry_), Error);
  EXPECT_THROW(grid_files_written(file("x.yaml:mode=raaw"), registry_), Error);
}

TEST_F(GridFormats, AColonInANameIsNoOption) {
  const std::string name = text("a:b=c.pgm", "P2 1 1 255 254\n");
  EXPECT_THAT(refusal(name), HasSubstr("does not say how large")) << "there is a file of that name";
  EXPECT_TRUE(names_grid(name, registry_));
  EXPECT_TRUE(names_grid("floor.YAML", registry_));
  EXPECT_FALSE(names_grid("graph.g2o", registry_));
}

TEST_F(GridFormats, APgmHasNoTransparency) {
  const OccupancyGrid grid = grid_of(1, {50, -1});
  EXPECT_THROW(write_grid(grid, file("x.yaml:mode=scale,image=pgm"), registry_), Error);
  EXPECT_NO_THROW(write_grid(grid_of(1, {50, 3}), file("x.yaml:mode=scale,image=pgm"), registry_));
  EXPECT_THAT(read(file("x.yaml")).occupancy, ElementsAre(50, 3));
}

}  // namespace
}  // namespace cairn
