// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "cairn/io/packed_array.hpp"
#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"
#include "support/components.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ViewCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("picture", "html")) GTEST_SKIP() << "built without the page";
    run({"generate", "manhattan:poses=120", "-o", graph_, "--ground-truth", truth_, "--seed", "4"});
  }

  static Outcome run(const Arguments& arguments) {
    Outcome outcome = cairn(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome;
  }
  void optimize() {
    run({"optimize", graph_, "-o", best_, "--json", report_, "--record", recording_, "--quiet"});
  }
  /// The data within the page that these arguments make.
  boost::json::value data_of(Arguments arguments) {
    arguments.insert(arguments.end(), {"-o", page_});
    run(arguments);
    return data();
  }
  boost::json::value data() const {
    const std::string page = read_text(page_);
    const std::string opening = R"(<script type="application/json" id="cairn-data">)";
    const std::size_t begin = page.find(opening) + opening.size();
    return parse_json(page.substr(begin, page.find("</script>", begin) - begin));
  }
  static std::map<std::string, std::string> roles(const boost::json::value& graph) {
    std::map<std::string, std::string> all;
    for (const auto& estimate : graph.at("estimates").as_array()) {
      all[estimate.at("name").as_string().c_str()] = estimate.at("role").as_string().c_str();
    }
    return all;
  }

  TemporaryFolder folder_;
  std::string graph_ = folder_.file("city.g2o"), truth_ = folder_.file("truth.g2o");
  std::string best_ = folder_.file("best.g2o"), report_ = folder_.file("run.json");
  std::string recording_ = folder_.file("run.jsonl"), page_ = folder_.file("page.html");
};

TEST_F(ViewCommand, LaysEverythingOfARunTogether) {
  optimize();
  const auto page = data_of({"view", graph_, best_, report_, recording_, "--truth", truth_});
  ASSERT_EQ(page.at("graphs").as_array().size(), 1U);
  const auto& graph = page.at("graphs").at(0);
  EXPECT_EQ(roles(graph),
            (std::map<std::string, std::string>{
                {"city.g2o", "initial"}, {"best.g2o", "estimate"}, {"ground truth", "truth"}}));
  // The report and the recording are of one run, which must not show twice.
  ASSERT_EQ(graph.at("runs").as_array().size(), 1U);
  const auto report = parse_json(read_text(report_));
  const auto& run = graph.at("runs").at(0);
  EXPECT_EQ(run.at("iterations").as_array().size(), report.at("iterations").as_array().size());
  EXPECT_NEAR(run.at("chi2").at("final").to_number<double>(),
              graph.at("estimates").at(1).at("chi2").to_number<double>(), 1e-6);
  EXPECT_EQ(graph.at("recordings").at(0).at("kind").as_string(), "iterations");
  EXPECT_GT(graph.at("recordings").at(0).at("frames").as_array().size(), 2U);
}

TEST_F(ViewCommand, FindsTheGraphAndTheEstimateThatAReportNames) {
  optimize();
  const auto page = data_of({"view", report_});
  EXPECT_EQ(
      roles(page.at("graphs").at(0)),
      (std::map<std::string, std::string>{{"city.g2o", "initial"}, {"best.g2o", "estimate"}}));
  std::filesystem::remove(graph_);
  const auto alone = data_of({"view", report_});
  EXPECT_EQ(alone.at("graphs").at(0).at("runs").as_array().size(), 1U);
  EXPECT_THAT(std::string(alone.at("notes").at(0).as_string()), HasSubstr("is not there"));
}

TEST_F(ViewCommand, ARecordingShowsByItself) {
  optimize();
  const auto page = data_of({"view", recording_});
  EXPECT_EQ(page.at("graphs").at(0).at("variables").at("count").as_int64(), 120);
  EXPECT_EQ(page.at("graphs").at(0).at("recordings").as_array().size(), 1U);
}

