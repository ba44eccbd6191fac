// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "cairn/plugin/option_fields.hpp"
#include "session.hpp"

namespace cairn::app {

/// A command of the program: what its help, manual page and completion are made of, how its words
/// are understood, and what it does. All of its options stand in one table, that of the `fields()`
/// of their struct.
struct Command {
  std::string name;     ///< of one word, or two where the first has commands of its own
  std::string summary;  ///< one line
  std::string remarks;  ///< below the options in its help; examples after a line "Example:"
  OptionTable options;
  /// Does it; returns the program's exit code, or throws `Error`. Empty of what only has commands
  /// of its own.
  std::function<int(const Options&, Session&)> run = {};
};

/// The largest seed: that of components.
inline constexpr double kMostSeed = 1e15;

/// A command whose options are a struct.
template <OptionStruct Struct, class Run>
Command make_command(std::string name, std::string summary, std::string remarks, Run run) {
  return {.name = std::move(name),
          .summary = std::move(summary),
          .remarks = std::move(remarks),
          .options = Struct::fields().table(),
          .run = [run](const Options& options, Session& session) {
            return run(Struct::fields().read(options), session);
          }};
}

}  // namespace cairn::app
