// SPDX-License-Identifier: BSD-3-Clause
// Floors: cairn info FLOOR, cairn generate of a floor plan.
#include "floors.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <vector>

#include <fmt/core.h>
#include <boost/json/array.hpp>

#include "cairn/grid/floor_plan.hpp"
#include "cairn/grid/floor_survey.hpp"
#include "cairn/grid/grid_format.hpp"
#include "cairn/io/format_by_ending.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/json_report.hpp"
#include "cairn/program/other_input.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

constexpr const char* kSurveyor = "round_body";
constexpr std::size_t kShownLeaks = 5;

OccupancyGrid generate(const ComponentSpec& spec, std::uint64_t seed, Registry& registry) {
  return call_plugin([&] { return "floor plan '" + spec.name + "'"; },
                     [&] { return registry.make<FloorPlan>(spec)->generate(seed); });
}

FloorSurvey survey_floor(const std::string& name, const OccupancyGrid& grid,
                         const FloorSurveyOptions& options, FloorSurveyor& surveyor) {
  try {
    return call_plugin([&] { return fmt::format("floor surveyor '{}'", kSurveyor); },
                       [&] { return surveyor.survey(grid, options); });
  } catch (const Error& error) {
    if (error.code() != ErrorCode::input) throw;
    throw Error(error.code(), fmt::format("{}: {}", name, error.what()));
  }
}

std::string point_text(const Eigen::Vector2d& point) {
  return fmt::format("({:.2f}, {:.2f})", point.x(), point.y());
}

std::string leak_text(const FloorLeak& leak) {
  return fmt::format("{:.2f} m at {}{}", leak.length, point_text(leak.at),
                     leak.at_edge ? ", at the edge of the map" : "");
}

void add_leaks(const std::vector<FloorLeak>& leaks, Table& table) {
  if (leaks.empty()) return table.add({"leaks", "none: all that it covers is enclosed"});
  double length = 0.0;
  for (const FloorLeak& leak : leaks) length += leak.length;
  table.add({"leaks", fmt::format("{}, {:.3g} m in all, where free cells border on unknown ones",
                                  plural(std::ssize(leaks), "place"), length)});
  for (std::size_t k = 0; k < std::min(kShownLeaks, leaks.size()); ++k)
    table.add({"", leak_text(leaks[k])});
  if (leaks.size() > kShownLeaks)
    table.add({"", fmt::format("{} shorter ones", leaks.size() - kShownLeaks)});
}

std::string survey_text(const std::string& name, const GridFrame& frame, const FloorSurvey& survey,
                        const BodyOptions& options, bool colour) {
  Table table({{"", Table::Align::left}, {"", Table::Align::left}}, "  ");
  table.add({"size", size_text(frame)});
  table.add(
      {"free / occupied / unknown", fmt::format("{:.4g} / {:.4g} / {:.4g} m²", survey.free_area,
                                                survey.occupied_area, survey.unknown_area)});
  table.add({"start", fmt::format("{}, {:.3g} m from the nearest wall", point_text(survey.start),
                                  survey.start_clearance)});
  table.add({fmt::format("a body of radius {:g} m", options.radius),
             fmt::format("covers {:.4g} m², {:.1f} % of the free floor; its centre reaches {:.4g} "
                         "m²",
                         survey.covered_area, 100.0 * survey.covered_area / survey.free_area,
                         survey.standing_area)});
  if (survey.unreachable_parts > 0) {
    table.add({"without a way to it",
               fmt::format("{}, {:.3g} m² for its centre", plural(survey.unreachable_parts, "part"),
                           survey.unreachable_area)});
  }
  if (survey.larger_part) {
    table.add({"", fmt::format("the largest has {:.4g} m² for it, nearest to the start at {}",
                               survey.larger_area, point_text(*survey.larger_part))});
  }
  add_leaks(survey.leaks, table);
  return bold(name, colour) + "\n" + table.text(colour);
}

json::array point_json(const Eigen::Vector2d& point) { return {point.x(), point.y()}; }

