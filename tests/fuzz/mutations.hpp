// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace cairn::test {

/// A good file of one format, small, with one of everything that the format has.
struct Seed {
  std::string name;
  std::string format;
  std::string text;
  bool vertices;  ///< has vertex lines: an edge to an id without one is then an error
};

/// A file that was good and is malformed now, certainly, whatever a reader makes of it.
struct Mutant {
  std::string what;  ///< the mutation, for messages
  std::string text;
  int line;  ///< the line that is wrong, from 1
};

const std::vector<Seed>& seeds();

/// Every mutation of every line and field where it certainly makes a file malformed. Deterministic.
std::vector<Mutant> mutants(const Seed& seed);

/// `count` texts with several mutations at once at pseudo-random places, bytes flipped, parts cut
/// and repeated: some of them may be good files. Deterministic.
std::vector<std::string> scrambled(const Seed& seed, int count);

}  // namespace cairn::test
