// SPDX-License-Identifier: BSD-3-Clause
#include "help.hpp"

#include <optional>
#include <vector>

#include <fmt/core.h>

#include "table.hpp"

namespace cairn::app {
namespace {

/// "-o, --output FILE"; a positional is shown by its type's name alone.
std::string left_column(const Argument& option) {
  if (option.is_positional()) return option.type_name();
  std::string names;
  for (const std::string& name : option.short_names()) names += "-" + name + ", ";
  for (const std::string& name : option.long_names()) names += "--" + name + ", ";
  names.resize(names.size() - 2);
  const bool takes_value = option.most_values() > 0;
  return takes_value ? names + " " + option.type_name() : names;
}

std::string right_column(const Argument& option) {
  const std::string value = option.default_text();
  return value.empty() ? option.description() : fmt::format("{} [{}]", option.description(), value);
}

Table two_columns() { return Table({{"", Table::Align::left}, {"", Table::Align::left}}, "  "); }

std::string option_lines(const std::vector<Argument>& options) {
  Table lines = two_columns();
  for (const bool positional : {true, false}) {
    for (const Argument& option : options) {
      if (option.is_positional() == positional)
        lines.add({left_column(option), right_column(option)});
    }
  }
  return lines.text(false);
}

std::string command_lines(const ArgumentParser& parser) {
  Table lines = two_columns();
  for (const ArgumentParser& command : parser.commands())
    lines.add({command.name(), command.description()});
  return lines.text(false);
}

/// On one line or two: what every command takes.
std::string common_options(const ArgumentParser& program) {
  std::string line = "Also:";
  for (const Argument& option : program.arguments_but_help())
    line += " [" + left_column(option) + "]";
  return line + "\n      (what every command takes; see cairn --help)\n";
}

ArgumentParser program_of(const ArgumentParser& command) {
  const std::optional<ArgumentParser> parent = command.parent();
  return parent ? program_of(*parent) : command;
}

}  // namespace

std::string command_name(const ArgumentParser& command) {
  const std::optional<ArgumentParser> parent = command.parent();
  return parent ? command_name(*parent) + " " + command.name() : "cairn";
}

std::string usage_line(const ArgumentParser& command) {
  const std::vector<Argument> arguments = command.arguments();
  std::string text = command_name(command) + " [OPTIONS]";
  for (const Argument& argument : arguments) {
    if (!argument.is_positional()) continue;
    const std::string word = argument.type_name();
    text += " " + (argument.is_required() ? word : "[" + word + "]");
    if (argument.most_values() > 1) text += "...";
  }
  for (const Argument& option : arguments) {
    if (option.is_positional() || !option.is_required()) continue;
    const bool is_short = !option.short_names().empty();
    text += fmt::format(" {}{} {}", is_short ? "-" : "--",
                        is_short ? option.short_names().front() : option.long_names().front(),
                        option.type_name());
  }
  return text;
}

std::string help_text(const ArgumentParser& command) {
  const bool has_commands = !command.commands().empty();
  const bool is_program = !command.parent();
  std::string text = is_program ? "" : command_name(command) + ": ";
  text += command.description() + "\n\nUsage: " +
          (has_commands ? command_name(command) + " COMMAND [OPTIONS]" : usage_line(command)) +
          "\n\n";
  if (has_commands) text += "Commands:\n" + command_lines(command);
  if (has_commands && is_program) text += "\nOptions of every command:\n";
  text +=
      option_lines(has_commands && is_program ? command.arguments() : command.arguments_but_help());
  if (!is_program) text += "\n" + common_options(program_of(command));
  return text + "\n" + command.footer() + "\n";
}

}  // namespace cairn::app