TEST_F(ViewCommand, ReplacesNoneOfItsInputs) {
  optimize();
  for (const std::string& file : {recording_, report_}) {
    const std::string before = read_text(file);
    const Outcome outcome = cairn({"view", file, "-o", file});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("is read, and an output would replace it"));
    EXPECT_EQ(read_text(file), before);
  }
}

TEST_F(ViewCommand, TakesATrajectoryForTheTruth) {
  const std::string tum = folder_.file("truth.tum");
  run({"convert", truth_, tum});
  const auto page = data_of({"view", tum, graph_});
  ASSERT_EQ(page.at("graphs").as_array().size(), 1U);
  EXPECT_EQ(roles(page.at("graphs").at(0)).at("truth.tum"), "truth");
}

TEST_F(ViewCommand, ShowsKittiUprightAndEurocAsATrajectory) {
  CAIRN_NEEDS("variable", "VERTEX_SE3:QUAT");
  const std::string kitti = folder_.file("00.txt"), euroc = folder_.file("data.csv");
  write_text(kitti, "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 2\n");  // two metres ahead
  const auto last_position = [&](const Arguments& arguments) {
    const auto graph = data_of(arguments).at("graphs").at(0);
    return unpack_numbers(
        "f32", std::string(graph.at("estimates").at(0).at("positions").at("base64").as_string()),
        Packing::base64, 6, "positions");
  };
  const auto way = [&](const Arguments& arguments) {
    const std::vector<double> p = last_position(arguments);
    return std::vector<double>{p[3] - p[0], p[4] - p[1], p[5] - p[2]};
  };
  EXPECT_EQ(way({"view", kitti}), (std::vector<double>{2, 0, 0}));
  EXPECT_EQ(way({"view", kitti, "--axes", "camera"}), (std::vector<double>{2, 0, 0}));
  EXPECT_EQ(way({"view", kitti, "--axes", "robot"}), (std::vector<double>{0, 0, 2}));
  EXPECT_THAT(unfolded(cairn({"view", kitti, "-o", page_}).err),
              HasSubstr("KITTI's axes are those of a camera"));
  EXPECT_THAT(unfolded(cairn({"view", graph_, kitti, "-o", page_}).err),
              HasSubstr("00.txt: has no ids, so that over a graph its row k is pose k"));
  write_text(euroc,
             "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1403636580838555648,1,2,3,1,0,0,0\n"
             "1403636580843555328,2,2,5,1,0,0,0\n");
  EXPECT_EQ(way({"view", euroc}), (std::vector<double>{1, 0, 2}));
}

TEST_F(ViewCommand, EstimatesAreAlignedToTheTruth) {
  const std::string here = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_SE2 2 1 2 0\n";
  write_text(graph_, here + "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2 1 2 0 2 0 1 0 0 1 0 1\n");
  // Turned by a right angle, and 10 m away.
  write_text(truth_,
             "VERTEX_SE2 0 10 0 1.5708\nVERTEX_SE2 1 10 1 1.5708\n"
             "VERTEX_SE2 2 8 1 1.5708\n");
  const auto estimates =
      data_of({"view", graph_, "--truth", truth_}).at("graphs").at(0).at("estimates");
  ASSERT_EQ(estimates.as_array().size(), 2U);
  std::vector<std::vector<double>> positions;
  for (const auto& estimate : estimates.as_array())
    positions.push_back(
        unpack_numbers("f32", std::string(estimate.at("positions").at("base64").as_string()),
                       Packing::base64, 6, "positions"));
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(positions[0][k], positions[1][k], 1e-5) << k;
  EXPECT_NEAR(positions[1][2], positions[1][0], 1e-5);  // the truth stays where it is
}

TEST_F(ViewCommand, ShowsAGuessAndTakesNames) {
  const auto page = data_of({"view", graph_, "--name", "mine", "--initial", "chordal"});
  EXPECT_EQ(roles(page.at("graphs").at(0)),
            (std::map<std::string, std::string>{{"mine", "estimate"},
                                                {"initial guess: chordal", "initial"}}));
}

