// SPDX-License-Identifier: BSD-3-Clause
#include "rounds.hpp"

#include <cstddef>

namespace cairn::performance {

bool Contestant::runs_again() const {
  if (runs.empty()) return in_time;
  return in_time && spent * (1.0 + 1.0 / static_cast<double>(runs.size())) <= enough;
}

boost::json::object Contestant::entry() const {
  return {{"name", name}, {"in_time", in_time}, {"limit", limit}, {"runs", runs}};
}

void run_rounds(int rounds, std::vector<Contestant>& contestants, const RunContestant& run,
                const Summarize& summarize) {
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t k = 0; k < contestants.size(); ++k) {
      Contestant& c = contestants[(k + static_cast<std::size_t>(round)) % contestants.size()];
      if (std::ssize(c.runs) < round || !c.runs_again()) continue;
      const Run one = run(c);
      c.in_time = one.outcome.in_time;
      if (!c.in_time) continue;
      c.runs.push_back(summarize(one.report));
      c.spent += one.outcome.seconds;
    }
  }
}

boost::json::array entries_of(const std::vector<Contestant>& contestants) {
  boost::json::array all;
  for (const Contestant& c : contestants) all.push_back(c.entry());
  return all;
}

}  // namespace cairn::performance