json::object report_json(const std::string& name, const GridFrame& frame, const FloorSurvey& survey,
                         const BodyOptions& options) {
  json::object report = begin_report("info");
  report["floor"] = frame_json(name, frame);
  report["area"] = {{"free", survey.free_area},
                    {"occupied", survey.occupied_area},
                    {"unknown", survey.unknown_area}};
  report["body"] = {{"radius", options.radius},
                    {"start", point_json(survey.start)},
                    {"clearance", survey.start_clearance},
                    {"standing_area", survey.standing_area},
                    {"covered_area", survey.covered_area},
                    {"unreachable_parts", survey.unreachable_parts},
                    {"unreachable_area", survey.unreachable_area}};
  if (survey.larger_part) {
    report["larger_part"] = {{"nearest", point_json(*survey.larger_part)},
                             {"standing_area", survey.larger_area}};
  }
  json::array& leaks = report["leaks"].emplace_array();
  for (const FloorLeak& leak : survey.leaks)
    leaks.push_back({{"at", point_json(leak.at)}, {"length", leak.length}, {"edge", leak.at_edge}});
  return report;
}

}  // namespace

/// The name of a floor plan without its @.
void check_is_no_plan(const std::string& name, const Registry& registry) {
  const std::string kind = name.substr(0, name.find(':'));
  if (!registry.has(FloorPlan::kKind, kind) || std::filesystem::exists(name)) return;
  throw Error(ErrorCode::input,
              fmt::format("there is no file {}; @{} makes that floor plan", kind, name));
}

OccupancyGrid load_floor(const std::string& name, Session& session) {
  Registry& registry = session.registry();
  if (!name.starts_with('@')) {
    check_is_no_plan(name, registry);
    for (const auto& file : grid_files_read(name, registry)) session.files.add_input(file.string());
    return read_grid(name, registry);
  }
  ComponentSpec spec = parse_component(std::string_view(name).substr(1));
  const std::uint64_t seed = take_seed(spec, registry.options(FloorPlan::kKind, spec.name));
  return generate(spec, seed, registry);
}

std::vector<std::uint8_t> note_narrow_ways(const std::string& name, const OccupancyGrid& floor,
                                           double radius, const std::optional<Pose2>& start,
                                           Session& session) {
  Registry& registry = session.registry();
  if (!registry.has(FloorSurveyor::kKind, kSurveyor)) return {};
  FloorSurveyOptions options{.radius = radius};
  if (start) options.start = start->translation();
  const auto surveyor = registry.make<FloorSurveyor>(kSurveyor);
  FloorSurvey survey = survey_floor(name, floor, options, *surveyor);
  if (survey.larger_part) {
    session.note(
        fmt::format("the start {} is in a pocket that a body with a radius of {:g} m cannot leave, "
                    "{:.3g} m² for its middle; the largest part of the floor has {:.4g} m², "
                    "nearest at {}",
                    point_text(survey.start), radius, survey.standing_area, survey.larger_area,
                    point_text(*survey.larger_part)));
    return std::move(survey.covered);
  }
  // Less is the corners behind furniture.
  constexpr double kMuch = 0.05;
  if (survey.unreachable_area > kMuch * survey.standing_area) {
    session.note(
        fmt::format("{} of the floor, {:.3g} m² for the middle of a body with a radius of {:g} m, "
                    "cannot be reached from {}: the ways there are too narrow for it",
                    plural(survey.unreachable_parts, "part"), survey.unreachable_area, radius,
                    point_text(survey.start)));
  }
  return std::move(survey.covered);
}

std::string size_text(const GridFrame& frame) {
  return fmt::format("{:.4g} m × {:.4g} m, {} × {} cells of {:g} m", frame.width * frame.resolution,
                     frame.height * frame.resolution, frame.width, frame.height, frame.resolution);
}

json::object frame_json(const std::string& name, const GridFrame& frame) {
  return {{"file", name},
          {"cells", {frame.width, frame.height}},
          {"resolution", frame.resolution},
          {"origin", {frame.origin.x(), frame.origin.y(), frame.yaw}}};
}

void check_map_file(const std::string& file, const char* option, Session& session) {
  if (file == "-" || !names_grid(file, session.registry())) {
    throw Error(ErrorCode::usage,
                fmt::format("{} {}: a map is written to a file with its ending: map.yaml (with "
                            "map.png beside it)",
                            option, file));
  }
  for (const auto& each : grid_files_written(file, session.registry()))
    check_file(each.string(), session);
}

