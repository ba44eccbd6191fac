// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/io/generator.hpp"
#include "cairn/io/packed_array.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/scene.hpp"
#include "cairn/runtime/error.hpp"
#include "support/plots.hpp"

namespace cairn::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr const char* kHostile = "</script><script>alert(1)</script><!-- \xff\n";

class Pictures : public ::testing::Test {
 protected:
  Album album() {
    const Simulation s = registry_.make<Generator>("manhattan:poses=100")->generate(registry_, 5);
    Graph graph = s.graph.clone();
    Album album;
    album.title = kHostile;
    album.scenes.push_back(scene_of(graph, kHostile));
    Scene& scene = album.scenes[0];
    scene.estimates.push_back(place(graph, scene, kHostile, EstimateRole::initial));
    scene.runs.push_back(
        {kHostile, registry_.make<Optimizer>("levenberg_marquardt")->optimize(graph), 1, 0});
    scene.estimates.push_back(place(graph, scene, "best", EstimateRole::estimate));
    return album;
  }
  std::string draw(const std::string& picture) { return draw(picture, album()); }
  std::string draw(const std::string& picture, const Album& what) {
    return registry_.make<Picture>(picture)->draw(what);
  }
  /// The data within a page.
  static boost::json::value data_of(const std::string& page) {
    const std::string opening = R"(<script type="application/json" id="cairn-data">)";
    const std::size_t begin = page.find(opening) + opening.size();
    return boost::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  }
  void need(const char* name) {
    if (!registry_.has("picture", name)) GTEST_SKIP() << "built without " << name;
  }
  Registry registry_;
};

TEST_F(Pictures, APageHoldsTheGraphAsTheContractSays) {
  need("html");
  if (IsSkipped()) return;
  const Album shown = album();
  const auto data = data_of(draw("html", shown));
  EXPECT_EQ(data.at("format").as_string(), "cairn-report");
  EXPECT_EQ(data.at("kind").as_string(), "view");
  const auto& graph = data.at("graphs").at(0);
  EXPECT_EQ(graph.at("variables").at("count").as_int64(), 100);
  EXPECT_EQ(graph.at("variables").at("ids").as_string(), "sequence");
  EXPECT_EQ(graph.at("edges").at("count").as_int64(), shown.scenes[0].edge_count());
  EXPECT_EQ(graph.at("runs").at(0).at("status").as_string(), "converged");
  const auto& best = graph.at("estimates").at(1);
  EXPECT_EQ(best.at("role").as_string(), "estimate");
  const std::vector<double> positions =
      unpack_numbers("f32", std::string(best.at("positions").at("base64").as_string()),
                     Packing::base64, 200, "positions");
  for (std::size_t k = 0; k < 200; ++k) {
    EXPECT_NEAR(positions[k] + shown.scenes[0].origin[k % 2],
                shown.scenes[0].estimates[1].positions[k], 1e-5);
  }
}

TEST_F(Pictures, NothingInAPageComesOutOfItsStrings) {
  need("html");
  if (IsSkipped()) return;
  Album bench = album();
  bench.bench = std::string(R"({"graphs":[{"graph":{"file":")") + "</script>\xff" +
                R"("},"configurations":[]}]})";
  const std::string page = draw("html", bench);
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  const auto data = data_of(page);  // would be cut short by a </script> in it
  EXPECT_THAT(std::string(data.at("title").as_string()), StartsWith("</script><script>alert(1)"));
  EXPECT_THAT(std::string(data.at("bench").at("graphs").at(0).at("graph").at("file").as_string()),
              StartsWith("</script>"));
}

