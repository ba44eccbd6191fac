// SPDX-License-Identifier: BSD-3-Clause
#include "album.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <optional>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/linear/graph_marginals.hpp"
#include "cairn/report/recording.hpp"
#include "cairn/report/scene_json.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "json_report.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

namespace json = boost::json;

/// Poses that estimates in one scene must at least share with it.
constexpr int kFewestShared = 2;

/// A scene, and the graph that it is of, unless it came from a recording.
struct Entry {
  Scene scene;
  std::optional<Graph> graph;
};

bool is_json(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{';
}

bool same_ids(const Scene& scene, const Graph& graph) {
  if (scene.variable_count() != graph.variable_count()) return false;
  return std::all_of(scene.ids.begin(), scene.ids.end(),
                     [&](Id id) { return graph.find(id).has_value(); });
}

class AlbumBuilder {
 public:
  AlbumBuilder(const AlbumOptions& options, Session& session)
      : options_(options), session_(session) {}

  void add_file(const std::string& file, const std::string& name) {
    if (file == "-" || file.starts_with('@')) return add_graph(file, name);
    const std::string text = read_file(file);
    if (is_recording(text)) {
      recordings_.push_back(read_recording(text, file));
      if (name != short_name(file)) recordings_.back().recordings.front().name = name;
    } else if (is_json(text)) {
      reports_.emplace_back(file, text);
    } else {
      add_graph(file, name);
    }
  }

  /// What refers to graphs comes after all of them, whatever the order on the command line.
  void join() {
    for (auto& [file, name, graph] : trajectories_) add_trajectory(file, name, std::move(graph));
    for (Scene& recording : recordings_) add_recording(std::move(recording));
    for (const auto& [file, text] : reports_) add_report(file, text);
    if (!options_.truth.empty()) add_truth();
    if (!options_.initial.empty()) add_initial();
    for (Entry& entry : entries_) give_roles(entry.scene);
  }

  void move_to(Album& album) {
    for (Entry& entry : entries_) album.scenes.push_back(std::move(entry.scene));
    album.notes.insert(album.notes.end(), notes_.begin(), notes_.end());
    album.bench = std::move(bench_);
  }

 private:
  struct Trajectory {
    std::string file, name;
    Graph graph;
  };

  void note(const std::string& text) {
    session_.note(text);
    notes_.push_back(text);
  }

  void add_graph(const std::string& file, const std::string& name) {
    LoadedGraph loaded = load_graph(file, options_.input, session_);
    if (loaded.graph.factor_count() == 0) {
      trajectories_.push_back({file, name, std::move(loaded.graph)});
    } else {
      add_loaded(file, name, std::move(loaded.graph));
    }
  }

  void add_loaded(const std::string& file, const std::string& name, Graph graph) {
    for (Entry& entry : entries_) {
      if (entry.graph && same_ids(entry.scene, graph)) return lay_over(entry, file, name, graph);
    }
    add_entry(file, name, std::move(graph));
  }

  Entry& add_entry(const std::string& file, const std::string& name, Graph graph) {
    Entry entry{scene_of(graph, short_name(file)), std::move(graph)};
    entry.scene.estimates.push_back(place(*entry.graph, entry.scene, name, EstimateRole::peer));
    entry.scene.estimates.back().file = file;
    entries_.push_back(std::move(entry));
    return entries_.back();
  }

  /// Another set of states for a graph that is there already; chi2 is over the factors of the
  /// first.
  void lay_over(Entry& entry, const std::string& file, const std::string& name,
                const Graph& graph) {
    Graph moved = entry.graph->clone();
    for (int v = 0; v < moved.variable_count(); ++v) {
      const int other = *graph.find(moved.id(v));
      if (moved.type(v).tag() != graph.type(other).tag()) {
        int matched = 0;
        entry.scene.estimates.push_back(
            place_by_id(graph, entry.scene, name, EstimateRole::peer, matched));
        entry.scene.estimates.back().file = file;
        return;
      }
      moved.set_state(v, graph.state(other));
    }
    entry.scene.estimates.push_back(place(moved, entry.scene, name, EstimateRole::peer));
    entry.scene.estimates.back().file = file;
  }

  /// Whether some scene took it; the last one that has its ids does.
  bool lay_by_id(const std::string& file, const std::string& name, const Graph& graph,
                 EstimateRole role) {
    for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
      int matched = 0;
      SceneEstimate estimate = place_by_id(graph, entry->scene, name, role, matched);
      if (matched < kFewestShared) continue;
      if (matched < graph.variable_count()) {
        note(fmt::format("{}: {} of {} are in {} by id, the rest is not shown", file, matched,
                         plural(graph.variable_count(), "variable"), entry->scene.name));
      }
      estimate.file = file;
      entry->scene.estimates.push_back(std::move(estimate));
      return true;
    }
    return false;
  }

  void add_trajectory(const std::string& file, const std::string& name, Graph graph) {
    const bool first = options_.truth.empty() && !truth_known_;
    const EstimateRole role = first ? EstimateRole::truth : EstimateRole::peer;
    if (lay_by_id(file, name, graph, role)) {
      truth_known_ = true;
    } else {
      add_entry(file, name, std::move(graph));
    }
  }

  void add_truth() {
    const LoadedGraph truth = load_graph(options_.truth, options_.input, session_);
    if (!lay_by_id(options_.truth, "ground truth", truth.graph, EstimateRole::truth)) {
      throw Error(
          ErrorCode::input,
          fmt::format("{}: none of the graphs has the ids of this ground truth", options_.truth));
    }
  }

  void add_initial() {
    const auto guess = session_.registry().make<InitialGuess>(options_.initial);
    for (Entry& entry : entries_) {
      if (!entry.graph || entry.scene.factors == 0) continue;
      Graph start = entry.graph->clone();
      for (const std::string& sentence : guess->compute(start)) {
        note(fmt::format("initial guess {}: {}", options_.initial, sentence));
      }
      entry.scene.estimates.push_back(
          place(start, entry.scene, "initial guess: " + options_.initial, EstimateRole::initial));
    }
  }

  void add_recording(Scene recording) {
    for (Entry& entry : entries_) {
      Scene& scene = entry.scene;
      if (scene.ids != recording.ids || scene.dimension != recording.dimension ||
          recording.recordings.empty()) {
        continue;
      }
      Recording& frames = recording.recordings.front();
      move_origin(frames, recording.origin, scene.origin, scene.dimension);
      scene.recordings.push_back(std::move(frames));
      scene.runs.push_back(std::move(recording.runs.front()));
      return;
    }
    entries_.push_back({std::move(recording), std::nullopt});
  }

  static void move_origin(Recording& recording, const std::array<double, 3>& from,
                          const std::array<double, 3>& to, int dimension) {
    const auto d = static_cast<std::size_t>(dimension);
    for (Frame& frame : recording.frames) {
      for (std::size_t k = 0; k < frame.positions.size(); ++k) {
        frame.positions[k] += static_cast<float>(from[k % d] - to[k % d]);
      }
    }
  }

  void add_report(const std::string& file, const std::string& text) {
    json::error_code error;
    const json::value report = json::parse(text, error);
    if (error || !report.is_object()) {
      throw Error(ErrorCode::input,
                  fmt::format("{}: begins like JSON but is not: {}", file, error.message()));
    }
    const json::value* command = report.get_object().if_contains("command");
    if (command && *command == "bench" && report.get_object().contains("graphs")) {
      add_bench(file, report.get_object(), text);
    } else {
      add_run(file, report.get_object(), text);
    }
  }

  /// A text within objects, or an empty one.
  static std::string text_at(const json::object& object, std::initializer_list<const char*> path) {
    const json::value* value = nullptr;
    const json::object* at = &object;
    for (const char* member : path) {
      value = at ? at->if_contains(member) : nullptr;
      at = value && value->is_object() ? &value->get_object() : nullptr;
    }
    return value && value->is_string() ? std::string(value->get_string()) : std::string();
  }

  void add_bench(const std::string& file, const json::object& report, const std::string& text) {
    if (!bench_.empty()) {
      throw Error(ErrorCode::usage,
                  fmt::format("{}: one comparison is shown at a time; leave out the other", file));
    }
    bench_ = text;
    const json::value& graphs = report.at("graphs");
    if (!graphs.is_array()) return;
    for (const json::value& graph : graphs.get_array()) {
      if (graph.is_object()) find_graph(text_at(graph.get_object(), {"graph", "file"}), file);
    }
  }

  void add_run(const std::string& file, const json::object& report, const std::string& text) {
    SceneRun run = read_run(text, file);
    Entry* entry = find_graph(text_at(report, {"graph", "file"}), file);
    const std::string output = text_at(report, {"output"});
    const json::value* covariance = report.if_contains("covariance");
    const bool has_covariance = covariance && covariance->is_object();
    if (entry && entry->graph && readable(output) && (!known(output) || has_covariance)) {
      const Graph estimate = load_graph(output, options_.input, session_).graph;
      if (same_ids(entry->scene, estimate)) {
        if (!known(output)) {
          lay_over(*entry, output, short_name(output), estimate);
          entry->scene.estimates.back().run = static_cast<int>(entry->scene.runs.size());
        }
        if (has_covariance) add_covariances(*entry, output, estimate, *covariance, file);
      }
    } else if (has_covariance) {
      note(
          fmt::format("{}: its covariances are not shown, since the estimate was not written, or "
                      "is gone: give cairn optimize an output",
                      file));
    }
    if (!entry) {
      entries_.emplace_back();
      entry = &entries_.back();
      entry->scene.name = short_name(file);
    }
    for (SceneRun& shown : entry->scene.runs) {
      if (!same_run(shown, run)) continue;
      shown = std::move(run);  // the report says more than the recording
      return;
    }
    entry->scene.runs.push_back(std::move(run));
  }

  /// The covariances in a run's report, turned into positions in the world, go to the estimate that
  /// the run wrote.
  static void add_covariances(Entry& entry, const std::string& output, const Graph& graph,
                              const json::value& covariance, const std::string& where) {
    const auto estimate = std::ranges::find(entry.scene.estimates, output, &SceneEstimate::file);
    if (estimate == entry.scene.estimates.end()) return;
    estimate->covariance_variables.clear();
    estimate->covariance_upper.clear();
    try {
      for (const json::value& block : covariance.at("blocks").as_array()) {
        const std::optional<int> found = graph.find(block.at("id").to_number<Id>());
        if (!found) continue;
        add_ellipse(entry, *estimate, graph, *found, block.at("covariance").as_array());
      }
    } catch (const boost::system::system_error& error) {
      throw Error(ErrorCode::input,
                  fmt::format("{}: member 'covariance' is not as cairn optimize writes it: {}",
                              where, error.code().message()));
    }
  }

  static void add_ellipse(const Entry& entry, SceneEstimate& estimate, const Graph& graph,
                          int variable, const json::array& rows) {
    const VariableType& type = graph.type(variable);
    const auto size = static_cast<std::size_t>(type.tangent_size());
    const int dimension = entry.scene.dimension;
    if (!type.placement() || type.placement()->dimension() != dimension) return;
    std::vector<double> sigma;
    for (const json::value& row : rows) {
      for (const json::value& number : row.as_array()) sigma.push_back(number.to_number<double>());
    }
    if (sigma.size() != size * size || std::ranges::all_of(sigma, [](double s) { return s == 0; }))
      return;  // of another type, or held
    const std::vector<double> world = position_covariance(type, graph.state(variable), sigma);
    estimate.covariance_variables.push_back(*entry.graph->find(graph.id(variable)));
    for (int r = 0; r < dimension; ++r) {
      for (int c = r; c < dimension; ++c)
        estimate.covariance_upper.push_back(static_cast<float>(world[c * dimension + r]));
    }
  }

  /// A recording and a report of one run: no two runs take the same time to the last bit.
  static bool same_run(const SceneRun& a, const SceneRun& b) {
    return a.summary.seconds.total == b.summary.seconds.total &&
           a.summary.final_chi2 == b.summary.final_chi2;
  }

  static bool readable(const std::string& file) {
    std::error_code error;
    return file != "-" && std::filesystem::is_regular_file(file, error);
  }

  bool known(const std::string& file) const {
    return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& entry) {
      return std::any_of(entry.scene.estimates.begin(), entry.scene.estimates.end(),
                         [&](const SceneEstimate& estimate) { return estimate.file == file; });
    });
  }

  /// The scene of a graph that a report names: one that is there, or read now if it can be. Null,
  /// with a note, otherwise.
  Entry* find_graph(const std::string& graph, const std::string& report) {
    for (Entry& entry : entries_) {
      for (const SceneEstimate& estimate : entry.scene.estimates) {
        if (estimate.file == graph) return &entry;
      }
    }
    try {
      if (graph.starts_with('@') || readable(graph)) {
        return &add_entry(graph, short_name(graph),
                          load_graph(graph, options_.input, session_).graph);
      }
      note(fmt::format("{}: its graph {} is not there, so only its curves are shown", report,
                       graph.empty() ? "(not named)" : graph));
    } catch (const Error& error) {
      note(fmt::format("{}: its graph is not shown: {}", report, error.what()));
    }
    return nullptr;
  }

  /// The lowest chi2 is the estimate; where it is not the first file's, that one is what it began
  /// with.
  static void give_roles(Scene& scene) {
    std::vector<SceneEstimate*> open;
    for (SceneEstimate& estimate : scene.estimates) {
      if (estimate.role == EstimateRole::estimate) return;  // from a recording, which knows
      if (estimate.role == EstimateRole::peer) open.push_back(&estimate);
    }
    if (open.empty()) return;
    SceneEstimate* best = open.front();
    for (SceneEstimate* estimate : open) {
      if (estimate->chi2 < best->chi2 * (1 - 1e-9)) best = estimate;
    }
    best->role = EstimateRole::estimate;
    const bool guessed = std::any_of(
        scene.estimates.begin(), scene.estimates.end(),
        [](const SceneEstimate& estimate) { return estimate.role == EstimateRole::initial; });
    if (best != open.front() && !guessed) open.front()->role = EstimateRole::initial;
  }

  const AlbumOptions& options_;
  Session& session_;
  std::vector<Entry> entries_;
  std::vector<Trajectory> trajectories_;
  std::vector<Scene> recordings_;
  std::vector<std::pair<std::string, std::string>> reports_;  // file and text
  std::vector<std::string> notes_;
  std::string bench_;
  bool truth_known_ = false;
};

