// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "option_parser.hpp"
#include "program.hpp"

namespace cairn::app {

/// The command line: the program, its commands and their options.
class CommandLine {
 public:
  /// `words`: the program's name, and what was typed after it; they outlive this.
  CommandLine(Session& session, std::span<const char* const> words);

  /// Parses, and returns what to run. Help and version are a run too. Throws `Error` (usage) for
  /// what cannot be understood, with the nearest spelling.
  std::function<int()> parse();

 private:
  /// What `cairn complete -- WORD…` does.
  int complete(const std::vector<std::string>& words);

  Session& session_;
  std::span<const char* const> words_;
  Program program_;
};

}  // namespace cairn::app
