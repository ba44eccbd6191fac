// SPDX-License-Identifier: BSD-3-Clause
// cairn plot FILE… -o picture.svg: a static picture, as for a paper.
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include <fmt/core.h>

#include "album.hpp"
#include "arguments.hpp"
#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "commands.hpp"
#include "json_report.hpp"
#include "picture_files.hpp"
#include "results.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

struct PlotOptions {
  AlbumOptions album;
  std::string output;
  std::string what = "auto";
  std::string size;
  std::string theme = "light";
  std::string colour = "class";
  bool poses = false;
  double ellipses = 0.0;
  int decision = 0;
  std::string x;
  std::vector<std::string> y;
  std::optional<double> x_max;
  std::string logarithmic = "none";
  std::string linear_solver = "block_cholesky";
};

/// "900x600" as two options.
void put_size(const std::string& size, ComponentSpec& picture) {
  if (size.empty()) return;
  const std::size_t cross = size.find('x');
  const auto number = [](std::string_view text) {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() ? value : 0;
  };
  const int width = number(std::string_view(size).substr(0, cross));
  const int height =
      cross == std::string::npos ? 0 : number(std::string_view(size).substr(cross + 1));
  if (width < 1 || height < 1) {
    throw Error(ErrorCode::usage, fmt::format("--size is '{}', expected WIDTHxHEIGHT such as "
                                              "900x600 [px; in a PDF 1/96 inch]",
                                              size));
  }
  picture.values["width"] = fmt::format("{}", width);
  picture.values["height"] = fmt::format("{}", height);
}

/// The picture that `-o` names, or one named after the first file: no other file is overwritten
/// without having been named.
std::string output_of(const PlotOptions& options, Session& session) {
  if (!options.output.empty()) return options.output;
  std::string ending = "svg";
  if (!session.registry().has(Picture::kKind, ending)) ending = "html";
  std::string file = default_picture(options.album.files.front(), ending);
  std::error_code error;
  if (std::filesystem::exists(file, error)) {
    throw Error(ErrorCode::usage,
                fmt::format("{} is there already; name it, or another, with -o", file));
  }
  return file;
}

void check_columns(const PlotOptions& options) {
  if (options.decision > 0 && options.what != "map")
    throw Error(ErrorCode::usage, "--decision is for --what map");
  if (options.what == "map" &&
      (!options.x.empty() || !options.y.empty() || options.x_max || options.logarithmic != "none"))
    throw Error(ErrorCode::usage,
                "--x, --y, --x-max and --log are for columns, not for --what map");
  if (std::ranges::any_of(options.album.files, has_columns)) return;
  if (!options.y.empty() || options.x_max || options.logarithmic != "none")
    throw Error(ErrorCode::usage,
                "--y, --x-max and --log are for columns of CSV files (.csv) and of recordings of "
                "explorations");
}

ComponentSpec picture_spec(const PlotOptions& options, const std::string& output,
                           Session& session) {
  check_picture(output, session);
  check_columns(options);
  ComponentSpec picture{picture_format(output, session), {}};
  if (picture.name == "html") return picture;
  if (options.album.apart && options.album.files.size() > 1 && !options.album.title.empty())
    throw Error(
        ErrorCode::usage,
        "--title is that of one plot; with --apart each has the name of its file, or one by "
        "--name");
  picture.values = {{"what", options.what},
                    {"theme", options.theme},
                    {"colour", options.colour},
                    {"poses", options.poses ? "true" : "false"},
                    {"ellipses", fmt::format("{}", options.ellipses)},
                    {"linear_solver", options.linear_solver}};
  picture.values["x"] = options.x;
  picture.values["y_columns"] = joined(options.y, "\n");
  picture.values["logarithmic"] = options.logarithmic;
  picture.values["decision"] = fmt::format("{}", options.decision);
  if (options.x_max) picture.values["x_max"] = fmt::format("{}", *options.x_max);
  put_size(options.size, picture);
  return picture;
}