std::string title_of(const AlbumOptions& options) {
  if (!options.title.empty()) return options.title;
  const std::string first = short_name(options.files.front());
  return options.files.size() == 1 ? first
                                   : fmt::format("{} and {} more", first, options.files.size() - 1);
}

}  // namespace

void add_album_options(CLI::App& command, AlbumOptions& options) {
  command
      .add_option("files", options.files,
                  "graphs (.gz too, @KIND to generate), trajectories, recordings, JSON of runs")
      ->type_name("FILE")
      ->required();
  command
      .add_option("--name", options.names, "what to call the first FILE, the second … [its name]")
      ->type_name("TEXT")
      ->allow_extra_args(false);
  command.add_option("--truth", options.truth, "the ground truth, laid over by id")
      ->type_name("FILE");
  command
      .add_option("--initial", options.initial, "show this guess too: a name of kind initial_guess")
      ->type_name("NAME");
  command.add_option("--title", options.title, "title [name of the first FILE]")->type_name("TEXT");
  add_input_options(command, options.input);
}

std::string short_name(const std::string& file) {
  if (file.starts_with('@')) return file;
  return file == "-" ? "standard input" : std::filesystem::path(file).filename().string();
}

Album begin_album(const std::string& title, const std::string& command) {
  Album album;
  album.title = title;
  album.command = command;
  album.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  json::object context;
  end_report(context);
  album.machine = json::serialize(context.at("machine"));
  album.build = json::serialize(context.at("build"));
  return album;
}

Album load_album(const AlbumOptions& options, const std::string& command, Session& session) {
  if (options.names.size() > options.files.size()) {
    throw Error(ErrorCode::usage,
                fmt::format("--name is given {} times for {}", options.names.size(),
                            plural(std::ssize(options.files), "file")));
  }
  AlbumBuilder builder(options, session);
  for (std::size_t k = 0; k < options.files.size(); ++k) {
    const std::string& file = options.files[k];
    builder.add_file(file, k < options.names.size() ? options.names[k] : short_name(file));
  }
  builder.join();
  Album album = begin_album(title_of(options), command);
  builder.move_to(album);
  return album;
}

}  // namespace cairn::app
