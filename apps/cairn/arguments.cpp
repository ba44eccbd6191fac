// SPDX-License-Identifier: BSD-3-Clause
#include "arguments.hpp"
#include "decimal_number.hpp"
#include "table.hpp"

#include <algorithm>
#include <charconv>
#include <istream>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <CLI/App.hpp>
#include <CLI/Config.hpp>     // definitions that App.hpp only declares
#include <CLI/Formatter.hpp>  // likewise

namespace cairn::app {
namespace {

/// Decimal, in range: the parser would take 010 for eight, -1 for 2⁶⁴ - 1 and 10²⁰ for the largest.
template <class Integer>
CLI::Validator integer_within(Integer low, Integer high) {
  const auto check = [low, high](std::string& text) {
    Integer value{};
    const char* const end = text.data() + text.size();
    const auto [read, error] = std::from_chars(text.data(), end, value);
    if (error != std::errc{} || read != end || value < low || value > high)
      return fmt::format("'{}' is not an integer from {} to {}", text, low, high);
    text = fmt::format("{}", value);  // which the parser reads in the same way
    return std::string();
  };
  return {check, ""};
}

/// Any one that the type has.
template <class Integer>
CLI::Validator integer() {
  return integer_within(std::numeric_limits<Integer>::min(), std::numeric_limits<Integer>::max());
}

/// The parser would take hexadecimal digits, blanks before them, and zero for 1e-400.
CLI::Validator any_number() {
  const auto check = [](const std::string& text) {
    return decimal_number(text) ? std::string() : fmt::format("'{}' is not a finite number", text);
  };
  return {check, ""};
}

CLI::Validator number_within(double low, double high) {
  const auto check = [low, high](const std::string& text) {
    const std::optional<double> value = decimal_number(text);
    return value && *value >= low && *value <= high
               ? std::string()
               : fmt::format("'{}' is not a number from {} to {}", text, low, high);
  };
  return {check, ""};
}

CLI::Validator finite_seconds(double least) {
  const auto check = [least](const std::string& text) {
    const std::optional<double> value = decimal_number(text);
    return value && *value >= least
               ? std::string()
               : fmt::format("'{}' is not a number of seconds{}", text,
                             least < 0.0 ? "" : fmt::format(", from {}", least));
  };
  return {check, ""};
}

/// What a script passes where a variable of its is not set.
CLI::Validator not_empty() {
  const auto check = [](const std::string& text) {
    return text.empty() ? std::string("an empty word is no value; leave the option out")
                        : std::string();
  };
  return {check, ""};
}

CLI::Validator one_of_these(std::vector<std::string> choices) {
  const auto check = [choices = std::move(choices)](const std::string& text) {
    const bool good = std::ranges::find(choices, text) != choices.end();
    return good ? std::string() : fmt::format("'{}' is not one of {}", text, joined(choices, ", "));
  };
  return {check, ""};
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

}  // namespace

// Argument ----------------------------------------------------------------------------------------

Argument& Argument::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Argument& Argument::description(const std::string& text) {
  option_->description(text);
  return *this;
}

Argument& Argument::show_default() {
  option_->capture_default_str();
  return *this;
}

Argument& Argument::show_default(const std::string& text) {
  option_->default_str(text);
  return *this;
}

Argument& Argument::required() {
  option_->required();
  return *this;
}

Argument& Argument::repeatable() {
  option_->allow_extra_args(false);
  return *this;
}

Argument& Argument::separated_by(char delimiter) {
  option_->delimiter(delimiter);
  return *this;
}

Argument& Argument::within(int low, int high) {
  option_->transform(integer_within(low, high));
  return *this;
}

Argument& Argument::none_or_within(int low, int high) {
  const CLI::Validator number = integer_within(low, high);
  option_->transform(CLI::Validator(
      [number](std::string& text) {
        if (text == "0") return std::string();
        const std::string problem = number(text);
        return problem.empty() ? problem : problem + ", or 0";
      },
      ""));
  return *this;
}

Argument& Argument::within(double low, double high) {
  option_->transform(number_within(low, high));  // before the check of any number, which says less
  return *this;
}

Argument& Argument::one_of(std::vector<std::string> choices) {
  words_->choices = choices;
  option_->check(one_of_these(std::move(choices)));
  return *this;
}

Argument& Argument::suggest(std::vector<std::string> choices) {
  words_->choices = std::move(choices);
  return *this;
}

Argument& Argument::component(std::vector<std::string> kinds) {
  words_->component = true;
  words_->kinds = std::move(kinds);
  return type_name("NAME");
}

Argument& Argument::components(std::vector<std::string> kinds) {
  component(std::move(kinds));
  words_->list = true;
  return type_name("NAMES");
}

Argument& Argument::file_or_generated(std::vector<std::string> kinds) {
  words_->generators = std::move(kinds);
  return *this;
}

Argument& Argument::seconds_from(double least) {
  option_->transform(finite_seconds(least));
  return *this;
}

std::string Argument::name() const { return option_->get_name(); }

std::vector<std::string> Argument::short_names() const { return option_->get_snames(); }

std::vector<std::string> Argument::long_names() const { return option_->get_lnames(); }

std::string Argument::type_name() const { return option_->get_type_name(); }

std::string Argument::description() const { return option_->get_description(); }

std::string Argument::default_text() const { return option_->get_default_str(); }

bool Argument::is_positional() const { return option_->get_positional(); }

bool Argument::is_required() const { return option_->get_required(); }

int Argument::most_values() const { return option_->get_items_expected_max(); }

// ArgumentParser ----------------------------------------------------------------------------------

ArgumentParser ArgumentParser::add_command(const std::string& name,
                                           const std::string& description) {
  return {*app_->add_subcommand(name, description), *words_};
}

Argument ArgumentParser::argument(CLI::Option& option) const {
  return {option, (*words_)[&option]};
}

Argument ArgumentParser::number(CLI::Option& option) const {
  const Argument number = argument(option);
  (*words_)[&option].any_text = true;
  return number;
}

Argument ArgumentParser::add_option(const std::string& names, std::string& value,
                                    const std::string& help) {
  return argument(*app_->add_option(names, value, help)->check(not_empty()));
}

Argument ArgumentParser::add_option(const std::string& names, std::vector<std::string>& value,
                                    const std::string& help) {
  return argument(*app_->add_option(names, value, help)->check(not_empty()));
}

Argument ArgumentParser::add_option(const std::string& names, int& value, const std::string& help) {
  return number(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, double& value,
                                    const std::string& help) {
  return number(*app_->add_option(names, value, help)->check(any_number()));
}

Argument ArgumentParser::add_option(const std::string& names, std::uint64_t& value,
                                    const std::string& help) {
  return number(*app_->add_option(names, value, help)->transform(integer<std::uint64_t>()));
}

Argument ArgumentParser::add_option(const std::string& names, std::optional<double>& value,
                                    const std::string& help) {
  return number(*app_->add_option(names, value, help)->check(any_number()));
}

Argument ArgumentParser::add_option(const std::string& names, std::optional<std::int64_t>& value,
                                    const std::string& help) {
  return number(*app_->add_option(names, value, help)->transform(integer<std::int64_t>()));
}

void ArgumentParser::add_flag(const std::string& names, bool& value, const std::string& help) {
  app_->add_flag(names, value, help);
}

Argument ArgumentParser::option(const std::string& name) const {
  return argument(*app_->get_option(name));
}

void ArgumentParser::footer(const std::string& text) { app_->footer(text); }

void ArgumentParser::require_command() { app_->require_subcommand(1); }

bool ArgumentParser::parsed() const { return app_->parsed(); }

std::string ArgumentParser::name() const { return app_->get_name(); }

std::string ArgumentParser::description() const { return app_->get_description(); }

std::string ArgumentParser::footer() const { return app_->get_footer(); }

std::optional<ArgumentParser> ArgumentParser::parent() const {
  if (!app_->get_parent()) return std::nullopt;
  return ArgumentParser(*app_->get_parent(), *words_);
}

std::vector<ArgumentParser> ArgumentParser::commands() const {
  std::vector<ArgumentParser> all;
  for (CLI::App* command : app_->get_subcommands([](CLI::App*) { return true; }))
    all.emplace_back(*command, *words_);
  return all;
}

std::vector<Argument> ArgumentParser::arguments() const {
  std::vector<Argument> all;
  for (CLI::Option* option : app_->get_options()) all.push_back(argument(*option));
  return all;
}

std::vector<Argument> ArgumentParser::arguments_but_help() const {
  std::vector<Argument> all;
  for (CLI::Option* option : app_->get_options()) {
    if (option != app_->get_help_ptr() && option != app_->get_version_ptr())
      all.push_back(argument(*option));
  }
  return all;
}

// ProgramParser -----------------------------------------------------------------------------------

ProgramParser::ProgramParser(const std::string& name, const std::string& description)
    : app_(std::make_unique<CLI::App>(description, name)), words_(std::make_unique<OptionWords>()) {
  app_->fallthrough();
  app_->require_subcommand(0, 1);
}

ProgramParser::~ProgramParser() = default;

void ProgramParser::add_help(const std::string& names, const std::string& help) {
  app_->set_help_flag(names, help);
}

void ProgramParser::add_version(const std::string& names, const std::string& text,
                                const std::string& help) {
  app_->set_version_flag(names, text, help);
}

Argument ProgramParser::add_config(const std::string& names, const std::string& help) {
  app_->allow_config_extras(CLI::config_extras_mode::error);
  app_->config_formatter(std::make_shared<BoundedConfig>());
  CLI::Option* const option = app_->set_config(names, "", help)->check(not_empty());
  return {*option, (*words_)[option]};
}

std::string ProgramParser::config_file() const {
  const CLI::Option* option = app_->get_config_ptr();
  return option && option->count() > 0 ? option->as<std::string>() : "";
}

ParseOutcome ProgramParser::parse(int argc, const char* const* argv) {
  using Kind = ParseOutcome::Kind;
  try {
    app_->parse(argc, argv);
    return {};
  } catch (const CLI::CallForHelp&) {
    return {Kind::help, "", {}};
  } catch (const CLI::CallForVersion&) {
    return {Kind::version, "", {}};
  } catch (const CLI::ConfigError& error) {
    return {Kind::config_key, error.what(), {}};
  } catch (const CLI::FileError& error) {
    return {Kind::config_file, error.what(), {}};
  } catch (const CLI::ParseError& error) {
    // A misspelt option leaves its value behind, which then stands where another argument belongs:
    // so unknown words are what went wrong first, whatever the parser complains of.
    std::vector<std::string> left = app_->remaining(true);
    if (!left.empty()) return {Kind::unknown_words, error.what(), std::move(left)};
    if (dynamic_cast<const CLI::RequiredError*>(&error) && chosen())
      return {Kind::missing, error.what(), {}};
    const std::string message = error.what();
    if (!dynamic_cast<const CLI::ArgumentMismatch*>(&error)) return {Kind::bad_value, message, {}};
    const bool repeated = message.find(": At Most ") != std::string::npos;  // CLI11's words
    return {repeated ? Kind::repeated : Kind::without_value, message, {}};
  }
}

std::optional<ArgumentParser> ProgramParser::chosen() {
  CLI::App* innermost = nullptr;  // a study is a command of a command
  for (auto used = app_->get_subcommands(); !used.empty(); used = innermost->get_subcommands())
    innermost = used.front();
  if (!innermost) return std::nullopt;
  return ArgumentParser(*innermost, *words_);
}

}  // namespace cairn::app
