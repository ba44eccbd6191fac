// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "program.hpp"

namespace cairn {
class Registry;
}

namespace cairn::app {

/// What the word that is being typed may become, and one line about it.
struct Candidate {
  std::string word;
  std::string description;
};

struct Completion {
  std::vector<Candidate> candidates;
  bool files = false;  ///< the name of a file as well
};

/// What may stand in place of the last of the `words`, which follow "cairn" on a command line that
/// is being typed: commands, options, and for the value of an option names of components, their
/// options and the values of these. `registry` is asked for components alone: it takes time.
Completion complete(const Program& program, const std::vector<std::string>& words,
                    const std::function<Registry&()>& registry);

/// A line for each candidate: word, tab, description. A line without a word says that files may
/// stand there. What ends in one of : = , is to be continued.
std::string completion_text(const Completion& completion);

}  // namespace cairn::app
