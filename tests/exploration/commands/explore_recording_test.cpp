// SPDX-License-Identifier: BSD-3-Clause
// cairn explore --record and --html, and what cairn view and cairn plot make of recordings.
#include <chrono>
#include <cstdint>
#include <future>
#include <regex>
#include <string>
#include <thread>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "exploration/commands/exploration_commands.hpp"
#include "support/http_client.hpp"
#include "support/plots.hpp"

namespace cairn::test {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class ExploreRecording : public ExplorationCommands {
 protected:
  void SetUp() override {
    ExplorationCommands::SetUp();
    need({{"registration", "simulated"}, {"picture", "html"}});
  }
  static Outcome explore(const Arguments& more) {
    return run({"explore", "@rooms:width=10,height=8,seed=2", "--registration",
                "simulated:range=1.4,angle=0.35", "--until", "distance=10"},
               more);
  }
  static std::string without_times(const std::string& file) {
    return std::regex_replace(read_text(file), std::regex(",\"time\":[0-9.]+"), "");
  }
};

TEST_F(ExploreRecording, IsALineForEachMotionAndDecisionAndThePageHasThemAll) {
  const std::string record = folder_.file("run.jsonl"), page = folder_.file("run.html"),
                    direct = folder_.file("direct.html"), report = folder_.file("run.json");
  const Outcome run = explore({"--record", record, "--html", direct, "--json", report});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto said = parse_json(read_text(report)).as_object();
  const std::vector<std::string> written = lines(read_text(record));
  EXPECT_EQ(static_cast<std::int64_t>(written.size()),
            said.at("motions").as_int64() + said.at("decisions").at("count").as_int64() + 3);
  EXPECT_EQ(parse_json(written.back()).at("why"), said.at("why"));
  const auto view = report_of({"view", record, "-o", page}).as_object();
  EXPECT_EQ(view.at("explorations").to_number<int>(), 1);
  EXPECT_TRUE(view.at("notes").as_array().empty());
  // Every line is in both pages, character by character.
  for (const std::string& file : {page, direct}) {
    const std::string html = read_text(file);
    for (const std::string& line : written) ASSERT_THAT(html, HasSubstr(line));
  }
}

TEST_F(ExploreRecording, DiffersInTimesAloneWhateverTheNumberOfThreads) {
  const std::string first = folder_.file("a.jsonl"), second = folder_.file("b.jsonl");
  ASSERT_EQ(explore({"--record", first, "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(explore({"--record", second, "--threads", "3"}).exit_code, 0);
  EXPECT_EQ(without_times(first), without_times(second));
}

/// What a browser does: the page, and then lines until the end.
std::vector<std::string> follow(std::uint16_t port, std::string& page) {
  std::vector<std::string> all;
  for (int tries = 0; tries < 6000; ++tries) {
    if (page.empty()) page = http_get(port, "/").body;
    const HttpAnswer answer =
        page.empty() ? HttpAnswer{} : http_get(port, fmt::format("/lines?from={}", all.size()));
    for (const std::string& line : lines(answer.body)) all.push_back(line);
    if (!all.empty() && all.back().starts_with("{\"end\"")) break;
    if (answer.status == 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return all;
}

TEST_F(ExploreRecording, IsServedWhileItIsWritten) {
  const std::string record = folder_.file("run.jsonl");
  const std::uint16_t port = free_port();
  std::string page;
  auto lines_served = std::async(std::launch::async, [&] { return follow(port, page); });
  const Outcome run = explore({"--record", record, "--serve", std::to_string(port)});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr(fmt::format("http://127.0.0.1:{}/", port)));
  EXPECT_EQ(lines_served.get(), lines(read_text(record)));
  EXPECT_THAT(page, AllOf(HasSubstr("\"live\":\"lines\""), HasSubstr("connect-src 'self'")));
  // Floor, seed and parts are in the page itself.
  EXPECT_THAT(page, HasSubstr("\"header\":" + lines(read_text(record)).front()));
  EXPECT_EQ(http_get(port, "/").status, 0);
}

TEST_F(ExploreRecording, IsServedOfOneRunAtAPortThatIsOne) {
  EXPECT_EQ(explore({"--serve", "70000"}).exit_code, 2);
  const Outcome several = explore({"--serve", "0", "--runs", "2"});
  EXPECT_EQ(several.exit_code, 2);
  EXPECT_THAT(unfolded(several.err), HasSubstr("--serve is of one run"));
  EXPECT_THAT(explore({"--serve", "0"}).err, HasSubstr("follow the run at http://127.0.0.1:"));
  // Port 0 is not known otherwise.
  EXPECT_THAT(explore({"--serve", "0", "--quiet"}).err, StartsWith("http://127.0.0.1:"));
  EXPECT_EQ(explore({"--serve", std::to_string(free_port()), "--quiet"}).err, "");
}

TEST_F(ExploreRecording, ThatWasCutShortIsShownAndSaid) {
  const std::string record = folder_.file("run.jsonl"), page = folder_.file("run.html");
  ASSERT_EQ(explore({"--record", record}).exit_code, 0);
  const std::string whole = read_text(record);
  write_text(record, whole.substr(0, whole.size() / 2));
  const Outcome view = cairn({"view", record, "-o", page});
  ASSERT_EQ(view.exit_code, 0) << view.err;
  EXPECT_THAT(unfolded(view.err), AllOf(HasSubstr("cut short"), HasSubstr("was killed")));
  EXPECT_THAT(read_text(page), HasSubstr("\"complete\":false"));
  write_text(record, whole.substr(0, whole.find('\n') + 1));
  const Outcome empty = cairn({"view", record, "-o", page});
  EXPECT_EQ(empty.exit_code, 3);
  EXPECT_THAT(unfolded(empty.err), HasSubstr("not even the start was recorded"));
  write_text(record, whole + "{\"step\":1}\n");
  const Outcome more = cairn({"view", record, "-o", page});
  EXPECT_EQ(more.exit_code, 3);
  EXPECT_THAT(unfolded(more.err), HasSubstr("follows the end"));
}

TEST_F(ExploreRecording, EntropiesOfTheMapAreOverOneArea) {
  const std::string record = folder_.file("run.jsonl"), report = folder_.file("run.json");
  ASSERT_EQ(explore({"--record", record, "--json", report}).exit_code, 0);
  const std::string text = read_text(record);
  const std::regex member(R"re("map_entropy":([-0-9.e]+),"grid_area":([-0-9.e]+))re");
  std::vector<double> entropies, areas;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), member);
       at != std::sregex_iterator(); ++at) {
    entropies.push_back(std::stod((*at)[1]));
    areas.push_back(std::stod((*at)[2]));
  }
  ASSERT_GT(entropies.size(), 3U);
  EXPECT_THAT(areas, Each(areas.front()));
  for (std::size_t k = 1; k < entropies.size(); ++k)
    EXPECT_LT(entropies[k], entropies[k - 1] + 0.02 * entropies.front()) << k;
  EXPECT_LT(entropies.back(), 0.9 * entropies.front());
  const double measure =
      parse_json(read_text(report)).at("measures").at("map_entropy").to_number<double>();
  EXPECT_NEAR(entropies.back(), measure, 1e-6 * measure);
}

TEST_F(ExploreRecording, HasCurvesToPlot) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  const std::string record = folder_.file("run.jsonl"), plot = folder_.file("run.svg");
  ASSERT_EQ(explore({"--record", record}).exit_code, 0);
  const Outcome run = cairn({"plot", record, "--y", "map_entropy", "--y", "trajectory_entropy",
                             "--x", "distance", "-o", plot});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(read_text(plot), HasSubstr("<svg"));
  const Outcome wrong = cairn({"plot", record, "--x", "metres", "-o", plot});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(unfolded(wrong.err), HasSubstr("trajectory_entropy"));
}

TEST_F(ExploreRecording, HasMapsToPlot) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  const std::string record = folder_.file("run.jsonl"), plot = folder_.file("map.svg");
  ASSERT_EQ(cairn({"explore", "@rooms", "--until", "distance=4", "--record", record}).exit_code, 0);
  const Outcome whole = cairn({"plot", record, "--what", "map", "-o", plot});
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_THAT(read_text(plot), AllOf(HasSubstr("<image"), Not(HasSubstr("NaN"))));
  const std::string end = read_text(plot);
  ASSERT_EQ(cairn({"plot", record, "--what", "map", "--decision", "1", "-o", plot}).exit_code, 0);
  EXPECT_NE(read_text(plot), end);
  const Outcome late = cairn({"plot", record, "--what", "map", "--decision", "99", "-o", plot});
  EXPECT_EQ(late.exit_code, 3);
  EXPECT_THAT(late.err, HasSubstr("there is no decision 99; the last one is"));
  EXPECT_EQ(cairn({"plot", record, "--what", "map", "--y", "loops", "-o", plot}).exit_code, 2);
  const Outcome curves = cairn({"plot", record, "--decision", "1", "-o", plot});
  EXPECT_EQ(curves.exit_code, 2);
  EXPECT_THAT(curves.err, HasSubstr("--decision is for --what map"));
}

TEST_F(ExploreRecording, IsRefusedBeforeTheRunWhereItCannotBeWritten) {
  EXPECT_EQ(explore({"--record", "-"}).exit_code, 2);
  EXPECT_EQ(explore({"--record", folder_.file("none/run.jsonl")}).exit_code, 3);
  EXPECT_EQ(explore({"--html", folder_.file("none/run.html")}).exit_code, 3);
  const std::string both = folder_.file("run");
  EXPECT_EQ(explore({"--record", both, "--html", both}).exit_code, 2);
  EXPECT_TRUE(folder_.contents().empty());
}

}  // namespace
}  // namespace cairn::test
