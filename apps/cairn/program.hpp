// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

// The commands that are about all commands, and so the program's own.
inline constexpr const char* kHelp = "help";
inline constexpr const char* kComplete = "complete";

/// The program or one of its commands. What its help says is asked for when it is needed, since a
/// plugin is loaded for that.
class CommandEntry {
 public:
  /// A command that is found by name.
  CommandEntry(std::string name, Session& session) : name_(std::move(name)), session_(&session) {}
  /// One of which all is known: the program's own.
  CommandEntry(std::string name, std::string summary, std::string footer, OptionTable options)
      : name_(std::move(name)),
        summary_(std::move(summary)),
        footer_(std::move(footer)),
        options_(std::move(options)) {}

  /// One word, or two of a command of a command; empty of the program.
  const std::string& name() const { return name_; }
  /// One line.
  const std::string& summary() const;
  /// Below the options in its help; examples after a line "Example:".
  const std::string& footer() const;
  const OptionTable& table() const;
  const std::vector<OptionSpec>& options() const { return table().specs(); }

  /// Without asking again, for those who list many.
  void set_summary(std::string summary) { summary_ = std::move(summary); }

 private:
  std::string name_;
  Session* session_ = nullptr;  // null: the program's own
  mutable std::optional<std::string> summary_, footer_;
  mutable std::optional<OptionTable> options_;
};

/// The program with its commands.
struct Program {
  CommandEntry self;  ///< its options are those that every command takes
  std::vector<CommandEntry> commands;

  /// The command of that name, or null.
  const CommandEntry* find(std::string_view name) const;
  /// The commands of a command ("study" has "study compact"), or of the program.
  std::vector<const CommandEntry*> below(const CommandEntry& command) const;
  bool is_self(const CommandEntry& command) const { return &command == &self; }
};

/// The commands on offer, by name; those whose names no command line can have are left out. Only
/// the command `first` and those that it has, if there is one of that name.
std::vector<CommandEntry> commands_on_offer(std::string_view first, Session& session);

/// "cairn study compact".
std::string full_name(const CommandEntry& command);
/// "compact" of it.
std::string own_name(const CommandEntry& command);

/// The flags that ask for the help and for the version, which are in no table.
const OptionSpec& help_flag();
const OptionSpec& version_flag();

/// What may be given to a command besides `--help`: its own options, and, of a command, those that
/// every command takes.
std::vector<const OptionSpec*> all_options(const Program& program, const CommandEntry& command);

/// "-o" and "--output", as far as it has them.
std::vector<std::string> option_names(const OptionSpec& option);

}  // namespace cairn::app
