// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <thread>

#include "cairn/io/format_by_ending.hpp"
#include "cairn/io/output_file.hpp"
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/runtime/error.hpp"
#include "formats/reading.hpp"

namespace cairn::test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kGraph =
    "VERTEX_SE2 0 0 0 0\n"
    "VERTEX_SE2 1 1 0.5 0.25\n"
    "EDGE_SE2 0 1 1.5 0.5 0.125 10 1 2 20 3 30\n";

std::string message_of(const std::function<void()>& call, ErrorCode code = ErrorCode::input) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    return error.what();
  }
  return "";
}

class File : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("cairn_file_test_" + std::to_string(::getpid()) +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path path(const std::string& name) const { return folder_ / name; }
  fs::path put(const std::string& name, const std::string& bytes) const {
    std::ofstream(path(name), std::ios::binary) << bytes;
    return path(name);
  }
  std::string raw(const fs::path& file) const {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder_))
      all.push_back(entry.path().filename());
    std::sort(all.begin(), all.end());
    return all;
  }

  fs::path folder_;
};

TEST_F(File, ReadsPlainAndPackedByContentNotByName) {
  write_file(path("a.gz"), kGraph);
  EXPECT_THAT(raw(path("a.gz")), StartsWith("\x1f\x8b"));
  fs::rename(path("a.gz"), path("a.g2o"));
  EXPECT_EQ(read_file(path("a.g2o")), kGraph);
  EXPECT_EQ(read_file(put("b.gz", kGraph)), kGraph);
}

TEST_F(File, ReadsPackedFilesOfSeveralMembersAndPadding) {
  write_file(path("a.gz"), "one ");
  write_file(path("b.gz"), "two");
  const fs::path both =
      put("both.gz", raw(path("a.gz")) + raw(path("b.gz")) + std::string(64, '\0'));
  EXPECT_EQ(read_file(both), "one two");
}

TEST_F(File, KeepsManyBytesWhole) {
  std::string bytes;
  for (std::uint32_t i = 0; i < 300000; ++i) bytes += std::to_string(i * 2654435761u);
  write_file(path("a.gz"), bytes);
  EXPECT_EQ(read_file(path("a.gz")), bytes);
}

TEST_F(File, RefusesPackedFilesThatBreakOffAnywhere) {
  write_file(path("a.gz"), kGraph);
  const std::string whole = raw(path("a.gz"));
  for (std::size_t length = 2; length < whole.size(); ++length) {
    const fs::path cut = put("cut.gz", whole.substr(0, length));
    EXPECT_THAT(message_of([&] { read_file(cut); }),
                HasSubstr("cut.gz: is gzip data that breaks off after " + std::to_string(length) +
                          " bytes"));
  }
}

TEST_F(File, RefusesPackedFilesThatAreDamaged) {
  write_file(path("a.gz"), kGraph);
  std::string bytes = raw(path("a.gz"));
  bytes[bytes.size() - 6] ^= 1;  // the check sum
  EXPECT_THAT(message_of([&] { read_file(put("b.gz", bytes)); }),
              HasSubstr("b.gz: is gzip data that is damaged"));
  EXPECT_THAT(message_of([&] { read_file(put("c.gz", raw(path("a.gz")) + "more")); }),
              HasSubstr("c.gz: has 4 bytes after the end of its gzip data"));
}

TEST_F(File, SaysWhyAFileCannotBeRead) {
  EXPECT_THAT(message_of([&] { read_file(path("none")); }),
              EndsWith("none: cannot be opened: No such file or directory"));
  EXPECT_THAT(message_of([&] { read_file(folder_); }), EndsWith(": is a folder; expected a file"));
  for (const char* nothing : {"", "\n \r\n"}) {
    EXPECT_THAT(message_of([&] { read_graph(put("empty.g2o", nothing), registry()); }),
                EndsWith("empty.g2o: the file is empty"));
  }
  EXPECT_THAT(message_of([&] { read_graph(put("x.png", "\x89PNG\r\n"), registry()); }),
              HasSubstr("x.png: no format knows this content, which begins with '\\x89PNG\\x0d'; "
                        "formats on offer: bal, euroc, g2o"));
}

