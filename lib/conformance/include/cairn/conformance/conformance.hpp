// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/api.hpp"

// The conformance suite: what every component and type must do whatever plugin it comes from,
// checked on random inputs. `cairn plugins --check FILE` runs it in a child process; a plugin's own
// tests call it here.

namespace cairn {

/// One group of checks of one name that is on offer, such as group "Jacobians" of factor
/// 'EDGE_SE2'.
struct ConformanceCase {
  std::string kind;  ///< as in `Offer`: "factor", "linear_solver", …
  std::string name;
  std::string group;
};

/// A law that does not hold.
struct ConformanceFinding {
  std::string law;         ///< what must hold: "local(x, retract(x, δ)) = δ"
  std::string problem;     ///< what was found at the first input that shows it
  std::string input;       ///< that input; empty where the law has none
  std::int64_t times = 1;  ///< how many inputs show it
};

/// The outcome of one group of checks.
struct ConformanceResult {
  ConformanceCase checked;
  std::int64_t checks =
      0;  ///< comparisons made; 0: nothing of it applies (a note gives the reason)
  std::vector<ConformanceFinding> findings;  ///< one for each law that does not hold
  std::vector<std::string> notes;            ///< such as the time per factor; no findings

  bool ok() const { return findings.empty(); }
};

struct ConformanceOptions {
  std::uint64_t seed = 1;  ///< of the random inputs; the same seed gives the same inputs
  int samples = 20;        ///< random inputs of each sort
};

/// Is notified before each call of a plugin's code, so that a crash or an endless loop can be
/// attributed to it.
class CAIRN_API ConformanceObserver {
 public:
  virtual ~ConformanceObserver();
  /// `callback`: the function, such as "retract". `input`: its arguments in words; may be empty.
  virtual void on_call(std::string_view callback, std::string_view input) = 0;
};

/// The groups of checks that there are for these names, in the order of the offers. Every name has
/// at least one: that it can be made, with every choice of its options. The checks of kinds that
/// the core does not know, such as policies, are components of kind `checks` (checker.hpp): they
/// are found where `registry` finds their plugin.
CAIRN_API std::vector<ConformanceCase> conformance_cases(std::span<const Offer> offers,
                                                         Registry& registry);

/// Runs one group of checks. Whatever the plugin's code throws becomes a finding that names the
/// function called; only `std::bad_alloc` passes. Throws `Error` (usage) for a group that does not
/// exist for that kind.
///
/// Inputs are random: states by steps of a few units (radians, metres) from the identity,
/// measurements within ±2 that `normalize` accepts, block systems of a few dozen blocks, and small
/// pose graphs. Arrays that the plugin is given lie between guards that show what is written
/// outside.
CAIRN_API ConformanceResult check_conformance(const ConformanceCase& which, Registry& registry,
                                              const ConformanceOptions& options = {},
                                              ConformanceObserver* observer = nullptr);

/// All groups of checks of what the plugin of that name offers ("this program" for what was added
/// with `Registry::add`). Throws `Error` (plugin) where the registry has no such plugin.
///
///     for (const ConformanceResult& result : check_conformance("range", registry))
///       EXPECT_TRUE(result.ok()) << to_text(result);
CAIRN_API std::vector<ConformanceResult> check_conformance(std::string_view plugin,
                                                           Registry& registry,
                                                           const ConformanceOptions& options = {});

/// One line, "factor 'EDGE_SE2', Jacobians: 80 checks", and below it, indented, each finding and
/// note.
CAIRN_API std::string to_text(const ConformanceResult& result);

}  // namespace cairn
