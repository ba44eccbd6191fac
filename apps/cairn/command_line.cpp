// SPDX-License-Identifier: BSD-3-Clause
#include "command_line.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "cairn/io/output_file.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/version.hpp"
#include "cairn/text/spelling.hpp"
#include "commands.hpp"
#include "completion.hpp"
#include "help.hpp"
#include "manual_page.hpp"
#include "option_words.hpp"

namespace cairn::app {
namespace {

struct HelpOptions {
  std::vector<std::string> command;  ///< names of a command, and of the command in it
  bool man = false;
  std::string man_pages;  ///< folder, or empty

  static auto fields() {
    return OptionFields<HelpOptions>()
        .text("command", &HelpOptions::command, "the command that is to be explained")
        .positional()
        .placeholder("COMMAND")
        .boolean("man", &HelpOptions::man, "as a manual page, in the language of man")
        .text("man_pages", &HelpOptions::man_pages,
              "write the manual pages of all commands to this folder")
        .placeholder("FOLDER");
  }
};

struct CompleteOptions {
  std::vector<std::string> words;

  static auto fields() {
    return OptionFields<CompleteOptions>()
        .text("words", &CompleteOptions::words,
              "what follows cairn on the command line; the last is being typed")
        .positional()
        .placeholder("WORD");
  }
};

/// A command, and what makes it.
struct NamedCommand {
  std::string_view name;
  Command (*make)();
};

constexpr std::array kCommands{NamedCommand{"info", info_command},
                               NamedCommand{"optimize", optimize_command},
                               NamedCommand{"bench", bench_command},
                               NamedCommand{"replay", replay_command},
                               NamedCommand{"online", online_command},
                               NamedCommand{"marginals", marginals_command},
                               NamedCommand{"compact", compact_command},
                               NamedCommand{"sparsify", sparsify_command},
                               NamedCommand{"evaluate", evaluate_command},
                               NamedCommand{"view", view_command},
                               NamedCommand{"plot", plot_command},
                               NamedCommand{"convert", convert_command},
                               NamedCommand{"generate", generate_command},
                               NamedCommand{"explore", explore_command},
                               NamedCommand{"map", map_command},
                               NamedCommand{"plugins", plugins_command},
                               NamedCommand{"new-plugin", new_plugin_command}};

/// The commands that are needed to understand a line: the one that it begins with, or all. To build
/// the options of all takes longer than to read a small graph.
std::vector<Command> needed_commands(std::span<const char* const> words) {
  if (words.size() == 1 && words.front() == std::string_view("--version")) return {};
  std::vector<Command> commands;
  // A configuration file has sections for any.
  const auto is_config = [](std::string_view word) { return word.starts_with("--config"); };
  const bool all = words.empty() || std::ranges::any_of(words, is_config);
  const std::string_view first = words.empty() ? "" : words.front();
  for (const NamedCommand& each : kCommands) {
    if (!all && each.name == first) return {each.make()};
    commands.push_back(each.make());
  }
  for (Command& study : study_commands()) commands.push_back(std::move(study));
  return commands;
}

OptionTable common_options() {
  OptionTable options = CommonOptions::fields().table();
  options.add({.name = "config",
               .type = OptionType::text,
               .default_value = {},
               .help = "TOML: options above at the top, [optimize] for a command's own",
               .form = {.placeholder = "FILE"}});
  return options;
}

/// "--iterations" of "--iterations=5".
std::string bare_option(const std::string& word) { return word.substr(0, word.find('=')); }

bool looks_like_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

std::vector<std::string> names_of(const std::vector<const OptionSpec*>& options) {
  std::vector<std::string> names{"--help"};
  for (const OptionSpec* option : options) {
    for (std::string& name : option_names(*option)) names.push_back(std::move(name));
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

Error unknown_command(const std::string& word, const Program& program, const Command& above) {
  std::vector<std::string> names;
  for (const Command* command : program.below(above)) names.push_back(own_name(*command));
  return {ErrorCode::usage,
          fmt::format("there is no command '{}'{}", word, what_is_on_offer(word, names))};
}

/// Those of the command, and of all below it.
void write_manual_pages(const Program& program, const Command& command, const std::string& folder) {
  OutputFile file(std::filesystem::path(folder) / (manual_page_name(command) + ".1"));
  file.write(manual_page(program, command));
  file.finish();
  for (const Command* each : program.below(command)) write_manual_pages(program, *each, folder);
}

/// The command that `cairn help COMMAND…` names.
const Command& explained_command(const Program& program, const std::vector<std::string>& words) {
  const Command* command = &program.self;
  for (const std::string& word : words) {
    const std::vector<const Command*> below = program.below(*command);
    const auto next =
        std::ranges::find(below, word, [](const Command* each) { return own_name(*each); });
    if (next == below.end()) throw unknown_command(word, program, *command);
    command = *next;
  }
  return *command;
}

int explain(const Program& program, const HelpOptions& options) {
  const Command& command = explained_command(program, options.command);
  if (!options.man_pages.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.man_pages, error);
    write_manual_pages(program, command, options.man_pages);
    return 0;
  }
  write_stdout(options.man ? manual_page(program, command) : help_text(program, command));
  return 0;
}

Error unknown_word(const std::vector<std::string>& words, const Program& program,
                   const Command& command) {
  const std::string name = full_name(command);
  const bool is_program = program.is_self(command);
  const auto option = std::find_if(words.begin(), words.end(), looks_like_option);
  if (option != words.end() && (!is_program || option == words.begin())) {
    const std::string word = bare_option(*option);
    return {ErrorCode::usage,
            fmt::format("{} has no option '{}'{}; see {} --help", name, word,
                        suggestion(word, names_of(all_options(program, command))), name)};
  }
  if (!is_program) {
    return {ErrorCode::usage, fmt::format("{}: '{}' is one argument too many; see {} --help", name,
                                          words.front(), name)};
  }
  return unknown_command(words.front(), program, command);
}

/// An option as the parser's messages call it.
std::string parser_name(const OptionSpec& option) {
  return option.form.named ? long_name(option) : option.name;
}

/// An argument or option that is missing; `message` is the parser's.
Error missing(const std::string& message, const Command& command) {
  for (const OptionSpec& option : command.options.specs()) {
    if (message != parser_name(option) + " is required") continue;
    const std::string what =
        option.form.positional ? value_name(option) : long_name(option) + " " + value_name(option);
    return {ErrorCode::usage, fmt::format("{} is missing; usage: {}", what, usage_line(command))};
  }
  return {ErrorCode::usage, fmt::format("{}; usage: {}", message, usage_line(command))};
}

/// A value that is missing, of the wrong type, or refused by the option's own check, whose words
/// stand after the option's name.
Error bad_value(const ParseOutcome& outcome, const Program& program, const Command& command) {
  std::string what = outcome.message;
  for (const OptionSpec* option : all_options(program, command)) {
    const std::string name = parser_name(*option);
    if (outcome.message.starts_with(name + ":")) {
      if (outcome.kind == ParseOutcome::Kind::without_value)
        what = fmt::format("{} needs a value: {} {}", name, name, value_name(*option));
      if (outcome.kind == ParseOutcome::Kind::repeated)
        what = fmt::format("{} is given more than once", name);
    }
    const std::string unreadable = fmt::format("Could not convert: {} = ", name);
    if (what.starts_with(unreadable))
      what = fmt::format("{}: '{}' is not true or false", name, what.substr(unreadable.size()));
  }
  return {ErrorCode::usage, fmt::format("{}; see {} --help", what, full_name(command))};
}

/// What a configuration file says that nobody takes: the parser only tells "section.name".
Error unknown_key(const std::string& what, const Program& program) {
  if (const std::size_t end = what.find(": This option is not allowed"); end != what.npos) {
    return {ErrorCode::usage,
            fmt::format("--config: '{}' is for the command line alone", what.substr(0, end))};
  }
  const std::string path = what.substr(what.rfind(' ') + 1);
  const std::size_t dot = path.rfind('.');
  const std::string key = path.substr(dot == std::string::npos ? 0 : dot + 1);
  const std::string section = dot == std::string::npos ? "" : path.substr(0, dot);
  const Command* command = section.empty() ? &program.self : program.find(section);
  if (!command) {
    return {ErrorCode::usage,
            fmt::format("--config: there is no command '{}' for a section", section)};
  }
  return {
      ErrorCode::usage,
      fmt::format("--config: '{}' is not an option {}{}", key,
                  section.empty() ? "that may stand at the top, before a section such as [optimize]"
                                  : "of section [" + section + "]",
                  suggestion("--" + key, names_of(all_options(program, *command))))};
}

int print_usage_of_nothing(const Program& program) {
  std::fputs(help_text(program, program.self).c_str(), stderr);
  return static_cast<int>(ErrorCode::usage);
}

}  // namespace

CommandLine::CommandLine(Session& session, std::span<const char* const> words)
    : session_(session),
      words_(words),
      program_{.self = {.name = {},
                        .summary = "cairn: optimises factor graphs (graph SLAM); everything in it "
                                   "is chosen by name",
                        .remarks = "Example:\n"
                                   "  cairn generate sphere -o sphere.g2o && cairn optimize "
                                   "sphere.g2o -o best.g2o\n"
                                   "  cairn bench sphere.g2o --linear-solver "
                                   "block_cholesky,cholmod,eigen",
                        .options = common_options()},
               .commands = needed_commands(words.subspan(1))} {
  add_own_commands();
}

void CommandLine::add_own_commands() {
  program_.commands.push_back({.name = "help",
                               .summary = "this text, or that of a command",
                               .remarks = "Example:\n"
                                          "  cairn help bench\n"
                                          "  cairn help study problems --man | man -l -",
                               .options = HelpOptions::fields().table(),
                               .run = [this](const Options& options, Session&) {
                                 return explain(program_, HelpOptions::fields().read(options));
                               }});
  program_.commands.push_back(
      {.name = "complete",
       .summary = "what may come next on a command line, for shells",
       .remarks = "A line for each: word, tab, description; a line without a word: the name of a "
                  "file.\n\n"
                  "Example:\n"
                  "  cairn complete -- optimize --linear-solver block",
       .options = CompleteOptions::fields().table(),
       .run = [this](const Options& options, Session&) {
         return complete(CompleteOptions::fields().read(options).words);
       }});
}

int CommandLine::complete(const std::vector<std::string>& words) {
  const Completion completion =
      app::complete(program_, words, [&]() -> Registry& { return session_.registry(); });
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
  const ParseOutcome outcome = OptionParser(program_.self.options, program_.commands).parse(words_);
  const Command& command = outcome.command ? *outcome.command : program_.self;
  switch (outcome.kind) {
    case ParseOutcome::Kind::help:
      return [text = help_text(program_, command)] { return write_stdout(text), 0; };
    case ParseOutcome::Kind::version:
      return [] { return write_stdout("cairn " CAIRN_VERSION "\n"), 0; };
    case ParseOutcome::Kind::config_key:
      throw unknown_key(outcome.message, program_);
    case ParseOutcome::Kind::config_file:
      throw Error(ErrorCode::input, fmt::format("--config: {}", outcome.message));
    case ParseOutcome::Kind::unknown_words:
      throw unknown_word(outcome.words, program_, command);
    case ParseOutcome::Kind::missing:
      throw missing(outcome.message, command);
    case ParseOutcome::Kind::without_value:
    case ParseOutcome::Kind::repeated:
    case ParseOutcome::Kind::bad_value:
      throw bad_value(outcome, program_, command);
    case ParseOutcome::Kind::nothing:
      return [this] { return print_usage_of_nothing(program_); };
    case ParseOutcome::Kind::command:
      break;
  }
  session_.common = CommonOptions::fields().read(
      Options(CommonOptions::fields().table(), outcome.common, "cairn"));
  session_.files.add_input(outcome.config_file);
  const std::string name = full_name(command);
  return [this, &command, name, options = Options(command.options, outcome.values, name)] {
    try {
      return command.run(options, session_);
    } catch (const Error& error) {
      throw Error(error.code(), with_option_of_command(error.what(), name,
                                                       names_of(all_options(program_, command))));
    }
  };
}

}  // namespace cairn::app
