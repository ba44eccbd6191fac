// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/album_json.hpp"

#include <algorithm>
#include <limits>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/io/packed_array.hpp"
#include "cairn/report/scene_json.hpp"
#include "cairn/runtime/version.hpp"

namespace cairn {
namespace {

// Numbers in all frames of a recording. Above the first limit they are 16-bit steps; above the
// second frames are left out, so that a page stays below 30 MB.
constexpr std::size_t kNumbersAsFloat = 1'500'000;
constexpr std::size_t kNumbersAtAll = 5'000'000;
// Above this an orientation of each variable would make the page heavy.
constexpr std::size_t kMostOriented = 200'000;

std::string base64(std::span<const float> numbers) { return packed_json(numbers, Packing::base64); }

/// f32 relative to the scene's origin.
std::string positions_json(const SceneEstimate& estimate, const Scene& scene) {
  const auto d = static_cast<std::size_t>(scene.dimension);
  std::vector<float> relative(estimate.positions.size());
  for (std::size_t k = 0; k < relative.size(); ++k) {
    relative[k] = static_cast<float>(estimate.positions[k] - scene.origin[k % d]);
  }
  return base64(relative);
}

std::string covariance_json(const SceneEstimate& estimate) {
  return fmt::format(
      R"({{"variable":{},"upper":{}}})",
      packed_json(std::span<const std::int32_t>(estimate.covariance_variables), Packing::deflate),
      base64(estimate.covariance_upper));
}

std::string estimate_json(const SceneEstimate& estimate, const Scene& scene) {
  std::string text =
      fmt::format(R"({{"name":{},"role":"{}","file":{},"chi2":{},"positions":{})",
                  json_string(estimate.name), to_string(estimate.role), json_string(estimate.file),
                  json_number(estimate.chi2), positions_json(estimate, scene));
  if (estimate.run >= 0) text += fmt::format(R"(,"run":{})", estimate.run);
  if (!estimate.edge_chi2.empty()) text += R"(,"edge_chi2":)" + base64(estimate.edge_chi2);
  if (!estimate.orientation.empty() && estimate.role == EstimateRole::estimate &&
      scene.ids.size() <= kMostOriented) {
    text += R"(,"orientation":)" + base64(estimate.orientation);
  }
  if (!estimate.covariance_variables.empty()) {
    text += R"(,"covariance":)" + covariance_json(estimate);
  }
  return text + "}";
}

/// Frames that fit the page: all, or as many as do, spread evenly, the first and last with
/// them.
std::vector<const Frame*> fitting(const Recording& recording) {
  std::vector<const Frame*> frames;
  if (recording.frames.empty()) return frames;
  const std::size_t size = std::max<std::size_t>(recording.frames.front().positions.size(), 1);
  const std::size_t all = recording.frames.size();
  const std::size_t most = std::max<std::size_t>(kNumbersAtAll / size, 2);
  const std::size_t count = std::min(all, most);
  for (std::size_t k = 0; k < count; ++k) {
    frames.push_back(&recording.frames[count == 1 ? 0 : k * (all - 1) / (count - 1)]);
  }
  return frames;
}

std::string frame_json(const Frame& frame, int dimension, bool as_float) {
  return fmt::format(
      R"({{"label":{},"iteration":{},"time":{},"chi2":{},"seconds":{},"positions":{}}})",
      frame.iteration == 0 ? "\"start\"" : fmt::format("\"iteration {}\"", frame.iteration),
      frame.iteration, json_number(frame.time), json_number(frame.chi2), json_number(frame.seconds),
      as_float ? base64(frame.positions) : packed_points_json(frame.positions, dimension));
}

std::string recording_json(const Recording& recording, int dimension) {
  const std::vector<const Frame*> frames = fitting(recording);
  std::size_t numbers = 0;
  for (const Frame* frame : frames) numbers += frame->positions.size();
  std::vector<std::string> texts;
  for (const Frame* frame : frames) {
    texts.push_back(frame_json(*frame, dimension, numbers <= kNumbersAsFloat));
  }
  return fmt::format(R"({{"name":{},"kind":"iterations","frames":[{}]}})",
                     json_string(recording.name), fmt::join(texts, ","));
}

std::string scene_json(const Scene& scene, AlbumFrames frames) {
  std::vector<std::string> estimates, runs, recordings;
  for (const SceneEstimate& estimate : scene.estimates) {
    estimates.push_back(estimate_json(estimate, scene));
  }
  if (estimates.empty()) {  // runs without their graph; the page wants one estimate
    SceneEstimate none;
    none.name = "no graph";
    none.positions.assign(scene.ids.size() * static_cast<std::size_t>(scene.dimension),
                          std::numeric_limits<double>::quiet_NaN());
    estimates.push_back(estimate_json(none, scene));
  }
  for (const SceneRun& run : scene.runs) runs.push_back(run_json(run));
  if (frames == AlbumFrames::all) {
    for (const Recording& recording : scene.recordings)
      recordings.push_back(recording_json(recording, scene.dimension));
  }
  return fmt::format(R"({{"name":{},{},"estimates":[{}],"runs":[{}],"recordings":[{}]}})",
                     json_string(scene.name), structure_json(scene), fmt::join(estimates, ","),
                     fmt::join(runs, ","), fmt::join(recordings, ","));
}

/// Notes of the album, and of what had to be left out of it.
std::string notes_json(const Album& album) {
  std::vector<std::string> notes;
  for (const std::string& note : album.notes) notes.push_back(json_string(note));
  for (const Scene& scene : album.scenes) {
    for (const Recording& recording : scene.recordings) {
      const std::size_t shown = fitting(recording).size();
      if (shown == recording.frames.size()) continue;
      notes.push_back(json_string(
          fmt::format("{}: {} of {} recorded iterations are shown, to keep the file small",
                      recording.name, shown, recording.frames.size())));
    }
  }
  return fmt::format("[{}]", fmt::join(notes, ","));
}

std::string table_json(const NumberTable& table) {
  std::vector<std::string> columns;
  for (const NumberTable::Column& column : table.columns) {
    std::vector<std::string> values;
    for (const double value : column.values) values.push_back(json_number(value));
    columns.push_back(fmt::format(R"({{"name":{},"values":[{}]}})", json_string(column.name),
                                  fmt::join(values, ",")));
  }
  return fmt::format(R"({{"name":{},"columns":[{}]}})", json_string(table.name),
                     fmt::join(columns, ","));
}

template <class Part, class Json>
std::string list_json(const std::vector<Part>& parts, Json json) {
  std::vector<std::string> texts;
  for (const Part& part : parts) texts.push_back(json(part));
  return fmt::format("[{}]", fmt::join(texts, ","));
}

}  // namespace

std::string album_json(const Album& album, AlbumFrames frames) {
  std::string text =
      fmt::format(R"({{"format":"cairn-report","version":1,"kind":"{}","cairn":"{}","title":{},)",
                  album.bench.empty() ? "view" : "bench", CAIRN_VERSION, json_string(album.title));
  const auto member = [&](const char* name, const std::string& json) {
    if (!json.empty()) text += fmt::format(R"("{}":{},)", name, embeddable_json(json));
  };
  member("command", album.command.empty() ? "" : json_string(album.command));
  member("created", album.created.empty() ? "" : json_string(album.created));
  member("machine", album.machine);
  member("build", album.build);
  member("bench", album.bench);
  if (!album.tables.empty()) text += R"("tables":)" + list_json(album.tables, table_json) + ",";
  text += R"("notes":)" + notes_json(album);
  text += R"(,"graphs":)" +
          list_json(album.scenes, [&](const Scene& scene) { return scene_json(scene, frames); });
  text += R"(,"explorations":)" + list_json(album.explorations, embeddable_json);
  return text + "}";
}

}  // namespace cairn
