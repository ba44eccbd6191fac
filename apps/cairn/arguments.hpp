// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

// CLI11 is all headers and takes seconds to compile: only arguments.cpp includes it.
namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cairn::app {

/// What may stand for the value of an argument, for those who complete it.
struct ValueWords {
  bool any_text = false;                ///< a number or a text: nothing is known of it
  std::vector<std::string> choices;     ///< one of these
  bool component = false;               ///< the name of a component…
  std::vector<std::string> kinds;       ///< …of one of these kinds; empty: of any
  bool list = false;                    ///< several of them, A,B
  std::vector<std::string> generators;  ///< @NAME of one of these kinds stands for a file
};

/// Of all options: what CLI11 does not know of them.
using OptionWords = std::map<const CLI::Option*, ValueWords>;

/// An argument or option of a command. What describes it further returns it again. A handle, valid
/// as long as the program's parser.
class Argument {
 public:
  Argument(CLI::Option& option, ValueWords& words) : option_(&option), words_(&words) {}

  /// What stands for its value in the help, such as FILE.
  Argument& type_name(const std::string& name);
  /// Replaces the line of help.
  Argument& description(const std::string& text);
  /// Shows a default in the help: the value that the variable has now, or a text.
  Argument& show_default();
  Argument& show_default(const std::string& text);

  /// It must be given.
  Argument& required();
  /// Given repeatedly, with one value each time; else one option takes all words that follow.
  Argument& repeatable();
  /// One word may hold several values.
  Argument& separated_by(char delimiter);

  // What a value must be. A refusal says what is expected: "'many' is not an integer from 0 to
  // 1024". None of them shows in the help, whose first column must stay narrow.
  Argument& within(int low, int high);
  /// 0, which stands for no limit, or an integer within.
  Argument& none_or_within(int low, int high);
  Argument& within(double low, double high);
  Argument& one_of(std::vector<std::string> choices);
  /// Not checked: what is offered where the value is completed.
  Argument& suggest(std::vector<std::string> choices);
  /// The name of a component of one of these kinds, which may have options: NAME:key=value. Not
  /// checked. Sets the type name to NAME.
  Argument& component(std::vector<std::string> kinds);
  /// Of several components, A,B. Sets the type name to NAMES.
  Argument& components(std::vector<std::string> kinds);
  /// A file, or @NAME of a component of one of these kinds.
  Argument& file_or_generated(std::vector<std::string> kinds);
  /// A finite number of seconds.
  Argument& seconds_from(double least);

  // For the help and for errors.
  std::string name() const;                      ///< "--output", or "graph" of a positional one
  std::vector<std::string> short_names() const;  ///< "o"
  std::vector<std::string> long_names() const;   ///< "output"
  std::string type_name() const;
  std::string description() const;
  std::string default_text() const;  ///< empty: none is shown
  bool is_positional() const;        ///< known by where it stands, not by a name
  bool is_required() const;
  int most_values() const;  ///< 0 of a flag
  const ValueWords& words() const { return *words_; }

 private:
  CLI::Option* option_;
  ValueWords* words_;
};

/// The parser of the program's command line, or of that of one of its commands, to which arguments,
/// options and commands are added. A handle, valid as long as the program's parser.
class ArgumentParser {
 public:
  ArgumentParser(CLI::App& app, OptionWords& words) : app_(&app), words_(&words) {}

  ArgumentParser add_command(const std::string& name, const std::string& description);

  /// Adds an option ("-o,--output"), or a positional argument ("graph"). Parsing writes to `value`,
  /// which must live as long; where it is not given the value stays. An empty word is refused.
  Argument add_option(const std::string& names, std::string& value, const std::string& help);
  Argument add_option(const std::string& names, std::vector<std::string>& value,
                      const std::string& help);
  Argument add_option(const std::string& names, int& value, const std::string& help);
  Argument add_option(const std::string& names, double& value, const std::string& help);
  Argument add_option(const std::string& names, std::uint64_t& value, const std::string& help);
  Argument add_option(const std::string& names, std::optional<double>& value,
                      const std::string& help);
  Argument add_option(const std::string& names, std::optional<std::int64_t>& value,
                      const std::string& help);
  /// An option without a value.
  void add_flag(const std::string& names, bool& value, const std::string& help);

  /// The option of that name. Precondition: it has been added.
  Argument option(const std::string& name) const;

  /// The text below the options in the help.
  void footer(const std::string& text);
  /// One of its commands must be given.
  void require_command();
  /// Whether the command was on the command line.
  bool parsed() const;

  // For the help and for errors.
  std::string name() const;
  std::string description() const;
  std::string footer() const;
  std::optional<ArgumentParser> parent() const;  ///< nothing of the program itself
  std::vector<ArgumentParser> commands() const;  ///< in the order in which they were added
  std::vector<Argument> arguments() const;       ///< in the order in which they were added
  /// Of these, all but those that ask for the help or the version.
  std::vector<Argument> arguments_but_help() const;

 private:
  Argument argument(CLI::Option& option) const;
  Argument number(CLI::Option& option) const;

  CLI::App* app_;
  OptionWords* words_;
};

/// How a command line was understood, or what kept it from being so.
struct ParseOutcome {
  enum class Kind {
    command,        ///< to be run
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
};

/// The parser of the whole command line. Common options may stand before or after the command.
class ProgramParser {
 public:
  ProgramParser(const std::string& name, const std::string& description);
  ~ProgramParser();

  ArgumentParser root() { return {*app_, *words_}; }
  /// The flags that ask for the help (also of each command that is added later) and the version.
  void add_help(const std::string& names, const std::string& help);
  void add_version(const std::string& names, const std::string& text, const std::string& help);
  /// The option that names a file of options, in TOML.
  Argument add_config(const std::string& names, const std::string& help);

  ParseOutcome parse(int argc, const char* const* argv);
  /// The file of options that was read; empty if there was none.
  std::string config_file() const;
  /// The innermost command that the command line names, if any.
  std::optional<ArgumentParser> chosen();

 private:
  std::unique_ptr<CLI::App> app_;
  std::unique_ptr<OptionWords> words_;
};

}  // namespace cairn::app
