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
#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/command.hpp"
#include "cairn/program/option_words.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/version.hpp"
#include "cairn/text/spelling.hpp"
#include "completion.hpp"
#include "help.hpp"
#include "manual_page.hpp"

namespace cairn::app {
namespace {

struct HelpOptions {
  std::vector<std::string> command;  ///< names of a command, and of the command in it
  bool man = false;
  std::string man_pages;  ///< folder, or empty

  /// `commands`: what there is to explain.
  static auto fields(std::vector<std::string> commands = {}) {
    return OptionFields<HelpOptions>()
        .text("command", &HelpOptions::command, "the command that is to be explained")
        .positional()
        .placeholder("COMMAND")
        .suggest(std::move(commands))
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

/// Whether it is `cairn complete -- WORD…`. Words that are being typed are not parsed: they may be
/// options, or empty.
bool is_being_typed(std::span<const char* const> words) {
  return words.size() > 2 && words[1] == std::string_view(kComplete) &&
         words[2] == std::string_view("--");
}

/// What `--plugin` names among the words: a plugin may bring a command, and so has to be there
/// before they are understood.
std::vector<std::string> named_plugins(std::span<const char* const> words) {
  constexpr std::string_view kOption = "--plugin";
  std::vector<std::string> files;
  for (std::size_t k = is_being_typed(words) ? 3 : 1; k < words.size(); ++k) {
    const std::string_view word = words[k];
    if (word == "--") break;
    if (word == kOption && k + 1 < words.size()) files.emplace_back(words[++k]);
    if (word.starts_with(kOption) && word.substr(kOption.size()).starts_with('='))
      files.emplace_back(word.substr(kOption.size() + 1));
  }
  return files;
}

/// What is missing may be in a plugin that could not be read.
Error with_problems(const Error& error, const Registry& registry) {
  std::string text = error.what();
  for (const PluginProblem& problem : registry.problems())
    text += fmt::format("\n  note: {}", problem.message);
  return {error.code(), text};
}

/// The word that may name the command, if the words can mean no other: a configuration file may
/// have a section for any.
std::string_view first_command(std::span<const char* const> words) {
  return words.size() < 2 || std::ranges::any_of(words, is_config_option) ? "" : words[1];
}

Error nothing_found(const Registry& registry) {
  return with_problems({ErrorCode::plugin,
                        "no plugins found; name their folder in CAIRN_PLUGIN_PATH, or a file with "
                        "--plugin"},
                       registry);
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

Error unknown_command(const std::string& word, const Program& program, const CommandEntry& above) {
  std::vector<std::string> names;
  for (const CommandEntry* command : program.below(above)) names.push_back(own_name(*command));
  return {ErrorCode::usage,
          fmt::format("there is no command '{}'{}", word, what_is_on_offer(word, names))};
}

/// Those of the command, and of all below it.
void write_manual_pages(const Program& program, const CommandEntry& command,
                        const std::string& folder) {
  OutputFile file(std::filesystem::path(folder) / (manual_page_name(command) + ".1"));
  file.write(manual_page(program, command));
  file.finish();
  for (const CommandEntry* each : program.below(command))
    write_manual_pages(program, *each, folder);
}

/// The command that `cairn help COMMAND…` names.
const CommandEntry& explained_command(const Program& program,
                                      const std::vector<std::string>& words) {
  const CommandEntry* command = &program.self;
  for (const std::string& word : words) {
    const std::vector<const CommandEntry*> below = program.below(*command);
    const auto next =
        std::ranges::find(below, word, [](const CommandEntry* each) { return own_name(*each); });
    if (next == below.end()) throw unknown_command(word, program, *command);
    command = *next;
  }
  return *command;
}

int explain(const Program& program, const HelpOptions& options) {
  const CommandEntry& command = explained_command(program, options.command);
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
                   const CommandEntry& command) {
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
Error missing(const std::string& message, const CommandEntry& command) {
  for (const OptionSpec& option : command.options()) {
    if (message != parser_name(option) + " is required") continue;
    const std::string what =
        option.form.positional ? value_name(option) : long_name(option) + " " + value_name(option);
    return {ErrorCode::usage, fmt::format("{} is missing; usage: {}", what, usage_line(command))};
  }
  return {ErrorCode::usage, fmt::format("{}; usage: {}", message, usage_line(command))};
}

/// A value that is missing, of the wrong type, or refused by the option's own check, whose words
/// stand after the option's name.
Error bad_value(const ParseOutcome& outcome, const Program& program, const CommandEntry& command) {
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
  const CommandEntry* command = section.empty() ? &program.self : program.find(section);
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
      program_{
          .self = CommandEntry(
              "", "cairn: optimises factor graphs (graph SLAM); everything in it is chosen by name",
              "Example:\n"
              "  cairn generate sphere -o sphere.g2o && cairn optimize sphere.g2o -o best.g2o\n"
              "  cairn bench sphere.g2o --linear-solver block_cholesky,cholmod,eigen",
              common_options()),
          .commands = {}} {
  if (words.size() == 2 && words[1] == std::string_view("--version")) return;
  session.common.plugins = named_plugins(words);
  try {
    static_cast<void>(session.registry());
  } catch (const Error&) {  // said again once the words are understood, unless they ask for help
    session.common.plugins.clear();
  }
  program_.commands = commands_on_offer(first_command(words), session);
  if (program_.commands.empty()) throw nothing_found(session.registry());
  std::vector<std::string> names;
  for (const CommandEntry* command : program_.below(program_.self))
    names.push_back(command->name());
  program_.commands.emplace_back(kHelp, "this text, or that of a command",
                                 "Example:\n"
                                 "  cairn help bench\n"
                                 "  cairn help study problems --man | man -l -",
                                 HelpOptions::fields(std::move(names)).table());
  program_.commands.emplace_back(
      kComplete, "what may come next on a command line, for shells",
      "A line for each: word, tab, description; a line without a word: the name of a file.\n\n"
      "Example:\n"
      "  cairn complete -- optimize --linear-solver block",
      CompleteOptions::fields().table());
}

int CommandLine::complete(const std::vector<std::string>& words) {
  const Completion completion =
      app::complete(program_, words, [&]() -> Registry& { return session_.registry(); });
  write_stdout(completion_text(completion));
  return 0;
}

std::function<int()> CommandLine::parse() {
  if (is_being_typed(words_)) {
    return [this, words = std::vector<std::string>(words_.begin() + 3, words_.end())] {
      return complete(words);
    };
  }
  const ParseOutcome outcome = parse_command_line(program_.self.table(), program_.commands, words_);
  const CommandEntry& command = outcome.command ? *outcome.command : program_.self;
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
      throw with_problems(unknown_word(outcome.words, program_, command), session_.registry());
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
  session_.set_common(from_values<CommonOptions>(outcome.common, "cairn"));
  session_.files.add_input(outcome.config_file);
  if (command.name() == kHelp) {
    return [this, options = HelpOptions::fields().read(
                      Options(command.table(), outcome.values, "cairn help"))] {
      return explain(program_, options);
    };
  }
  if (command.name() == kComplete) {
    return [this, options = from_values<CompleteOptions>(outcome.values, "cairn complete")] {
      return complete(options.words);
    };
  }
  return [this, &command, values = outcome.values] {
    try {
      return session_.registry()
          .make<Command>(ComponentSpec{command.name(), values})
          ->run(session_);
    } catch (const Error& error) {
      throw Error(error.code(), with_option_of_command(error.what(), full_name(command),
                                                       names_of(all_options(program_, command))));
    }
  };
}

}  // namespace cairn::app