int run(const PlotOptions& options, Session& session) {
  const std::string output = output_of(options, session);
  const ComponentSpec picture = picture_spec(options, output, session);
  session.registry().make<Picture>(picture);  // a wrong name is told before files are read
  session.use_threads();
  AlbumOptions files = options.album;
  files.curves = picture.name != "html";
  files.maps = options.what == "map";
  const Album album =
      load_album(files, fmt::format("cairn plot {}", joined(options.album.files, " ")), session);
  const std::string bytes = draw_picture(album, picture, session);
  Results results(session);
  results.write(output, [&] { write_file(output, bytes); });
  results.add([&] {
    boost::json::object report = begin_report("plot");
    report["picture"] = output;
    report["bytes"] = bytes.size();
    report["what"] = options.what;
    session.write_json(report);
  });
  results.finish();
  session.print(fmt::format("{}: {}\n", output, bytes_text(std::ssize(bytes))));
  return 0;
}

}  // namespace

Command add_plot(ArgumentParser program) {
  auto options = std::make_shared<PlotOptions>();  // lives as long as the parser and the run
  ArgumentParser cli = program.add_command("plot", "a static plot: SVG, PNG or PDF");
  add_album_options(cli, options->album,
                    "graph, @KIND, trajectory, recording, CSV, JSON of optimize, bench, replay");
  cli.add_option("-o,--output", options->output,
                 "the plot: .svg, .png or .pdf [name of the first FILE, .svg]")
      .type_name("PICTURE");
  cli.add_option("--what", options->what,
                 "trajectory, convergence, bars, scaling, sparsity, steps, columns, map; auto: by "
                 "FILE")
      .type_name("WHAT")
      .one_of({"auto", "trajectory", "convergence", "bars", "scaling", "sparsity", "steps",
               "columns", "map"})
      .show_default();
  cli.add_option("--size", options->size, "WIDTHxHEIGHT [px; in a PDF 1/96 inch] [900x600]")
      .type_name("SIZE");
  cli.add_option("--theme", options->theme, "light or dark")
      .type_name("THEME")
      .one_of({"light", "dark"})
      .show_default();
  cli.add_option("--colour", options->colour, "of edges: by class or by residual")
      .type_name("BY")
      .one_of({"class", "residual"})
      .show_default();
  cli.add_flag("--poses", options->poses, "mark each pose of a trajectory");
  cli.add_option("--ellipses", options->ellipses,
                 "covariances [σ], of optimize --covariance blocks; on maps the robot's")
      .type_name("SIGMAS")
      .within(0.0, 1000.0);
  cli.add_option("--decision", options->decision,
                 "of a map: at this decision, with what was to choose from [the end]")
      .type_name("N")
      .within(1, 2147483647);
  cli.add_flag("--apart", options->album.apart,
               "each graph beside the others, not one over the other");
  cli.add_option("--x", options->x,
                 "of convergence: iterations or time [iterations]; of CSV: a column [first]")
      .type_name("AXIS");
  cli.add_option("--y", options->y,
                 "columns, such as 'chi2' or 'seconds*': each --y is a chart [all in one]")
      .type_name("COLUMNS")
      .repeatable();
  cli.add_option("--x-max", options->x_max,
                 "right end of a plot of columns: rows beyond are left out")
      .type_name("X");
  cli.add_option("--log", options->logarithmic, "logarithmic axes of a plot of columns")
      .type_name("AXES")
      .one_of({"none", "x", "y", "xy"})
      .show_default();
  cli.add_option("--linear-solver", options->linear_solver,
                 "its elimination order gives the sparsity of L")
      .component({"linear_solver"})
      .show_default();
  cli.footer(
      "Example:\n"
      "  cairn plot city.g2o best.g2o --truth truth.g2o -o city.svg\n"
      "  cairn plot run1.json run2.json --what convergence --x time -o curves.pdf\n"
      "  cairn plot robot.jsonl --what map --decision 40 -o robot.png\n"
      "  cairn plot @sphere --what sparsity --linear-solver block_cholesky:ordering=natural -o "
      "L.png");
  return {cli, [options](Session& session) { return run(*options, session); }};
}

}  // namespace cairn::app
