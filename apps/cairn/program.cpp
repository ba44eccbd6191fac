// SPDX-License-Identifier: BSD-3-Clause
#include "program.hpp"

#include <algorithm>

#include "option_parser.hpp"

namespace cairn::app {

const Command* Program::find(std::string_view name) const {
  const auto found = std::ranges::find(commands, name, &Command::name);
  return found == commands.end() ? nullptr : &*found;
}

std::vector<const Command*> Program::below(const Command& command) const {
  std::vector<const Command*> result;
  for (const Command& each : commands) {
    const bool is_of_command = each.name.find(' ') != std::string::npos;
    if (is_self(command) ? !is_of_command : each.name.starts_with(command.name + " "))
      result.push_back(&each);
  }
  return result;
}

std::string full_name(const Command& command) {
  return command.name.empty() ? "cairn" : "cairn " + command.name;
}

std::string own_name(const Command& command) {
  return command.name.substr(command.name.find(' ') + 1);
}

const OptionSpec& help_flag() {
  static const OptionSpec flag{.name = "help",
                               .type = OptionType::boolean,
                               .default_value = "false",
                               .help = "this text, or with a command, that of the command",
                               .form = {.placeholder = {}, .letter = 'h'}};
  return flag;
}

const OptionSpec& version_flag() {
  static const OptionSpec flag{.name = "version",
                               .type = OptionType::boolean,
                               .default_value = "false",
                               .help = "the version"};
  return flag;
}

std::vector<const OptionSpec*> all_options(const Program& program, const Command& command) {
  std::vector<const OptionSpec*> all;
  for (const OptionSpec& option : command.options.specs()) all.push_back(&option);
  if (program.is_self(command)) return all;
  for (const OptionSpec& option : program.self.options.specs()) all.push_back(&option);
  return all;
}

std::vector<std::string> option_names(const OptionSpec& option) {
  std::vector<std::string> names;
  for (std::string name : {long_name(option), short_name(option)}) {
    if (!name.empty()) names.push_back(std::move(name));
  }
  return names;
}

}  // namespace cairn::app
