// SPDX-License-Identifier: BSD-3-Clause
#include "help.hpp"

#include <fmt/format.h>

#include "table.hpp"

namespace cairn::app {
namespace {

/// "-o, --output FILE"; a positional is shown by its type's name alone.
std::string left_column(const CLI::Option& option) {
  if (option.get_positional()) return option.get_type_name();
  std::string names;
  for (const std::string& name : option.get_snames()) names += "-" + name + ", ";
  for (const std::string& name : option.get_lnames()) names += "--" + name + ", ";
  names.resize(names.size() - 2);
  const bool takes_value = option.get_items_expected_max() > 0;
  return takes_value ? names + " " + option.get_type_name() : names;
}

std::string right_column(const CLI::Option& option) {
  const std::string value = option.get_default_str();
  return value.empty() ? option.get_description()
                       : fmt::format("{} [{}]", option.get_description(), value);
}

Table two_columns() { return Table({{"", Table::Align::left}, {"", Table::Align::left}}, "  "); }

std::string option_lines(const CLI::App& app, bool with_help) {
  Table lines = two_columns();
  for (const bool positional : {true, false}) {
    for (const CLI::Option* option : app.get_options()) {
      if (option->get_positional() != positional) continue;
      if (!with_help && (option == app.get_help_ptr() || option == app.get_version_ptr())) continue;
      lines.add({left_column(*option), right_column(*option)});
    }
  }
  return lines.text(false);
}

std::string command_lines(const CLI::App& app) {
  Table lines = two_columns();
  for (const CLI::App* command : app.get_subcommands({})) {
    lines.add({command->get_name(), command->get_description()});
  }
  return lines.text(false);
}

/// On one line or two: what every command takes.
std::string common_options(const CLI::App& program) {
  std::string line = "Also:";
  for (const CLI::Option* option : program.get_options()) {
    if (option == program.get_help_ptr() || option == program.get_version_ptr()) continue;
    line += " [" + left_column(*option) + "]";
  }
  return line + "\n      (what every command takes; see cairn --help)\n";
}

}  // namespace

std::string command_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent ? command_name(*parent) + " " + command.get_name() : "cairn";
}

std::string usage_line(const CLI::App& command) {
  std::string text = command_name(command) + " [OPTIONS]";
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional()) continue;
    const std::string word = option->get_type_name();
    text += " " + (option->get_required() ? word : "[" + word + "]");
    if (option->get_items_expected_max() > 1) text += "...";
  }
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional() || !option->get_required()) continue;
    const bool is_short = !option->get_snames().empty();
    text += fmt::format(" {}{} {}", is_short ? "-" : "--",
                        is_short ? option->get_snames().front() : option->get_lnames().front(),
                        option->get_type_name());
  }
  return text;
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string /*name*/,
                                     CLI::AppFormatMode /*mode*/) const {
  const bool has_commands = !app->get_subcommands({}).empty();
  const CLI::App* program = app->get_parent();
  std::string text = program ? command_name(*app) + ": " : "";
  text += app->get_description() + "\n\nUsage: " +
          (has_commands ? command_name(*app) + " COMMAND [OPTIONS]" : usage_line(*app)) + "\n\n";
  if (has_commands) text += "Commands:\n" + command_lines(*app);
  if (has_commands && !program) text += "\nOptions of every command:\n";
  text += option_lines(*app, has_commands && !program);
  if (!program) return text + "\n" + app->get_footer() + "\n";
  while (program->get_parent()) program = program->get_parent();
  text += "\n" + common_options(*program);
  return text + "\n" + app->get_footer() + "\n";
}

}  // namespace cairn::app
