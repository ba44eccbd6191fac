// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Formatter.hpp>

namespace cairn::app {

/// Validators that do not write themselves into the help, whose first column must stay narrow.
template <class Number>
CLI::Validator within(Number low, Number high) {
  return CLI::Range(low, high).description("");
}
CLI::Validator one_of(std::vector<std::string> choices);

/// "cairn study compact": a command with those it belongs to.
std::string command_name(const CLI::App& command);

/// Help that fits a screen: at most 40 lines of 100 columns. One line an option, with its default
/// in brackets; a command's help also names the options that every command takes.
class HelpFormatter : public CLI::FormatterBase {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override;
};

}  // namespace cairn::app
