// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/report/scene.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/solve/optimizer.hpp"

namespace cairn {

/// Writes where the variables are after each iteration of an optimisation, to a file of JSON lines
/// (docs/recording.md): give it to the optimizer as observer, then call `finish`.
///
/// Every iteration has a line with its numbers. Positions stand in every accepted one up to about
/// 32 MB, then in every second up to twice as many iterations, every fourth up to four times as
/// many …; and always in the last. The file is written beside its name as the run goes
/// (`OutputFile`) and gets that name in `finish`; a run that is killed leaves what it had in
/// FILE.PID-0.part. A name that ends in .gz is not packed.
class CAIRN_API RecordingWriter : public Observer {
 public:
  /// Opens the file, throwing `Error` (input) if it cannot be written. `next`, unless null, is
  /// notified as well. `name`: what is recorded, such as the optimizer's name.
  RecordingWriter(const std::filesystem::path& file, std::string name, std::string graph_file,
                  Observer* next = nullptr);
  ~RecordingWriter() override;

  void on_start(const Graph& graph, double chi2) override;
  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values) override;
  void on_message(std::string_view message) override;

  /// The graph as the optimizer left it, and the optimizer's summary. Throws `Error` (input) if
  /// something could not be written (a full disk).
  void finish(const Graph& graph, const Summary& summary);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether the beginning of a file is the header of a recording.
CAIRN_API bool is_recording(std::string_view head);

/// Reads a recording: a `Scene` with the graph's structure, the snapshots, the first and the last
/// of them as estimates (initial and estimate), and the run. A last line that was cut short is left
/// out. Throws `Error` (input) with `name` and line for what is damaged.
CAIRN_API Scene read_recording(std::string_view text, const std::string& name);

}  // namespace cairn
