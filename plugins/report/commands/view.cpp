// SPDX-License-Identifier: BSD-3-Clause
// cairn view FILE…: one page for the browser.
#include <filesystem>
#include <memory>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/album.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/picture_files.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

struct ViewOptions {
  AlbumOptions album;
  std::string output;

  static auto fields() {
    using O = ViewOptions;
    return OptionFields<O>()
        .part(&O::album,
              AlbumOptions::fields("graphs (.gz too, @KIND to generate), trajectories, recordings "
                                   "(--record), JSON of optimize, bench or replay"))
        .text("output", &O::output, "the page [name of the first FILE, .html]")
        .letter('o')
        .placeholder("PAGE");
  }
};

/// Only pages of cairn are overwritten without having been named.
void check_default(const std::string& page) {
  std::error_code error;
  if (!std::filesystem::exists(page, error)) return;
  if (std::filesystem::is_regular_file(page, error) &&
      read_file(page).find("id=\"cairn-data\"") != std::string::npos) {
    return;
  }
  throw Error(ErrorCode::usage,
              fmt::format("{} is there and is not a page of cairn; name another with -o", page));
}

boost::json::object report_json(const Album& album, const std::string& page, std::size_t bytes) {
  boost::json::object report = begin_report("view");
  report["page"] = page;
  report["bytes"] = bytes;
  boost::json::array graphs;
  for (const Scene& scene : album.scenes) {
    boost::json::array estimates;
    for (const SceneEstimate& estimate : scene.estimates) {
      estimates.push_back({{"name", estimate.name},
                           {"role", to_string(estimate.role)},
                           {"file", text_json(estimate.file)},
                           {"chi2", estimate.chi2}});
    }
    graphs.push_back({{"name", scene.name},
                      {"variables", scene.variable_count()},
                      {"factors", scene.factors},
                      {"estimates", std::move(estimates)},
                      {"runs", scene.runs.size()},
                      {"recordings", scene.recordings.size()}});
  }
  report["graphs"] = std::move(graphs);
  report["explorations"] = album.explorations.size();
  report["bench"] = !album.bench.empty();
  report["notes"] = strings_json(album.notes);
  return report;
}

int run(const ViewOptions& options, Session& session) {
  std::string page = options.output;
  if (page.empty()) {
    page = default_picture(options.album.files.front(), "html");
    check_default(page);
  }
  check_makes_pages("cairn plot draws static plots", session);
  check_file(page, session);
  session.use_threads();
  const Album album = load_album(
      options.album, fmt::format("cairn view {}", joined(options.album.files, " ")), session);
  const std::string bytes = draw_picture(album, {"html", {}}, session);
  Results results;
  results.write(page, [&] { write_file(page, bytes); });
  results.add([&] { session.write_json(report_json(album, page, bytes.size())); });
  results.finish();
  session.print(
      fmt::format("{}: {}; open it in any browser\n", page, bytes_text(std::ssize(bytes))));
  return 0;
}

}  // namespace

void add_view(Registrar& registrar) {
  add_command<ViewOptions>(
      registrar, "view",
      "Graphs with the same ids are laid over each other: the lowest chi2 is the estimate, of two "
      "the\n"
      "first FILE else the initial estimate. Files without factors: ground truth, by id. The page "
      "needs\n"
      "no network.\n\n"
      "Example:\n"
      "  cairn optimize city.g2o -o best.g2o --json run.json --record run.jsonl\n"
      "  cairn view city.g2o best.g2o run.json run.jsonl -o city.html\n"
      "  cairn explore floor.yaml --record robot.jsonl && cairn view robot.jsonl",
      run);
}

}  // namespace cairn::app
