// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/plugin/options.hpp"
#include "program.hpp"

namespace cairn::app {

// An option as words name it -------------------------------------------------------------------

/// "--ground-truth", and "" of what is known by its place alone.
std::string long_name(const OptionSpec& option);
/// "-o", or "".
std::string short_name(const OptionSpec& option);
/// What stands for its value in the help: its placeholder, or what its type is called.
std::string value_name(const OptionSpec& option);
/// Whether it is a flag: it stands without a value.
inline bool is_flag(const OptionSpec& option) { return option.type == OptionType::boolean; }
/// Its default as the help shows it; empty: none is shown.
std::string shown_default(const OptionSpec& option);

/// Whether a word names a file of options.
inline bool is_config_option(std::string_view word) {
  return word == "--config" || word.starts_with("--config=");
}

/// How a command line was understood, or what kept it from being so.
struct ParseOutcome {
  enum class Kind {
    command,        ///< to be run
    nothing,        ///< no command was given
    help,           ///< asked for
    version,        ///< asked for
    config_key,     ///< the configuration file has a key that is no option
    config_file,    ///< it cannot be read
    unknown_words,  ///< of the command line, which belong to nothing
    missing,        ///< an argument or option of a command that must be given
    without_value,  ///< an option that needs a value stands without one
    repeated,       ///< an option has more values than it takes
    bad_value       ///< a value of the wrong type, or refused
  };
  Kind kind = Kind::command;
  std::string message;             ///< CLI11's
  std::vector<std::string> words;  ///< the unknown ones

  const CommandEntry* command = nullptr;  ///< the innermost that the command line names, if any
  OptionValues values;                    ///< of its options, those that were given
  OptionValues common;                    ///< the same of those of every command
  std::string config_file;                ///< that was read; empty if there was none
};

/// Parses a command line: options of every command (`common`), which may stand before or after the
/// command, and those of the command, from words or from a file in TOML, which the common option
/// `config` names. `words`: the program's name, and what was typed after it. Of commands that the
/// words cannot mean the options are not asked for.
ParseOutcome parse_command_line(const OptionTable& common, std::span<const CommandEntry> commands,
                                std::span<const char* const> words);

}  // namespace cairn::app