TEST_F(File, DoesNotReadDevicesThatMayNeverEnd) {
  for (const char* device : {"/dev/zero", "/dev/full", "/dev/urandom"})
    EXPECT_THAT(message_of([&] { read_file(device); }), HasSubstr("is a device")) << device;
  EXPECT_EQ(read_file("/dev/null"), "");
}

TEST_F(File, RefusesWhatUnpacksToFarMoreThanGraphsDo) {
  const std::string megabyte(1 << 20, '0');
  write_file(path("one.gz"), megabyte);
  const std::string member = raw(path("one.gz"));
  std::string members;
  for (int k = 0; k < 100; ++k) members += member;
  EXPECT_EQ(read_file(put("good.gz", members)).size(), megabyte.size() * 100);
  for (int k = 0; k < 200; ++k) members += member;
  EXPECT_THAT(message_of([&] { read_file(put("bomb.gz", members)); }),
              HasSubstr("unpacks to more than 256 MB"));
}

TEST_F(File, ChoosesTheFormatByContentUnlessItIsNamed) {
  ReadReport report;
  const std::string edge2 = "EDGE2 0 1 1 0 0 9 1 4 16 2 3\n";
  read_graph(put("a.graph", kGraph), registry(), {}, report);
  EXPECT_EQ(report.format, "g2o");
  const Graph graph = read_graph(put("b.txt", edge2), registry(), {}, report, "toro");
  EXPECT_EQ(report.format, "toro");
  EXPECT_EQ(graph.information(0)[2], 2.0);
  EXPECT_THAT(message_of([&] { read_graph(path("b.txt"), registry(), {}, report, "g20"); },
                         ErrorCode::plugin),
              HasSubstr("g2o"));
}

TEST_F(File, NamesFileAndLine) {
  const fs::path file = put("a.g2o", std::string(kGraph) + "VERTEX_SE2 0 0 0 0\n");
  EXPECT_THAT(message_of([&] { read_graph(file, registry()); }),
              StartsWith(file.string() + ":4: "));
}

TEST_F(File, WritesByEndingAlsoPacked) {
  const Graph graph = read("g2o", kGraph).graph;
  write_graph(graph, path("a.graph.gz"), registry());
  EXPECT_THAT(read_file(path("a.graph.gz")),
              HasSubstr("\nEDGE2 0 1 1.5 0.5 0.125 10 1 20 30 2 3\n"));
  EXPECT_EQ(difference(graph, read_graph(path("a.graph.gz"), registry())), "");
  write_graph(graph, path("b"), registry(), "tum");
  EXPECT_EQ(read("tum", read_file(path("b"))).graph.variable_count(), 2);
}

TEST_F(File, RefusesToWriteWithoutAFormat) {
  const Graph graph = read("g2o", kGraph).graph;
  EXPECT_THAT(
      message_of([&] { write_graph(graph, path("a.xyz"), registry()); }, ErrorCode::usage),
      HasSubstr("no format that writes has the ending '.xyz'; endings on offer: .bal, .g2o"));
  EXPECT_THAT(message_of([&] { write_graph(graph, "-", registry()); }, ErrorCode::usage),
              HasSubstr("standard output has no ending that determines the format"));
  EXPECT_THAT(
      message_of([&] { write_graph(graph, path("a.txt"), registry(), "isam"); }, ErrorCode::usage),
      HasSubstr("format 'isam' only reads"));
  EXPECT_THAT(names(), ElementsAre());
}

