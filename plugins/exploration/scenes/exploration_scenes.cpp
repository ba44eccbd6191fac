// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/exploration/recording.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/report/scene_source.hpp"

namespace {

using namespace cairn;

class ExplorationScenes final : public SceneSource {
 public:
  bool knows(std::string_view head) const override { return is_exploration_recording(head); }

  /// To the page and to maps whole, to other plots its curves.
  void add(const std::string& file, const std::string& name, std::string_view text,
           const Wanted& wanted, AlbumBuilder& album) const override {
    ExplorationRecording recording = read_exploration_recording(text, file);
    std::vector<std::string> notes;
    if (recording.torn) notes.push_back(fmt::format("{}: the last line was cut short", file));
    if (!recording.ended)
      notes.push_back(fmt::format("{}: the run was killed, or goes on: it has no last line", file));
    if (wanted.whole) {
      const std::size_t most =
          wanted.most_bytes > 0 ? wanted.most_bytes : std::numeric_limits<std::size_t>::max();
      album.add_exploration(exploration_json(recording, name, most, notes));
    } else {
      album.add_table(std::move(recording.steps), name);
    }
    for (const std::string& note : notes) album.add_note(note);
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<SceneSource>("exploration", {}, [](const Options&, Registry&) {
    return std::make_unique<ExplorationScenes>();
  });
}
