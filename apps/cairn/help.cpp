// SPDX-License-Identifier: BSD-3-Clause
#include "help.hpp"

#include <vector>

#include <fmt/core.h>

#include "cairn/program/table.hpp"
#include "option_parser.hpp"

namespace cairn::app {
namespace {

/// "-o, --output FILE"; a positional is shown by its placeholder alone.
std::string left_column(const OptionSpec& option) {
  if (option.form.positional) return value_name(option);
  const std::string letter = short_name(option);
  const std::string names = (letter.empty() ? "" : letter + ", ") + long_name(option);
  return is_flag(option) ? names : names + " " + value_name(option);
}

std::string right_column(const OptionSpec& option) {
  const std::string value = shown_default(option);
  return value.empty() ? option.help : fmt::format("{} [{}]", option.help, value);
}

Table two_columns() { return Table({{"", Table::Align::left}, {"", Table::Align::left}}, "  "); }

std::string option_lines(const Program& program, const CommandEntry& command) {
  Table lines = two_columns();
  const auto add = [&](const OptionSpec& option) {
    lines.add({left_column(option), right_column(option)});
  };
  for (const OptionSpec& option : command.options()) {
    if (option.form.positional) add(option);
  }
  if (program.is_self(command)) {
    add(help_flag());
    add(version_flag());
  }
  for (const OptionSpec& option : command.options()) {
    if (!option.form.positional) add(option);
  }
  return lines.text(false);
}

std::string command_lines(const std::vector<const CommandEntry*>& commands) {
  Table lines = two_columns();
  for (const CommandEntry* command : commands) lines.add({own_name(*command), command->summary()});
  return lines.text(false);
}

/// On one line or two: what every command takes.
std::string common_options(const Program& program) {
  std::string line = "Also:";
  for (const OptionSpec& option : program.self.options()) line += " [" + left_column(option) + "]";
  return line + "\n      (what every command takes; see cairn --help)\n";
}

}  // namespace

std::string usage_line(const CommandEntry& command) {
  std::string text = full_name(command) + " [OPTIONS]";
  for (const OptionSpec& option : command.options()) {
    if (!option.form.positional) continue;
    const std::string word = value_name(option);
    text += " " + (option.form.required ? word : "[" + word + "]");
    if (option.list) text += "...";
  }
  for (const OptionSpec& option : command.options()) {
    if (option.form.positional || !option.form.required) continue;
    const std::string letter = short_name(option);
    text += fmt::format(" {} {}", letter.empty() ? long_name(option) : letter, value_name(option));
  }
  return text;
}

std::string help_text(const Program& program, const CommandEntry& command) {
  const std::vector<const CommandEntry*> commands = program.below(command);
  const bool is_program = program.is_self(command);
  std::string text = is_program ? "" : full_name(command) + ": ";
  text += command.summary() + "\n\nUsage: " +
          (commands.empty() ? usage_line(command) : full_name(command) + " COMMAND [OPTIONS]") +
          "\n\n";
  if (!commands.empty()) text += "Commands:\n" + command_lines(commands);
  if (is_program) text += "\nOptions of every command:\n";
  text += option_lines(program, command);
  if (!is_program) text += "\n" + common_options(program);
  return text + "\n" + command.footer() + "\n";
}

}  // namespace cairn::app
