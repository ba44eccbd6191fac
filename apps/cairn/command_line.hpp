// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "commands.hpp"

namespace cairn::app {

/// The whole command line: the program, its subcommands and their options.
class CommandLine {
 public:
  explicit CommandLine(Session& session);

  /// Parses, and returns what to run. Help and version are a run too. Throws `Error` (usage) for
  /// what cannot be understood, with the nearest spelling.
  std::function<int()> parse(int argc, const char* const* argv);

 private:
  /// What `cairn help` and `cairn help COMMAND` print.
  std::string explanation() const;

  Session& session_;
  ProgramParser program_;
  std::vector<Command> commands_;
  ArgumentParser help_;  // of the command `help`
  std::string command_to_explain_;
};

}  // namespace cairn::app
