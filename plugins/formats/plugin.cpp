// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/io/format.hpp"
#include "cairn/io/trajectory_writer.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "detect.hpp"
#include "readers.hpp"
#include "writers.hpp"

namespace {

using namespace cairn;
using namespace cairn::formats;

/// What makes one text format: plain functions.
struct TextFormatParts {
  std::string name;
  std::vector<std::string> extensions;
  int Likelihood::*likelihood;
  decltype(&read_g2o) read;
  decltype(&write_g2o) write;  ///< null if the format only reads, or writes poses alone
  decltype(&write_tum) write_poses = nullptr;
};

class TextFormat final : public Format, public TrajectoryWriter {
 public:
  explicit TextFormat(TextFormatParts parts) : parts_(std::move(parts)) {}

  bool can_read() const override { return true; }
  bool can_write() const override { return parts_.write || parts_.write_poses; }
  std::vector<std::string> extensions() const override { return parts_.extensions; }
  int detect(std::string_view head) const override { return look_at(head).*parts_.likelihood; }
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    report.format = parts_.name;
    return parts_.read(text, name, types, options, report);
  }
  void* ability(std::string_view name) override {
    return name == TrajectoryWriter::kAbility && parts_.write_poses
               ? static_cast<TrajectoryWriter*>(this)
               : nullptr;
  }
  std::string write_poses(const Graph& graph, std::span<const double> stamps) override {
    return parts_.write_poses(graph, stamps);
  }
  std::string write(const Graph& graph) override {
    if (parts_.write_poses) return parts_.write_poses(graph, {});
    if (!parts_.write)
      throw Error(ErrorCode::usage, fmt::format("format {} only reads", parts_.name));
    return parts_.write(graph);
  }

 private:
  TextFormatParts parts_;
};

}  // namespace

void cairn_register(Registrar& registrar) {
  const std::vector<TextFormatParts> all = {
      {"g2o", {"g2o"}, &Likelihood::g2o, read_g2o, write_g2o},
      {"toro", {"graph", "toro"}, &Likelihood::toro, read_toro, write_toro},
      {"isam", {"isam", "txt"}, &Likelihood::isam, read_isam, nullptr},
      {"bal", {"bal"}, &Likelihood::bal, read_bal, write_bal},
      {"pyfg", {"pyfg"}, &Likelihood::pyfg, read_pyfg, nullptr},
      {"tum", {"tum"}, &Likelihood::tum, read_tum, nullptr, write_tum},
      {"euroc", {"csv"}, &Likelihood::euroc, read_euroc, nullptr},
      {"kitti", {"kitti"}, &Likelihood::kitti, read_kitti, nullptr, write_kitti},
      {"table", {"dat"}, &Likelihood::table, read_table, nullptr},
  };
  for (const TextFormatParts& parts : all) {
    registrar.add<Format>(parts.name, OptionTable{}, [parts](const Options&, Registry&) {
      return std::make_unique<TextFormat>(parts);
    });
  }
  registrar.add<StreamFormat>("g2o", OptionTable{},
                              [](const Options&, Registry&) { return make_g2o_stream(); });
}
