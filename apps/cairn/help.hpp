// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include <fmt/format.h>
#include <CLI/App.hpp>
#include <CLI/Formatter.hpp>

namespace cairn::app {

/// Validators that do not write themselves into the help, whose first column must stay narrow. They
/// say what is expected: "'many' is no whole number from 0 to 1024".
template <class Number>
CLI::Validator within(Number low, Number high) {
  const auto check = [low, high](const std::string& text) {
    Number value{};
    const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
    const char* kind = std::is_integral_v<Number> ? "whole number" : "number";
    return good ? std::string() : fmt::format("'{}' is no {} from {} to {}", text, kind, low, high);
  };
  return {check, ""};
}
CLI::Validator one_of(std::vector<std::string> choices);

/// "cairn study compact": a command with those it belongs to.
std::string command_name(const CLI::App& command);

/// "cairn generate [OPTIONS] KIND -o OUT": the arguments and options that a command must be given.
std::string usage_line(const CLI::App& command);

/// Help that fits a screen: at most 40 lines of 100 columns. One line per option, with its default
/// in brackets; a command's help also names the options that every command takes.
class HelpFormatter : public CLI::FormatterBase {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override;
};

}  // namespace cairn::app