namespace {

/// For a file that is neither, by its ending and its content: what maps of floors end in.
Error neither_graph_nor_floor(const std::string& name, const std::filesystem::path& file,
                              const Error& refusal, Session& session) {
  Registry& registry = session.registry();
  const auto maps = format_of_ending<GridFormat>(file_ending(file), registry);
  const std::string why = refusal.what();
  const bool has_options = name != file.string();
  const bool is_read = !has_options && why.find("no format knows") == std::string::npos;
  if (is_read || maps.endings.empty() || has_graph_ending(file.string(), registry)) return refusal;
  return {ErrorCode::input,
          fmt::format("{} of floors end in .{}",
                      has_options ? file.string() + ": no format of maps goes by that ending, and "
                                                    "graphs have no options behind the name; maps"
                                  : why + ". Maps",
                      joined(maps.endings, ", ."))};
}

int info_of_floor(const std::string& name, const BodyOptions& options, Session& session) {
  FloorSurveyOptions survey_options{.radius = options.radius};
  if (options.start_x.has_value() != options.start_y.has_value())
    throw Error(ErrorCode::usage, "--start-x and --start-y go together");
  if (options.start_x) survey_options.start = Eigen::Vector2d(*options.start_x, *options.start_y);
  const auto surveyor = session.registry().make<FloorSurveyor>(kSurveyor);
  const OccupancyGrid grid = load_floor(name, session);
  const FloorSurvey survey = survey_floor(name, grid, survey_options, *surveyor);
  Results results;
  results.add([&] { session.write_json(report_json(name, grid.frame, survey, options)); });
  results.add(
      [&] { session.print(survey_text(name, grid.frame, survey, options, session.colour())); });
  results.finish();
  return 0;
}

int generate_floor(const std::string& kind, std::uint64_t seed, const std::string& output,
                   Session& session) {
  Registry& registry = session.registry();
  if (output == "-" || !names_grid(output, registry)) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: a floor is written to a file with the ending of a map: floor.yaml "
                            "(with floor.png beside it)",
                            output));
  }
  for (const auto& file : grid_files_written(output, registry)) check_file(file.string(), session);
  const OccupancyGrid grid = generate(parse_component(kind), seed, registry);
  Results results;
  results.write(output, [&] { write_grid(grid, output, registry); });
  results.add([&] {
    json::object report = begin_report("generate");
    report["kind"] = kind;
    report["seed"] = seed;
    report["floor"] = frame_json(output, grid.frame);
    session.write_json(report);
  });
  results.finish();
  session.print(fmt::format("{}: {} written to {}\n", kind, size_text(grid.frame), output));
  return 0;
}

class FloorInput final : public OtherInput {
 public:
  std::string what() const override { return "a floor"; }
  bool names_file(const std::string& file, Session& session) const override {
    return !has_graph_ending(file, session.registry()) && names_grid(file, session.registry());
  }
  bool generates(const std::string& kind, Session& session) const override {
    return session.registry().has(FloorPlan::kKind, kind.substr(0, kind.find(':')));
  }
  Error no_graph(const std::string& file, const Error& refusal, Session& session) const override {
    try {
      const std::filesystem::path named = parse_named_file(file).file;
      if (!names_file(file, session)) return neither_graph_nor_floor(file, named, refusal, session);
    } catch (const Error&) {  // of a plugin that is broken
      return refusal;
    }
    const std::string remedy = fmt::format(
        "the map of a floor, which has no graph: cairn info {0} describes it, cairn explore {0} "
        "drives on it",
        file);
    try {
      read_grid(file, session.registry());
      return {ErrorCode::input, fmt::format("{} is {}", file, remedy)};
    } catch (const Error&) {
      return {ErrorCode::input, fmt::format("{}. If it is {}", refusal.what(), remedy)};
    }
  }
  int info(const std::string& name, const BodyOptions& options, Session& session) const override {
    return info_of_floor(name, options, session);
  }
  int generate(const std::string& kind, std::uint64_t seed, const std::string& output,
               Session& session) const override {
    return generate_floor(kind, seed, output, session);
  }
};

}  // namespace

void add_floor_input(Registrar& registrar) {
  registrar.add<OtherInput>(
      "floor", {}, [](const Options&, Registry&) { return std::make_unique<FloorInput>(); });
}

}  // namespace cairn::app
