// SPDX-License-Identifier: BSD-3-Clause
#include "command_line.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include <fmt/core.h>

#include "cairn/io/output_file.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/version.hpp"
#include "cairn/text/spelling.hpp"
#include "completion.hpp"
#include "help.hpp"
#include "manual_page.hpp"
#include "option_words.hpp"

namespace cairn::app {
namespace {

void add_common_options(ProgramParser& program, CommonOptions& common) {
  ArgumentParser cli = program.root();
  cli.add_option("--json", common.json, "write a report as JSON; - is standard output")
      .type_name("FILE");
  cli.add_option("--threads", common.threads, "threads; 0 is all cores. Never changes a result")
      .type_name("N")
      .within(0, kMostThreads);
  cli.add_option("--plugin", common.plugins, "load this plugin too (may be given repeatedly)")
      .type_name("FILE")
      .repeatable();
  cli.add_option("--types", common.types,
                 "options of types, such as slam3d:metric=g2o (repeatedly)")
      .component({"types"})
      .type_name("NAME:K=V")
      .repeatable();
  cli.add_flag("--quiet", common.quiet,
               "no progress, and no notes but those that stand in results");
  program.add_config("--config", "TOML: options above at the top, [optimize] for a command's own")
      .type_name("FILE");
}

/// A command, and what adds it with its options.
struct NamedCommand {
  std::string_view name;
  Command (*add)(ArgumentParser program);
};

constexpr std::array kCommands{NamedCommand{"info", add_info},
                               NamedCommand{"optimize", add_optimize},
                               NamedCommand{"bench", add_bench},
                               NamedCommand{"replay", add_replay},
                               NamedCommand{"online", add_online},
                               NamedCommand{"marginals", add_marginals},
                               NamedCommand{"compact", add_compact},
                               NamedCommand{"sparsify", add_sparsify},
                               NamedCommand{"evaluate", add_evaluate},
                               NamedCommand{"view", add_view},
                               NamedCommand{"plot", add_plot},
                               NamedCommand{"convert", add_convert},
                               NamedCommand{"generate", add_generate},
                               NamedCommand{"explore", add_explore},
                               NamedCommand{"map", add_map},
                               NamedCommand{"plugins", add_plugins},
                               NamedCommand{"new-plugin", add_new_plugin},
                               NamedCommand{"study", add_study}};

/// The commands that are needed to understand a line: the one that it begins with, or all. To build
/// the options of all takes longer than to read a small graph.
std::span<const NamedCommand> needed_commands(std::span<const char* const> words) {
  const std::span<const NamedCommand> all(kCommands);
  if (words.size() == 1 && words.front() == std::string_view("--version")) return {};
  const auto is_config = [](std::string_view word) { return word.starts_with("--config"); };
  if (words.empty() || std::ranges::any_of(words, is_config)) return all;  // with sections for any
  const auto first = std::ranges::find(all, std::string_view(words.front()), &NamedCommand::name);
  return first == all.end() ? all : all.subspan(static_cast<std::size_t>(first - all.begin()), 1);
}

/// "--iterations" of "--iterations=5".
std::string bare_option(const std::string& word) { return word.substr(0, word.find('=')); }

bool looks_like_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

/// What may be given to the command, if there is one, and to every command.
std::vector<Argument> options_of(const ArgumentParser& program,
                                 const std::optional<ArgumentParser>& command) {
  std::vector<Argument> all;
  if (command) all = command->arguments();
  const std::vector<Argument> common = program.arguments();
  all.insert(all.end(), common.begin(), common.end());
  return all;
}

std::vector<std::string> option_names(const std::vector<Argument>& options) {
  std::vector<std::string> names{"--help"};
  for (const Argument& option : options) {
    for (const std::string& name : option.long_names()) names.push_back("--" + name);
    for (const std::string& name : option.short_names()) names.push_back("-" + name);
  }
  return names;
}

/// The nearest option if there is one; not all of them, which --help shows better.
std::string suggestion(const std::string& word, const std::vector<std::string>& candidates) {
  if (word.size() <= 2) return "";  // "-o" is no misspelt "-h"
  // What begins with it, such as --keep-every for --keep, before what is spelt like it.
  const auto begins = std::ranges::find_if(candidates, [&](const std::string& name) {
    return word.size() > 4 && name.starts_with(word);
  });
  const std::string nearest =
      begins != candidates.end() ? *begins : nearest_spelling(word, candidates);
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
}

std::vector<std::string> command_names(const ArgumentParser& parser) {
  std::vector<std::string> names;
  for (const ArgumentParser& command : parser.commands()) names.push_back(command.name());
  return names;
}

std::optional<ArgumentParser> command_of(const ArgumentParser& parser, const std::string& name) {
  for (const ArgumentParser& command : parser.commands()) {
    if (command.name() == name) return command;
  }
  return std::nullopt;
}

Error unknown_command(const std::string& word, const ArgumentParser& program) {
  return {ErrorCode::usage, fmt::format("there is no command '{}'{}", word,
                                        what_is_on_offer(word, command_names(program)))};
}

/// Those of the command, and of all below it.
void write_manual_pages(const ArgumentParser& command, const std::string& folder) {
  OutputFile file(std::filesystem::path(folder) / (manual_page_name(command) + ".1"));
  file.write(manual_page(command));
  file.finish();
  for (const ArgumentParser& each : command.commands()) write_manual_pages(each, folder);
}

Error unknown_word(const std::vector<std::string>& words, const ArgumentParser& program,
                   const std::optional<ArgumentParser>& command) {
  const std::string name = command ? command_name(*command) : "cairn";
  const auto option = std::find_if(words.begin(), words.end(), looks_like_option);
  if (option != words.end() && (command || option == words.begin())) {
    const std::string word = bare_option(*option);
    return {ErrorCode::usage,
            fmt::format("{} has no option '{}'{}; see {} --help", name, word,
                        suggestion(word, option_names(options_of(program, command))), name)};
  }
  if (command) {
    return {ErrorCode::usage, fmt::format("{}: '{}' is one argument too many; see {} --help", name,
                                          words.front(), name)};
  }
  return unknown_command(words.front(), program);
}

/// An argument or option that is missing; `message` is the parser's.
Error missing(const std::string& message, const ArgumentParser& command) {
  for (const Argument& argument : command.arguments()) {
    if (message != argument.name() + " is required") continue;
    const std::string what = argument.is_positional()
                                 ? argument.type_name()
                                 : argument.name() + " " + argument.type_name();
    return {ErrorCode::usage, fmt::format("{} is missing; usage: {}", what, usage_line(command))};
  }
  return {ErrorCode::usage, fmt::format("{}; usage: {}", message, usage_line(command))};
}

/// A value that is missing, of the wrong type, or refused by the option's own validator, whose
/// words stand after the option's name.
Error bad_value(const ParseOutcome& outcome, const ArgumentParser& program,
                const std::optional<ArgumentParser>& command) {
  std::string what = outcome.message;
  for (const Argument& option : options_of(program, command)) {
    const std::string name = option.name();
    if (outcome.message.starts_with(name + ":")) {
      if (outcome.kind == ParseOutcome::Kind::without_value)
        what = fmt::format("{} needs a value: {} {}", name, name, option.type_name());
      if (outcome.kind == ParseOutcome::Kind::repeated)
        what = fmt::format("{} is given more than once", name);
    }
    const std::string unreadable = fmt::format("Could not convert: {} = ", name);
    if (what.starts_with(unreadable))
      what =
          fmt::format("{}: '{}' is not {}", name, what.substr(unreadable.size()),
                      option.most_values() > 0 ? "a valid " + option.type_name() : "true or false");
  }
  const std::string where = command ? command_name(*command) : "cairn";
  return {ErrorCode::usage, fmt::format("{}; see {} --help", what, where)};
}

/// What a configuration file says that nobody takes: the parser only tells "section.name".
Error unknown_key(const std::string& what, const ArgumentParser& program) {
  if (const std::size_t end = what.find(": This option is not allowed"); end != what.npos) {
    return {ErrorCode::usage,
            fmt::format("--config: '{}' is for the command line alone", what.substr(0, end))};
  }
  const std::string path = what.substr(what.rfind(' ') + 1);
  const std::size_t dot = path.rfind('.');
  const std::string key = path.substr(dot == std::string::npos ? 0 : dot + 1);
  const std::string section = dot == std::string::npos ? "" : path.substr(0, dot);
  std::optional<ArgumentParser> command;
  for (const ArgumentParser& known : program.commands()) {
    if (known.name() == section) command = known;
  }
  if (!section.empty() && !command) {
    return {ErrorCode::usage,
            fmt::format("--config: there is no command '{}' for a section", section)};
  }
  return {ErrorCode::usage,
          fmt::format("--config: '{}' is not an option {}{}", key,
                      command ? "of section [" + section + "]"
                              : "that may stand at the top, before a section such as [optimize]",
                      suggestion("--" + key, option_names(options_of(program, command))))};
}

int print_usage_of_nothing(const ArgumentParser& program) {
  std::fputs(help_text(program).c_str(), stderr);
  return static_cast<int>(ErrorCode::usage);
}

}  // namespace

CommandLine::CommandLine(Session& session, std::span<const char* const> words)
    : session_(session),
      words_(words),
      program_("cairn",
               "cairn: optimises factor graphs (graph SLAM); everything in it is chosen by name"),
      help_(program_.root()),
      complete_(program_.root()) {
  program_.add_help("-h,--help", "this text, or with a command, that of the command");
  program_.add_version("--version", "cairn " CAIRN_VERSION, "the version");
  add_common_options(program_, session.common);
  ArgumentParser cli = program_.root();
  cli.footer(
      "Example:\n"
      "  cairn generate sphere -o sphere.g2o && cairn optimize sphere.g2o -o best.g2o\n"
      "  cairn bench sphere.g2o --linear-solver block_cholesky,cholmod,eigen");
  for (const NamedCommand& command : needed_commands(words.subspan(1)))
    commands_.push_back(command.add(cli));
  help_ = cli.add_command("help", "this text, or that of a command");
  help_.add_option("command", help_options_.command, "the command that is to be explained")
      .type_name("COMMAND")
      .suggest(command_names(cli));
  help_.add_flag("--man", help_options_.man, "as a manual page, in the language of man");
  help_
      .add_option("--man-pages", help_options_.man_pages,
                  "write the manual pages of all commands to this folder")
      .type_name("FOLDER");
  help_.footer(
      "Example:\n"
      "  cairn help bench\n"
      "  cairn help study problems --man | man -l -");
  complete_ = cli.add_command("complete", "what may come next on a command line, for shells");
  complete_
      .add_option("words", words_to_complete_,
                  "what follows cairn on the command line; the last is being typed")
      .type_name("WORD");
  complete_.footer(
      "A line for each: word, tab, description; a line without a word: the name of a file.\n\n"
      "Example:\n"
      "  cairn complete -- optimize --linear-solver block");
}

ArgumentParser CommandLine::explained_command() {
  ArgumentParser command = program_.root();
  for (const std::string& word : help_options_.command) {
    const std::optional<ArgumentParser> next = command_of(command, word);
    if (!next) throw unknown_command(word, command);
    command = *next;
  }
  return command;
}

int CommandLine::explain() {
  const std::string& folder = help_options_.man_pages;
  if (!folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    write_manual_pages(explained_command(), folder);
    return 0;
  }
  const ArgumentParser command = explained_command();
  write_stdout(help_options_.man ? manual_page(command) : help_text(command));
  return 0;
}

int CommandLine::complete(const std::vector<std::string>& words) {
  const Completion completion =
      app::complete(program_.root(), words, [&]() -> Registry& { return session_.registry(); });
  write_stdout(completion_text(completion));
  return 0;
}

std::function<int()> CommandLine::parse() {
  // Words that are being typed are not parsed: they may be options, or empty.
  if (words_.size() > 2 && words_[1] == std::string_view("complete") &&
      words_[2] == std::string_view("--")) {
    return [this, words = std::vector<std::string>(words_.begin() + 3, words_.end())] {
      return complete(words);
    };
  }
  const ParseOutcome outcome = program_.parse(static_cast<int>(words_.size()), words_.data());
  ArgumentParser program = program_.root();
  const std::optional<ArgumentParser> chosen = program_.chosen();
  switch (outcome.kind) {
    case ParseOutcome::Kind::help:
      return [text = help_text(chosen.value_or(program))] { return write_stdout(text), 0; };
    case ParseOutcome::Kind::version:
      return [] { return write_stdout("cairn " CAIRN_VERSION "\n"), 0; };
    case ParseOutcome::Kind::config_key:
      throw unknown_key(outcome.message, program);
    case ParseOutcome::Kind::config_file:
      throw Error(ErrorCode::input, fmt::format("--config: {}", outcome.message));
    case ParseOutcome::Kind::unknown_words:
      throw unknown_word(outcome.words, program, chosen);
    case ParseOutcome::Kind::missing:
      throw missing(outcome.message, *chosen);
    case ParseOutcome::Kind::without_value:
    case ParseOutcome::Kind::repeated:
    case ParseOutcome::Kind::bad_value:
      throw bad_value(outcome, program, chosen);
    case ParseOutcome::Kind::command:
      break;
  }
  session_.files.add_input(program_.config_file());
  if (help_.parsed()) return [this] { return explain(); };
  if (complete_.parsed()) return [this] { return complete(words_to_complete_); };
  for (const Command& command : commands_) {
    if (!command.parser.parsed()) continue;
    const std::vector<std::string> options = option_names(options_of(program, chosen));
    return [this, &command, name = command_name(*chosen), options] {
      try {
        return command.run(session_);
      } catch (const Error& error) {
        throw Error(error.code(), with_option_of_command(error.what(), name, options));
      }
    };
  }
  return [program] { return print_usage_of_nothing(program); };
}

}  // namespace cairn::app