TEST_F(ViewCommand, GraphsThatHaveNothingInCommonStandSideBySide) {
  const auto page = data_of({"view", graph_, "@sphere:turns=4,poses_per_turn=10"});
  ASSERT_EQ(page.at("graphs").as_array().size(), 2U);
  EXPECT_EQ(page.at("graphs").at(1).at("dimension").as_int64(), 3);
}

TEST_F(ViewCommand, HostileNamesAndCommentsDoNoHarm) {
  const std::string name = folder_.file("<script>alert(1)<!-- \"'&\xff.g2o");
  write_text(name, "# </script><img src=x onerror=alert(2)>\n" + read_text(graph_));
  const auto page = data_of({"view", name, "--title", "</script><script>alert(3)</script>"});
  EXPECT_EQ(page.at("title").as_string(), "</script><script>alert(3)</script>");
  const std::string text = read_text(page_);
  for (const char* harm : {"<script>alert", "<img src=x", "alert(2)"}) {
    EXPECT_THAT(text, Not(HasSubstr(harm)));
  }
}

TEST_F(ViewCommand, OverwritesOnlyItsOwnPagesUnlessTold) {
  // The default name is in the folder where the program runs; a page of that name belongs to
  // someone.
  const std::string mine = "view_test_" + std::filesystem::path(folder_.path()).filename().string();
  const std::string file = folder_.file(mine + ".g2o");
  std::filesystem::copy_file(graph_, file);
  write_text(mine + ".html", "my homepage");
  const Outcome refused = cairn({"view", file});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("-o"));
  EXPECT_EQ(read_text(mine + ".html"), "my homepage");
  std::filesystem::remove(mine + ".html");
  run({"view", file});
  run({"view", file});
  EXPECT_THAT(read_text(mine + ".html"), HasSubstr("cairn-report"));
  std::filesystem::remove(mine + ".html");
}

TEST_F(ViewCommand, RefusesWhatItCannotShow) {
  const std::string broken = folder_.file("broken.json");
  write_text(broken, "{\"command\": ");
  EXPECT_EQ(cairn({"view", broken, "-o", page_}).exit_code, 3);
  write_text(broken, "{\"command\": \"info\"}");
  const Outcome other = cairn({"view", broken, "-o", page_});
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_THAT(other.err, HasSubstr("cairn optimize"));
  EXPECT_EQ(cairn({"view", folder_.file("nowhere.g2o"), "-o", page_}).exit_code, 3);
  EXPECT_EQ(cairn({"view", graph_, "-o", folder_.file("no/such/page.html")}).exit_code, 3);
  EXPECT_EQ(cairn({"view", graph_, "--name", "a", "--name", "b", "-o", page_}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(page_));
}

TEST_F(ViewCommand, BenchWritesThePageOfWhatItCompared) {
  run({"bench", graph_, "--linear-solver", "block_cholesky,eigen", "--repeat", "3", "--no-memory",
       "--quiet", "--html", page_, "--json", report_});
  const auto page = data();
  EXPECT_EQ(page.at("kind").as_string(), "bench");
  const auto& configurations = page.at("bench").at("graphs").at(0).at("configurations").as_array();
  ASSERT_EQ(configurations.size(), 2U);
  for (const auto& configuration : configurations) {
    const auto& history = configuration.at("history").as_array();
    ASSERT_EQ(history.size(), configuration.at("iterations").to_number<std::size_t>());
    EXPECT_DOUBLE_EQ(history.back().at("chi2").to_number<double>(),
                     configuration.at("chi2").at("final").to_number<double>());
  }
  EXPECT_EQ(
      roles(page.at("graphs").at(0)),
      (std::map<std::string, std::string>{
          {"initial estimate", "initial"}, {"block_cholesky", "estimate"}, {"eigen", "peer"}}));
  // The same report shows later, too.
  EXPECT_EQ(data_of({"view", report_}).at("bench").at("graphs").as_array().size(), 1U);
}

}  // namespace
}  // namespace cairn::test