TEST_F(Pictures, LongRecordingsAreThinnedToFitThePage) {
  need("html");
  if (IsSkipped()) return;
  Album shown = album();
  Recording recording;
  recording.name = "long";
  for (int k = 0; k < 100'000; ++k)
    recording.frames.push_back({k, 0, 0, 0, std::vector<float>(200)});
  shown.scenes[0].recordings.push_back(std::move(recording));
  const std::string page = draw("html", shown);
  EXPECT_LT(page.size(), 30'000'000U);
  const auto data = data_of(page);
  const auto& frames = data.at("graphs").at(0).at("recordings").at(0).at("frames").as_array();
  EXPECT_EQ(frames.size(), 25'000U);
  EXPECT_EQ(frames.back().at("iteration").as_int64(), 99'999);
  EXPECT_EQ(frames.back().at("positions").at("type").as_string(), "u16");
  EXPECT_THAT(std::string(data.at("notes").at(0).as_string()), HasSubstr("25000 of 100000"));
}

TEST_F(Pictures, FilesBeginAsTheirFormatDoes) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  EXPECT_THAT(draw("png:what=sparsity"), StartsWith("\x89PNG"));
  EXPECT_THAT(draw("pdf:what=steps"), StartsWith("%PDF-"));
  for (const char* what : {"trajectory", "convergence"})
    EXPECT_THAT(draw(std::string("svg:what=") + what), StartsWith("<?xml")) << what;
}

TEST_F(Pictures, TheSeriesAreInThePictureInTheirColours) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  const std::string picture = draw("svg");
  EXPECT_THAT(picture, HasSubstr("#0072b2"));  // the estimate
  EXPECT_THAT(picture, HasSubstr("#8a8f98"));  // the initial guess
  EXPECT_THAT(picture, HasSubstr("#e69f00"));  // loop closures
  EXPECT_THAT(picture, Not(HasSubstr("<script")));
  Album without = album();
  without.scenes[0].estimates.erase(without.scenes[0].estimates.begin());
  EXPECT_THAT(draw("svg", without), Not(HasSubstr("#8a8f98")));
  EXPECT_THAT(draw("svg:theme=dark"), HasSubstr("#56b4e9"));
}

TEST_F(Pictures, TheSameAlbumIsTheSameFile) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  for (const char* format : {"svg", "png", "pdf"}) EXPECT_EQ(draw(format), draw(format)) << format;
}

TEST_F(Pictures, TheNumbersOfAPlotAreThoseOfTheGraphAndItsOptions) {
  need("json");
  if (IsSkipped()) return;
  const auto data = boost::json::parse(draw("json:what=sparsity,theme=dark,width=320"));
  EXPECT_EQ(data.at("format").as_string(), "cairn-plot");
  EXPECT_EQ(data.at("options").at("theme").as_string(), "dark");
  EXPECT_EQ(data.at("options").at("width").as_int64(), 320);
  EXPECT_TRUE(data.at("options").at("x_max").is_null());
  const auto& graph = data.at("album").at("graphs").at(0);
  EXPECT_EQ(graph.at("variables").at("count").as_int64(), 100);
  EXPECT_EQ(graph.at("estimates").as_array().size(), 2U);
  // The diagonal has a block per variable that is not held, and L fills in.
  const auto& H = data.at("sparsity").at("H");
  EXPECT_EQ(H.at("cells").as_int64(), 99);
  EXPECT_GT(data.at("sparsity").at("L").at("blocks").as_int64(), H.at("blocks").as_int64());
  const std::vector<double> marked = unpack_numbers(
      "u8", std::string(H.at("marked").at("deflate").as_string()), Packing::deflate, 99 * 99, "H");
  std::int64_t lower = 0;
  for (std::size_t row = 0; row < 99; ++row)
    for (std::size_t column = 0; column <= row; ++column)
      lower += static_cast<std::int64_t>(marked[99 * row + column]);
  EXPECT_EQ(lower, H.at("blocks").as_int64());
  Album table;
  table.tables.push_back({"rows", {{"x", {1.0, 2.0}}, {"y", {std::nan(""), 4.0}}}});
  const auto columns = boost::json::parse(draw("json", table)).at("album").at("tables").at(0);
  EXPECT_EQ(boost::json::serialize(columns),
            R"({"name":"rows","columns":[{"name":"x","values":[1,2]},)"
            R"({"name":"y","values":[null,4]}]})");
}

TEST_F(Pictures, SayWhatIsMissing) {
  if (!draws_plots()) GTEST_SKIP() << "nothing draws plots";
  for (const char* what : {"trajectory", "convergence", "steps", "sparsity", "bars"}) {
    EXPECT_THROW(draw(std::string("svg:what=") + what, Album{}), Error) << what;
  }
  EXPECT_THROW(draw("svg:what=sparsity,linear_solver=eigen"), Error);
}

}  // namespace
}  // namespace cairn::test
