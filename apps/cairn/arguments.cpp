// SPDX-License-Identifier: BSD-3-Clause
#include "arguments.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/App.hpp>

namespace cairn::app {
namespace {

template <class Number>
CLI::Validator number_within(Number low, Number high) {
  const auto check = [low, high](const std::string& text) {
    Number value{};
    const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
    const char* kind = std::is_integral_v<Number> ? "whole number" : "number";
    return good ? std::string() : fmt::format("'{}' is no {} from {} to {}", text, kind, low, high);
  };
  return {check, ""};
}

CLI::Validator finite_seconds(double least) {
  const auto check = [least](const std::string& text) {
    double value = 0.0;
    const bool good =
        CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value >= least;
    return good ? std::string()
                : fmt::format("'{}' is no number of seconds{}", text,
                              least == 0.0 ? ", from 0" : "");
  };
  return {check, ""};
}

CLI::Validator one_of_these(std::vector<std::string> choices) {
  const auto check = [choices = std::move(choices)](const std::string& text) {
    const bool good = std::ranges::find(choices, text) != choices.end();
    return good ? std::string() : fmt::format("'{}' is none of {}", text, fmt::join(choices, ", "));
  };
  return {check, ""};
}

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
  option_->check(number_within(low, high));
  return *this;
}

Argument& Argument::within(double low, double high) {
  option_->check(number_within(low, high));
  return *this;
}

Argument& Argument::within(std::uint64_t low, std::uint64_t high) {
  option_->check(number_within(low, high));
  return *this;
}

Argument& Argument::one_of(std::vector<std::string> choices) {
  option_->check(one_of_these(std::move(choices)));
  return *this;
}

Argument& Argument::seconds_from(double least) {
  option_->check(finite_seconds(least));
  return *this;
}

// ArgumentParser ----------------------------------------------------------------------------------

ArgumentParser ArgumentParser::add_command(const std::string& name,
                                           const std::string& description) {
  return ArgumentParser(*app_->add_subcommand(name, description));
}

Argument ArgumentParser::add_option(const std::string& names, std::string& value,
                                    const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, std::vector<std::string>& value,
                                    const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, int& value, const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, double& value,
                                    const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, std::uint64_t& value,
                                    const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

Argument ArgumentParser::add_option(const std::string& names, std::optional<double>& value,
                                    const std::string& help) {
  return Argument(*app_->add_option(names, value, help));
}

void ArgumentParser::add_flag(const std::string& names, bool& value, const std::string& help) {
  app_->add_flag(names, value, help);
}

Argument ArgumentParser::option(const std::string& name) const {
  return Argument(*app_->get_option(name));
}

void ArgumentParser::footer(const std::string& text) { app_->footer(text); }

void ArgumentParser::require_command() { app_->require_subcommand(1); }

bool ArgumentParser::parsed() const { return app_->parsed(); }

}  // namespace cairn::app
