// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

// CLI11 is all headers, and takes seconds to compile: only arguments.cpp, command_line.cpp and
// help.cpp include it.
namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace cairn::app {

/// An argument or option of a command, to be described further: each function returns it again. A
/// handle, valid as long as the program's parser.
class Argument {
 public:
  explicit Argument(CLI::Option& option) : option_(&option) {}

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

  // What a value must be. A refusal says what is expected: "'many' is no whole number from 0 to
  // 1024". None of them shows in the help, whose first column must stay narrow.
  Argument& within(int low, int high);
  Argument& within(double low, double high);
  Argument& within(std::uint64_t low, std::uint64_t high);
  Argument& one_of(std::vector<std::string> choices);
  /// A finite number of seconds.
  Argument& seconds_from(double least);

 private:
  CLI::Option* option_;
};

/// The parser of the program's command line, or of that of one of its commands, to which arguments,
/// options and commands are added. A handle, valid as long as the program's parser.
class ArgumentParser {
 public:
  explicit ArgumentParser(CLI::App& app) : app_(&app) {}

  ArgumentParser add_command(const std::string& name, const std::string& description);

  /// Adds an option ("-o,--output"), or an argument ("graph"), which is told from others by where
  /// it stands. Parsing writes to `value`, which must live as long; without the option it stays.
  Argument add_option(const std::string& names, std::string& value, const std::string& help);
  Argument add_option(const std::string& names, std::vector<std::string>& value,
                      const std::string& help);
  Argument add_option(const std::string& names, int& value, const std::string& help);
  Argument add_option(const std::string& names, double& value, const std::string& help);
  Argument add_option(const std::string& names, std::uint64_t& value, const std::string& help);
  Argument add_option(const std::string& names, std::optional<double>& value,
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

 private:
  CLI::App* app_;
};

}  // namespace cairn::app
