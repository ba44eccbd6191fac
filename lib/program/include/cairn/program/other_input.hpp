// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/program/session.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {

/// The body that `cairn info` looks at an input with, where that is a place and no graph.
struct BodyOptions {
  double radius = 0.2;                         ///< of a robot's body [m]
  std::optional<double> start_x{}, start_y{};  ///< [m]

  static auto fields() {
    using O = BodyOptions;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    constexpr const char* kStart = "where the robot is, instead of the widest place";
    return OptionFields<O>()
        .real("radius", &O::radius, 0.0, 1000.0, "of a robot's body on a floor [m]")
        .placeholder("R")
        .real("start_x", &O::start_x, -kAny, kAny, kStart)
        .real("start_y", &O::start_y, -kAny, kAny, kStart)
        .placeholder("Y");
  }
};

/// What may stand where commands have a graph and is none, such as the map of a floor: the subject
/// that has it offers a component of this kind. It is asked where no format of graphs and no
/// generator goes by a name.
class OtherInput : public Component {
 public:
  static constexpr std::string_view kKind = "other_input";
  /// In the word that messages have for it: "a floor".
  virtual std::string what() const = 0;
  /// Whether a file is one by its ending.
  virtual bool names_file(const std::string& file, Session& session) const = 0;
  /// Whether KIND[:k=v] generates one.
  virtual bool generates(const std::string& kind, Session& session) const = 0;
  /// What to throw (input) where an existing file was refused as a graph: it may be one all the
  /// same.
  virtual Error no_graph(const std::string& file, const Error& refusal, Session& session) const = 0;
  /// `cairn info` of one: the exit code.
  virtual int info(const std::string& name, const BodyOptions& options, Session& session) const = 0;
  /// `cairn generate` of one: the exit code.
  virtual int generate(const std::string& kind, std::uint64_t seed, const std::string& output,
                       Session& session) const = 0;
};

/// What a name stands for, a file or "@KIND", if that is no graph; else null.
std::unique_ptr<OtherInput> other_input(const std::string& name, Session& session);

/// What to throw (input) where a file was refused as a graph: it may be something else.
Error no_graph(const std::string& file, const Error& refusal, Session& session);

}  // namespace cairn::app
