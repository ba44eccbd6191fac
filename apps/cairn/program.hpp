// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "command.hpp"

namespace cairn::app {

/// The program with its commands, or with those of them that a command line may mean.
struct Program {
  Command self;  ///< without a name; its options are those that every command takes
  std::vector<Command> commands;

  /// The command of that name, or null.
  const Command* find(std::string_view name) const;
  /// The commands of a command ("study" has "study compact"), or of the program.
  std::vector<const Command*> below(const Command& command) const;
  bool is_self(const Command& command) const { return &command == &self; }
};

/// "cairn study compact".
std::string full_name(const Command& command);
/// "compact" of it.
std::string own_name(const Command& command);

/// The flags that ask for the help and for the version, which are in no table.
const OptionSpec& help_flag();
const OptionSpec& version_flag();

/// What may be given to a command besides `--help`: its own options, and, of a command, those that
/// every command takes.
std::vector<const OptionSpec*> all_options(const Program& program, const Command& command);

/// "-o" and "--output", as far as it has them.
std::vector<std::string> option_names(const OptionSpec& option);

}  // namespace cairn::app