TEST_F(File, ReplacesAFileAsAWholeAndKeepsItsMode) {
  put("a.g2o", "old");
  ::chmod(path("a.g2o").c_str(), 0640);
  write_file(path("a.g2o"), "new");
  EXPECT_EQ(raw(path("a.g2o")), "new");
  struct stat status {};
  ASSERT_EQ(::stat(path("a.g2o").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640u);
  EXPECT_THAT(names(), ElementsAre("a.g2o")) << "nothing left beside it";
}

TEST_F(File, WritesThroughASymbolicLink) {
  fs::create_directory(path("there"));
  put("there/a.g2o", "old");
  fs::create_symlink("there/a.g2o", path("link.g2o"));
  write_file(path("link.g2o"), "new");
  EXPECT_TRUE(fs::is_symlink(path("link.g2o")));
  EXPECT_EQ(raw(path("there/a.g2o")), "new");
}

TEST_F(File, LeavesNothingBehindWhenWritingFails) {
  fs::create_directory(path("a.g2o"));
  EXPECT_THAT(message_of([&] { write_file(path("a.g2o"), "new"); }), HasSubstr("is a folder"));
  EXPECT_THAT(message_of([&] { write_file(path("none") / "a.g2o", "new"); }),
              HasSubstr("cannot be written: No such file or directory"));
  EXPECT_THAT(names(), ElementsAre("a.g2o"));
  put("b.graph", "old");
  const Graph point = read("g2o", "VERTEX_TRACKXYZ 0 0 0 0\n").graph;
  EXPECT_THAT(message_of([&] { write_graph(point, path("b.graph"), registry()); }),
              HasSubstr("cannot express"));
  EXPECT_EQ(raw(path("b.graph")), "old");
}

TEST_F(File, DoesNotReplaceDevices) {
  write_file("/dev/null", "gone");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(File, WritesToStandardOutput) {
  const Graph graph = read("g2o", kGraph).graph;
  testing::internal::CaptureStdout();
  write_graph(graph, "-", registry(), "g2o");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), kGraph);
}

TEST_F(File, WaitsForTheReaderOfAFifoUntilItIsInterrupted) {
  const std::string fifo = path("fifo");
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  const std::atomic<bool> interrupt{true};
  end_waiting_for_readers_on(&interrupt);
  EXPECT_THAT(message_of([&] { write_file(fifo, "a graph"); }),
              EndsWith("fifo: interrupted before anything reads it"));
  end_waiting_for_readers_on(nullptr);
  std::string read;
  std::thread reader([&] {
    std::ifstream file(fifo);
    read.assign(std::istreambuf_iterator<char>(file), {});
  });
  const std::string megabyte(1 << 20, 'x');  // more than a pipe holds
  write_file(fifo, megabyte);
  reader.join();
  EXPECT_EQ(read, megabyte);
}

TEST_F(File, WithoutFormatsSaysWherePluginsWereFoundAndLookedFor) {
  Registry none(PluginSearch{.files = {},
                             .environment = false,
                             .user_folder = false,
                             .default_folder = false,
                             .folders = {folder_ / "missing"}});
  const fs::path file = put("map.g2o", kGraph);
  const std::string reading = message_of([&] { read_graph(file, none); });
  EXPECT_THAT(reading, HasSubstr("no plugin of formats is on offer; no plugin at all was found "
                                 "(CAIRN_PLUGIN_PATH is "));
  EXPECT_THAT(reading, HasSubstr("note: " + (folder_ / "missing").string() + ": no such folder"));
  const std::string writing =
      message_of([&] { write_graph(Graph(), path("out.g2o"), none); }, ErrorCode::usage);
  EXPECT_THAT(writing, HasSubstr("no plugin of formats is on offer; no plugin at all was found "));
  const std::string grids = no_plugin_of_formats(registry(), "grids");
  EXPECT_THAT(grids, StartsWith("no plugin of formats of grids is on offer; plugins of other kinds "
                                "were found in /"));
  EXPECT_THAT(grids, HasSubstr("in the folders of CAIRN_PLUGIN_PATH, which is "));
}

}  // namespace
}  // namespace cairn::test
