// SPDX-License-Identifier: BSD-3-Clause
#include "option_parser.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <deque>
#include <istream>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <CLI/App.hpp>
#include <CLI/Config.hpp>     // definitions that App.hpp only declares
#include <CLI/Formatter.hpp>  // likewise

#include "cairn/program/decimal_number.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

/// Decimal, in range: the parser of another program may take 010 for eight. Rewritten without what
/// leads it.
std::string check_integer(const OptionSpec& option, std::string& text) {
  std::int64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, value);
  const auto number = static_cast<double>(value);
  const bool is_integer = error == std::errc{} && read == end;
  if (is_integer &&
      ((number >= option.minimum && number <= option.maximum) || (option.or_zero && value == 0))) {
    text = fmt::format("{}", value);
    return {};
  }
  return fmt::format("'{}' is not an integer from {:.0f} to {:.0f}{}", text, option.minimum,
                     option.maximum, option.or_zero ? ", or 0" : "");
}

/// No hexadecimal digits, no blanks before them, and no zero for 1e-400.
std::string check_real(const OptionSpec& option, const std::string& text) {
  const std::optional<double> value = decimal_number(text);
  if (value && *value >= option.minimum && *value <= option.maximum) return {};
  const bool low = std::isfinite(option.minimum), high = std::isfinite(option.maximum);
  if (low && high)
    return fmt::format("'{}' is not a number from {} to {}", text, option.minimum, option.maximum);
  return low ? fmt::format("'{}' is not a finite number of {} or more", text, option.minimum)
             : fmt::format("'{}' is not a finite number", text);
}

/// What is wrong with a value; empty: nothing. An empty word is what a script passes where a
/// variable of its is not set.
std::string check_value(const OptionSpec& option, std::string& text) {
  if (option.type == OptionType::integer) return check_integer(option, text);
  if (option.type == OptionType::real) return check_real(option, text);
  if (text.empty()) return "an empty word is no value; leave the option out";
  const bool is_bad = option.type == OptionType::choice &&
                      std::ranges::find(option.choices, text) == option.choices.end();
  return is_bad ? fmt::format("'{}' is not one of {}", text, joined(option.choices, ", ")) : "";
}

constexpr std::size_t kLargestConfig = std::size_t{1} << 20;  // bytes; they have some hundred

/// Reads no more than that: a device or a pipe may never end.
class BoundedConfig : public CLI::ConfigTOML {
 public:
  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override {
    std::string text(kLargestConfig + 1, '\0');
    input.read(text.data(), static_cast<std::streamsize>(text.size()));
    text.resize(static_cast<std::size_t>(input.gcount()));
    if (text.size() > kLargestConfig) throw CLI::FileError("has more than 1 MB");
    std::istringstream bounded(text);
    return CLI::ConfigTOML::from_config(bounded);
  }
};

/// Where the parser writes what was given for an option.
struct Slot {
  const OptionSpec* option;
  bool flag = false;
  std::string text;
  std::vector<std::string> texts;
  CLI::Option* parsed = nullptr;

  /// Adds what was given, if anything was.
  void add_to(OptionValues& values) const {
    if (parsed->count() == 0) return;
    values[option->name] = is_flag(*option) ? option_text(flag)
                           : option->list   ? list_text(texts)
                                            : text;
  }
};

