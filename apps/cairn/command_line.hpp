// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "commands.hpp"

namespace cairn::app {

/// What `cairn help` is to show.
struct HelpOptions {
  std::vector<std::string> command;  ///< names of a command, and of the command in it
  bool man = false;
  std::string man_pages;  ///< folder, or empty
};

/// The command line: the program, its subcommands and their options.
class CommandLine {
 public:
  /// `words`: the program's name, and what was typed after it; they outlive this.
  CommandLine(Session& session, std::span<const char* const> words);

  /// Parses, and returns what to run. Help and version are a run too. Throws `Error` (usage) for
  /// what cannot be understood, with the nearest spelling.
  std::function<int()> parse();

 private:
  /// What `cairn help` and `cairn help COMMAND` do.
  int explain();
  /// The command that `cairn help COMMAND…` names.
  ArgumentParser explained_command();
  /// What `cairn complete -- WORD…` does.
  int complete(const std::vector<std::string>& words);

  Session& session_;
  std::span<const char* const> words_;
  ProgramParser program_;
  std::vector<Command> commands_;  // those that the words may mean
  ArgumentParser help_;            // of the command `help`
  HelpOptions help_options_;
  ArgumentParser complete_;  // of the command `complete`
  std::vector<std::string> words_to_complete_;
};

}  // namespace cairn::app
