// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/session.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn::app {

/// A command of the program `cairn`: a component like any other, found by name and loaded when it
/// is called. Its options stand in one table, that of the `fields()` of their struct: the parser of
/// the command line, help, manual page and completion read it there. A name of two words, such as
/// "study problems", is that of a command of a command.
class Command : public Component {
 public:
  static constexpr std::string_view kKind = "command";

  /// Does what the command is for. Returns the program's exit code, or throws `Error`.
  virtual int run(Session& session) const = 0;
  /// The text below the options in its help: notes, and after a line "Example:" what to type.
  virtual std::string_view footer() const = 0;
};

/// Adds a command whose options are a struct; `run(options, session)` does it. `name` is offered by
/// the plugin with a line about it: OFFERS "command|NAME|what it does".
template <OptionStruct Struct, class Run>
void add_command(Registrar& registrar, std::string name, std::string footer, Run run) {
  class Given final : public Command {
   public:
    Given(Struct given, std::string text, Run does)
        : options_(std::move(given)), footer_(std::move(text)), run_(std::move(does)) {}
    int run(Session& session) const override { return run_(options_, session); }
    std::string_view footer() const override { return footer_; }

   private:
    Struct options_;
    std::string footer_;
    Run run_;
  };
  registrar.add<Command, Struct>(std::move(name),
                                 [footer = std::move(footer), run](const Struct& options) {
                                   return std::make_unique<Given>(options, footer, run);
                                 });
}

/// The largest seed: that of components.
inline constexpr double kMostSeed = 1e15;

}  // namespace cairn::app