std::string dashed(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

/// What configuration files call an argument that is known by its place; it may have a name
/// besides.
std::string place_name(const OptionSpec& option) {
  if (!option.form.named) return option.name;
  std::string name = value_name(option);
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

/// "-o,--output,out" in CLI11's words.
std::string names_of(const OptionSpec& option) {
  std::vector<std::string> names;
  for (std::string name : {short_name(option), long_name(option)}) {
    if (!name.empty()) names.push_back(std::move(name));
  }
  if (option.form.positional) names.push_back(place_name(option));
  return joined(names, ",");
}

void add_option(CLI::App& app, Slot& slot) {
  const OptionSpec& option = *slot.option;
  const std::string names = names_of(option);
  if (is_flag(option)) {
    slot.parsed = app.add_flag(names, slot.flag);
    return;
  }
  slot.parsed = option.list ? app.add_option(names, slot.texts) : app.add_option(names, slot.text);
  if (option.form.required) slot.parsed->required();
  if (option.list && !option.form.positional && !option.form.takes_words)
    slot.parsed->allow_extra_args(false);
  if (option.form.separator != '\0') slot.parsed->delimiter(option.form.separator);
  slot.parsed->transform(
      CLI::Validator([&option](std::string& text) { return check_value(option, text); }, ""));
}

/// The parser of one command line.
class Parser {
 public:
  Parser(const OptionTable& common, std::span<const CommandEntry> commands,
         std::span<const char* const> words);
  ParseOutcome parse();

 private:
  struct Parsed {
    const CommandEntry* command;
    CLI::App* app;
    std::deque<Slot> slots;
  };

  void add_config(const OptionSpec& option);
  void add_command(const CommandEntry& command);
  /// Whether the words may mean that command.
  bool is_named(const CommandEntry& command) const;
  /// The app that holds a command: that of "study" for "study compact".
  CLI::App& app_above(const std::string& name);
  /// The innermost command that the words name, or null.
  const Parsed* chosen() const;
  ParseOutcome outcome();

  std::span<const char* const> words_;
  CLI::App app_;
  std::deque<Slot> common_;
  std::deque<Parsed> commands_;
};

Parser::Parser(const OptionTable& common, std::span<const CommandEntry> commands,
               std::span<const char* const> words)
    : words_(words) {
  app_.name("cairn");
  app_.fallthrough();
  app_.require_subcommand(0, 1);
  app_.set_help_flag("-h,--help");
  app_.set_version_flag("--version", "");
  for (const OptionSpec& option : common.specs()) {
    if (option.name == "config") {
      add_config(option);
    } else {
      add_option(app_, common_.emplace_back(Slot{.option = &option, .text = {}, .texts = {}}));
    }
  }
  for (const CommandEntry& command : commands) add_command(command);
}

void Parser::add_config(const OptionSpec& option) {
  app_.allow_config_extras(CLI::config_extras_mode::error);
  app_.config_formatter(std::make_shared<BoundedConfig>());
  app_.set_config("--config")
      ->check(
          CLI::Validator([&option](std::string& text) { return check_value(option, text); }, ""));
}

void Parser::add_command(const CommandEntry& command) {
  CLI::App* const own = app_above(command.name()).add_subcommand(own_name(command));
  Parsed& parsed = commands_.emplace_back(Parsed{&command, own, {}});
  const bool named = is_named(command);
  if (!named && std::ranges::none_of(words_, is_config_option)) return;
  try {
    for (const OptionSpec& option : command.options())
      add_option(*own, parsed.slots.emplace_back(Slot{.option = &option, .text = {}, .texts = {}}));
  } catch (const Error&) {  // its plugin cannot be loaded, which concerns nobody else
    if (named) throw;
  }
}

bool Parser::is_named(const CommandEntry& command) const {
  std::istringstream name(command.name());
  for (std::string part; name >> part;) {
    if (std::ranges::find(words_, part) == words_.end()) return false;
  }
  return true;
}

CLI::App& Parser::app_above(const std::string& name) {
  const std::size_t blank = name.find(' ');
  if (blank == std::string::npos) return app_;
  const auto above = std::ranges::find(commands_, name.substr(0, blank),
                                       [](const Parsed& each) { return each.command->name(); });
  above->app->require_subcommand(1);
  return *above->app;
}

const Parser::Parsed* Parser::chosen() const {
  const Parsed* innermost = nullptr;  // a command of a command comes after it
  for (const Parsed& each : commands_) {
    if (each.app->parsed()) innermost = &each;
  }
  return innermost;
}

ParseOutcome Parser::outcome() {
  using Kind = ParseOutcome::Kind;
  const auto failed = [](Kind kind, std::string message, std::vector<std::string> left = {}) {
    ParseOutcome outcome;
    outcome.kind = kind;
    outcome.message = std::move(message);
    outcome.words = std::move(left);
    return outcome;
  };
  try {
    app_.parse(static_cast<int>(words_.size()), words_.data());
    return {};
  } catch (const CLI::CallForHelp&) {
    return failed(Kind::help, "");
  } catch (const CLI::CallForVersion&) {
    return failed(Kind::version, "");
  } catch (const CLI::ConfigError& error) {
    return failed(Kind::config_key, error.what());
  } catch (const CLI::FileError& error) {
    return failed(Kind::config_file, error.what());
  } catch (const CLI::ParseError& error) {
    // A misspelt option leaves its value behind, which then stands where another argument belongs:
    // so unknown words are what went wrong first, whatever the parser complains of.
    std::vector<std::string> left = app_.remaining(true);
    const std::string message = error.what();
    if (!left.empty()) return failed(Kind::unknown_words, message, std::move(left));
    if (dynamic_cast<const CLI::RequiredError*>(&error) && chosen())
      return failed(Kind::missing, message);
    if (!dynamic_cast<const CLI::ArgumentMismatch*>(&error))
      return failed(Kind::bad_value, message);
    const bool repeated = message.find(": At Most ") != std::string::npos;  // CLI11's words
    return failed(repeated ? Kind::repeated : Kind::without_value, message);
  }
}

ParseOutcome Parser::parse() {
  ParseOutcome result = outcome();
  const Parsed* const of = chosen();
  if (of) result.command = of->command;
  if (result.kind != ParseOutcome::Kind::command) return result;
  const CLI::Option* config = app_.get_config_ptr();
  if (config && config->count() > 0) result.config_file = config->as<std::string>();
  for (const Slot& slot : common_) slot.add_to(result.common);
  if (!of) {
    result.kind = ParseOutcome::Kind::nothing;
    return result;
  }
  for (const Slot& slot : of->slots) slot.add_to(result.values);
  return result;
}

}  // namespace

std::string long_name(const OptionSpec& option) {
  return option.form.named ? "--" + dashed(option.name) : std::string();
}

std::string short_name(const OptionSpec& option) {
  return option.form.letter == '\0' ? std::string() : std::string("-") + option.form.letter;
}

std::string value_name(const OptionSpec& option) {
  if (!option.form.placeholder.empty()) return option.form.placeholder;
  switch (option.type) {
    case OptionType::integer:
      return "N";
    case OptionType::real:
      return "X";
    case OptionType::component:
      return option.components ? "NAMES" : "NAME";
    case OptionType::choice:
      return "WHICH";
    case OptionType::boolean:
    case OptionType::text:
      break;
  }
  return "TEXT";
}

std::string shown_default(const OptionSpec& option) {
  const bool is_shown = !is_flag(option) && !option.list;
  return is_shown ? option.default_value : std::string();
}

ParseOutcome parse_command_line(const OptionTable& common, std::span<const CommandEntry> commands,
                                std::span<const char* const> words) {
  return Parser(common, commands, words).parse();
}

}  // namespace cairn::app
