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

struct PlotOptions {
  AlbumOptions album;
  std::string output;
  std::string what = "auto";
  std::string size;
  std::string theme = "light";
  std::string colour = "class";
  bool poses = false;
  double ellipses = 0.0;
  std::optional<std::int64_t> decision;
  std::string x;
  std::vector<std::string> y;
  std::optional<double> x_max;
  std::string logarithmic = "none";
  std::string linear_solver = "block_cholesky";

  static auto fields() {
    using O = PlotOptions;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    return OptionFields<O>()
        .part(&O::album,
              AlbumOptions::fields("graph, @KIND, trajectory, recording, CSV, JSON of optimize, "
                                   "bench, replay"))
        .text("output", &O::output, "the plot: .svg, .png or .pdf [name of the first FILE, .svg]")
        .letter('o')
        .placeholder("PICTURE")
        .choice("what", &O::what,
                {"auto", "trajectory", "convergence", "bars", "scaling", "sparsity", "steps",
                 "columns", "map"},
                "trajectory, convergence, bars, scaling, sparsity, steps, columns, map; auto: by "
                "FILE")
        .placeholder("WHAT")
        .text("size", &O::size, "WIDTHxHEIGHT [px; in a PDF 1/96 inch] [900x600]")
        .placeholder("SIZE")
        .choice("theme", &O::theme, {"light", "dark"}, "light or dark")
        .placeholder("THEME")
        .choice("colour", &O::colour, {"class", "residual"}, "of edges: by class or by residual")
        .placeholder("BY")
        .boolean("poses", &O::poses, "mark each pose of a trajectory")
        .real("ellipses", &O::ellipses, 0.0, 1000.0,
              "covariances [σ], of optimize --covariance blocks; on maps the robot's")
        .placeholder("SIGMAS")
        .integer("decision", &O::decision, 1, 2147483647,
                 "of a map: at this decision, with what was to choose from [the end]")
        .part(&O::album, OptionFields<AlbumOptions>().boolean(
                             "apart", &AlbumOptions::apart,
                             "each graph beside the others, not one over the other"))
        .text("x", &O::x,
              "of convergence: iterations or time [iterations]; of CSV: a column [first]")
        .placeholder("AXIS")
        .text("y", &O::y, "columns, such as 'chi2' or 'seconds*': each --y is a chart [all in one]")
        .placeholder("COLUMNS")
        .real("x_max", &O::x_max, -kAny, kAny,
              "right end of a plot of columns: rows beyond are left out")
        .choice("log", &O::logarithmic, {"none", "x", "y", "xy"},
                "logarithmic axes of a plot of columns")
        .placeholder("AXES")
        .component("linear_solver", &O::linear_solver, {"linear_solver"},
                   "its elimination order gives the sparsity of L");
  }
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

void check_columns(const PlotOptions& options, Session& session) {
  if (options.decision && options.what != "map")
    throw Error(ErrorCode::usage, "--decision is for --what map");
  if (options.what == "map" &&
      (!options.x.empty() || !options.y.empty() || options.x_max || options.logarithmic != "none"))
    throw Error(ErrorCode::usage,
                "--x, --y, --x-max and --log are for columns, not for --what map");
  const auto columns = [&](const std::string& file) {
    return has_columns(file, session.registry());
  };
  if (std::ranges::any_of(options.album.files, columns)) return;
  if (!options.y.empty() || options.x_max || options.logarithmic != "none")
    throw Error(ErrorCode::usage,
                "--y, --x-max and --log are for columns of CSV files (.csv) and of recordings of "
                "explorations");
}

ComponentSpec picture_spec(const PlotOptions& options, const std::string& output,
                           Session& session) {
  picture_format(output, session);
  check_file(output, session);
  check_columns(options, session);
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
  picture.values["decision"] = fmt::format("{}", options.decision.value_or(0));
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
  Results results;
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

void add_plot(Registrar& registrar) {
  add_command<PlotOptions>(
      registrar, "plot",
      "Example:\n"
      "  cairn plot city.g2o best.g2o --truth truth.g2o -o city.svg\n"
      "  cairn plot run1.json run2.json --what convergence --x time -o curves.pdf\n"
      "  cairn plot robot.jsonl --what map --decision 40 -o robot.png\n"
      "  cairn plot @sphere --what sparsity --linear-solver block_cholesky:ordering=natural -o "
      "L.png",
      run);
}

}  // namespace cairn::app
