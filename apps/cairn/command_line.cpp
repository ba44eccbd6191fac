// SPDX-License-Identifier: BSD-3-Clause
#include "command_line.hpp"

#include <algorithm>
#include <cstdio>
#include <string>

#include <fmt/format.h>
#include <CLI/Config.hpp>  // the definitions that App.hpp only declares

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/spelling.hpp"
#include "cairn/runtime/version.hpp"
#include "help.hpp"

namespace cairn::app {
namespace {

constexpr int kMostThreads = 1024;

void add_common_options(CLI::App& program, CommonOptions& common) {
  ArgumentParser cli(program);
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
      .type_name("NAME:K=V")
      .repeatable();
  cli.add_flag("--quiet", common.quiet, "no progress and no notes, only results and errors");
  program
      .set_config("--config", "", "TOML: options above at the top, [optimize] for a command's own")
      ->type_name("FILE");
  program.allow_config_extras(CLI::config_extras_mode::error);
}

/// "--iterations" of "--iterations=5".
std::string bare_option(const std::string& word) { return word.substr(0, word.find('=')); }

bool looks_like_option(const std::string& word) { return word.size() > 1 && word.front() == '-'; }

std::vector<std::string> option_names(const CLI::App& program, const CLI::App* command) {
  std::vector<std::string> names{"--help"};
  for (const CLI::App* app : {command, &program}) {
    if (!app) continue;
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
      for (const std::string& name : option->get_snames()) names.push_back("-" + name);
    }
  }
  return names;
}

/// The nearest option if there is one; not all of them, which --help shows better.
std::string suggestion(const std::string& word, const std::vector<std::string>& candidates) {
  const std::string nearest = nearest_spelling(word, candidates);
  return nearest.empty() ? "" : fmt::format("; did you mean '{}'?", nearest);
}

Error unknown_command(const std::string& word, const CLI::App& program) {
  std::vector<std::string> commands;
  for (const CLI::App* known : program.get_subcommands({})) commands.push_back(known->get_name());
  return {ErrorCode::usage,
          fmt::format("there is no command '{}'{}", word, what_is_on_offer(word, commands))};
}

Error unknown_word(const std::vector<std::string>& words, const CLI::App& program,
                   const CLI::App* command) {
  const std::string name = command ? command_name(*command) : "cairn";
  const auto option = std::find_if(words.begin(), words.end(), looks_like_option);
  if (option != words.end() && (command || option == words.begin())) {
    const std::string word = bare_option(*option);
    return {ErrorCode::usage, fmt::format("{} has no option '{}'{}; see {} --help", name, word,
                                          suggestion(word, option_names(program, command)), name)};
  }
  if (command) {
    return {ErrorCode::usage, fmt::format("{}: '{}' is one argument too many; see {} --help", name,
                                          words.front(), name)};
  }
  return unknown_command(words.front(), program);
}

/// An argument or option that is missing.
Error missing(const CLI::RequiredError& error, const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    if (error.what() != option->get_name() + " is required") continue;
    const std::string what = option->get_positional()
                                 ? option->get_type_name()
                                 : option->get_name() + " " + option->get_type_name();
    return {ErrorCode::usage, fmt::format("{} is missing; usage: {}", what, usage_line(command))};
  }
  return {ErrorCode::usage, fmt::format("{}; usage: {}", error.what(), usage_line(command))};
}

/// A value that is missing, of the wrong type, or refused by the option's own validator, whose
/// words stand after the option's name.
Error bad_value(const CLI::ParseError& error, const CLI::App& program, const CLI::App* command) {
  std::string what = error.what();
  for (const CLI::App* app : {command, &program}) {
    if (!app) continue;
    for (const CLI::Option* option : app->get_options()) {
      const std::string name = option->get_name();
      const bool needs_value = dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr;
      if (needs_value && what.starts_with(name + ":"))
        what = fmt::format("{} needs a value: {} {}", name, name, option->get_type_name());
      const std::string unreadable = fmt::format("Could not convert: {} = ", name);
      if (what.starts_with(unreadable)) {
        what = fmt::format("{}: '{}' is no {}", name, what.substr(unreadable.size()),
                           option->get_type_name());
      }
    }
  }
  const std::string where = command ? command_name(*command) : "cairn";
  return {ErrorCode::usage, fmt::format("{}; see {} --help", what, where)};
}

