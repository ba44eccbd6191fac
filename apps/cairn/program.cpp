// SPDX-License-Identifier: BSD-3-Clause
#include "program.hpp"

#include <algorithm>
#include <memory>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/table.hpp"
#include "option_parser.hpp"

namespace cairn::app {

const std::string& CommandEntry::summary() const {
  if (!summary_) {
    for (const Offer& offer : session_->registry().offers()) {
      if (offer.kind == Command::kKind && offer.name == name_) summary_ = printable(offer.summary);
    }
  }
  return *summary_;
}

const std::string& CommandEntry::footer() const {
  if (!footer_) footer_ = session_->registry().make<Command>(ComponentSpec{name_, {}})->footer();
  return *footer_;
}

const OptionTable& CommandEntry::table() const {
  if (!options_) options_ = session_->registry().options(Command::kKind, name_);
  return *options_;
}

namespace {

/// Whether a word of a command line can be the name of a command: a-z, 0-9, - and _, and no option.
bool is_command_name(std::string_view word) {
  const auto is_letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  };
  return !word.empty() && word.front() != '-' && std::ranges::all_of(word, is_letter);
}

/// Whether that name can be one of a command beside those before it, by name: of one word, or of
/// two where the first is a command.
bool can_be_added(std::string_view name, const std::vector<CommandEntry>& before) {
  const auto is_there = [&](std::string_view other) {
    return std::ranges::find(before, other, &CommandEntry::name) != before.end();
  };
  if (name == kHelp || name == kComplete) return false;
  const std::size_t blank = name.find(' ');
  if (blank == std::string_view::npos) return is_command_name(name);
  return is_there(name.substr(0, blank)) && is_command_name(name.substr(blank + 1));
}

}  // namespace

std::vector<CommandEntry> commands_on_offer(std::string_view first, Session& session) {
  Registry& registry = session.registry();
  const bool is_one = registry.has(Command::kKind, first) && can_be_added(first, {});
  std::vector<CommandEntry> commands;
  for (const std::string& name : registry.names(Command::kKind)) {
    const bool is_of_first = name == first || name.starts_with(std::string(first) + " ");
    if ((!is_one || is_of_first) && can_be_added(name, commands))
      commands.emplace_back(name, session);
  }
  if (is_one) return commands;
  for (const Offer& offer : registry.offers()) {
    const auto entry = std::ranges::find(commands, offer.name, &CommandEntry::name);
    if (offer.kind == Command::kKind && entry != commands.end())
      entry->set_summary(printable(offer.summary));
  }
  return commands;
}

const CommandEntry* Program::find(std::string_view name) const {
  const auto found = std::ranges::find(commands, name, &CommandEntry::name);
  return found == commands.end() ? nullptr : &*found;
}

std::vector<const CommandEntry*> Program::below(const CommandEntry& command) const {
  std::vector<const CommandEntry*> result;
  for (const CommandEntry& each : commands) {
    const bool is_of_command = each.name().find(' ') != std::string::npos;
    if (is_self(command) ? !is_of_command : each.name().starts_with(command.name() + " "))
      result.push_back(&each);
  }
  return result;
}

std::string full_name(const CommandEntry& command) {
  return command.name().empty() ? "cairn" : "cairn " + command.name();
}

std::string own_name(const CommandEntry& command) {
  return command.name().substr(command.name().find(' ') + 1);
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

std::vector<const OptionSpec*> all_options(const Program& program, const CommandEntry& command) {
  std::vector<const OptionSpec*> all;
  for (const OptionSpec& option : command.options()) all.push_back(&option);
  if (program.is_self(command)) return all;
  for (const OptionSpec& option : program.self.options()) all.push_back(&option);
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
