// SPDX-License-Identifier: BSD-3-Clause
// A command that a plugin brings: `cairn greet WHOM…`.
#include <string>
#include <vector>

#include "cairn/program/command.hpp"
#include "cairn/program/session.hpp"
#include "cairn/program/table.hpp"

namespace {

struct GreetOptions {
  std::vector<std::string> whom;
  int times = 1;
  bool aloud = false;

  static auto fields() {
    using O = GreetOptions;
    return cairn::OptionFields<O>()
        .text("whom", &O::whom, "who is greeted")
        .positional()
        .placeholder("WHOM")
        .required()
        .integer("how_often", &O::times, 1, 3, "how many times")
        .letter('n')
        .boolean("aloud", &O::aloud, "so that all hear it");
  }
};

int greet(const GreetOptions& options, cairn::app::Session& session) {
  for (int k = 0; k < options.times; ++k)
    session.print("hello " + cairn::app::joined(options.whom, " and ") +
                  (options.aloud ? "!\n" : "\n"));
  return 0;
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  cairn::app::add_command<GreetOptions>(registrar, "greet", "Example:\n  cairn greet Ann", greet);
}