/// What a configuration file says that nobody takes: CLI11 only tells "section.name".
Error unknown_key(const std::string& what, const CLI::App& program) {
  const std::string path = what.substr(what.rfind(' ') + 1);
  const std::size_t dot = path.rfind('.');
  const std::string key = path.substr(dot == std::string::npos ? 0 : dot + 1);
  const std::string section = dot == std::string::npos ? "" : path.substr(0, dot);
  const CLI::App* command = nullptr;
  for (const CLI::App* known : program.get_subcommands({})) {
    if (known->get_name() == section) command = known;
  }
  if (!section.empty() && !command) {
    return {ErrorCode::usage,
            fmt::format("--config: there is no command '{}' for a section", section)};
  }
  return {ErrorCode::usage,
          fmt::format("--config: '{}' is no option {}{}", key,
                      command ? "of section [" + section + "]"
                              : "that may stand at the top, before a section such as [optimize]",
                      suggestion("--" + key, option_names(program, command)))};
}

int print_usage_of_nothing(const CLI::App& program) {
  std::fputs(program.help().c_str(), stderr);
  return static_cast<int>(ErrorCode::usage);
}

}  // namespace

CommandLine::CommandLine(Session& session)
    : session_(session),
      program_(std::make_unique<CLI::App>(
          "cairn: optimises factor graphs (graph SLAM); everything in it is chosen by name",
          "cairn")),
      help_(*program_) {
  program_->formatter(std::make_shared<HelpFormatter>());
  program_->set_help_flag("-h,--help", "this text, or with a command, that of the command");
  program_->set_version_flag("--version", "cairn " CAIRN_VERSION, "the version");
  program_->fallthrough();  // common options may stand before or after the command
  program_->require_subcommand(0, 1);
  add_common_options(*program_, session.common);
  program_->footer(
      "Example:\n"
      "  cairn generate sphere -o sphere.g2o && cairn optimize sphere.g2o -o best.g2o\n"
      "  cairn bench sphere.g2o --linear-solver block_cholesky,cholmod,eigen");
  ArgumentParser program(*program_);
  commands_ = {add_info(program),     add_optimize(program), add_bench(program),
               add_replay(program),   add_online(program),   add_marginals(program),
               add_compact(program),  add_sparsify(program), add_evaluate(program),
               add_view(program),     add_plot(program),     add_convert(program),
               add_generate(program), add_plugins(program),  add_study(program)};
  help_ = program.add_command("help", "this text, or that of a command");
  help_.add_option("command", command_to_explain_, "the command that is to be explained")
      .type_name("COMMAND");
  help_.footer(
      "Example:\n"
      "  cairn help bench");
}

CommandLine::~CommandLine() = default;

std::string CommandLine::help_text() const {
  if (command_to_explain_.empty())  // App::help would be that of the command `help`
    return program_->get_formatter()->make_help(program_.get(), "", CLI::AppFormatMode::Normal);
  for (const CLI::App* command : program_->get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_name() == command_to_explain_) return command->help();
  }
  throw unknown_command(command_to_explain_, *program_);
}

std::function<int()> CommandLine::parse(int argc, const char* const* argv) {
  const auto chosen = [&]() -> const CLI::App* {
    const CLI::App* app = program_.get();  // a study is a command of a command
    for (auto used = app->get_subcommands(); !used.empty(); used = app->get_subcommands())
      app = used.front();
    return app == program_.get() ? nullptr : app;
  };
  try {
    program_->parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    const CLI::App& app = chosen() ? *chosen() : *program_;
    return [text = app.help()] { return write_stdout(text), 0; };
  } catch (const CLI::CallForVersion&) {
    return [] { return write_stdout("cairn " CAIRN_VERSION "\n"), 0; };
  } catch (const CLI::ConfigError& error) {
    throw unknown_key(error.what(), *program_);
  } catch (const CLI::FileError& error) {
    throw Error(ErrorCode::input, fmt::format("--config: {}", error.what()));
  } catch (const CLI::ParseError& error) {
    // A misspelt option leaves its value behind, which then stands where another argument belongs:
    // so unknown words are what went wrong first, whatever the parser complains of.
    const std::vector<std::string> left = program_->remaining(true);
    if (!left.empty()) throw unknown_word(left, *program_, chosen());
    const auto* required = dynamic_cast<const CLI::RequiredError*>(&error);
    if (required && chosen()) throw missing(*required, *chosen());
    throw bad_value(error, *program_, chosen());
  }
  if (help_.parsed()) return [text = help_text()] { return write_stdout(text), 0; };
  for (const Command& command : commands_) {
    if (command.parser.parsed()) return [&] { return command.run(session_); };
  }
  return [&] { return print_usage_of_nothing(*program_); };
}

}  // namespace cairn::app
