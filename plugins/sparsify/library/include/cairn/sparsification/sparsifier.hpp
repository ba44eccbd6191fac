// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/result_fields_fwd.hpp"
#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/recovery.hpp"

// (T n) is equation or section n of the thesis that sparsification.hpp names.

namespace cairn {

/// A sparsification problem as it came up, and how it was solved.
struct SparsificationRecord {
  std::vector<Id> removed;                   ///< the nodes that leave
  std::vector<Id> blanket;                   ///< the nodes that stay
  std::vector<std::vector<double>> states;   ///< of the blanket, where it was linearised
  std::string variable_type, factor_type;    ///< tags
  const DenseBlanket* dense = nullptr;       ///< of the blanket by itself; good during the call
  const RecoveryResult* recovery = nullptr;  ///< likewise; null: nothing had to be recovered
  int factors_before = 0;                    ///< that leave
  int factors_after = 0;                     ///< that come
};
using SparsificationObserver = std::function<void(const SparsificationRecord&)>;

/// Seconds of each part.
struct SparsificationSeconds {
  double total = 0.0;
  double marginalize = 0.0;  ///< cropping, solving and marginalising the local problem
  double covariance = 0.0;   ///< of blankets in the whole graph, where factors are fitted to it
  double topology = 0.0;
  double recovery = 0.0;

  CAIRN_API SparsificationSeconds& operator+=(const SparsificationSeconds& other);

  CAIRN_API static ResultFields<SparsificationSeconds> fields();
};

/// A node that could not be removed, and why.
struct RefusedNode {
  Id node = 0;
  std::string reason;

  CAIRN_API static ResultFields<RefusedNode> fields();
};

/// What should be known of some of the problems.
struct SparsificationNote {
  std::string text;
  int problems = 0;  ///< to which it applies

  CAIRN_API static ResultFields<SparsificationNote> fields();
};

/// The result of removing nodes from a graph. Nothing has changed yet: see `apply`.
struct Sparsification {
  std::vector<int> removed_variables;  ///< by index, rising
  std::vector<int> removed_factors;    ///< by position, rising
  std::vector<Factor> factors;         ///< that take their place
  std::vector<RefusedNode> refused;

  int problems = 0;           ///< blankets that got factors
  double mean_blanket = 0.0;  ///< nodes of a blanket, on average
  int largest_blanket = 0;
  /// Sum of `RecoveryResult::kld` over the problems [nats]. Each is that of the factors that were
  /// added, from Λ of the blanket by itself; of `sparsify`, also where they have been scaled
  /// (`fit=scaled`). Where they were fitted within the whole graph (`fit=graph`), it is what
  /// replacing the blanket's factors costs the whole, Λ̆ + R from Λ + R, R being what the rest of
  /// the graph knows of the blanket.
  double kld = 0.0;
  int not_converged = 0;                  ///< recoveries that ended before
  std::vector<SparsificationNote> notes;  ///< each text once
  SparsificationSeconds seconds;

  /// Counts `problems` more to which a text applies. An empty text is none.
  CAIRN_API void note(const std::string& text, int problems = 1);
  /// Each note in one line, with its count.
  CAIRN_API std::vector<std::string> note_lines() const;
  /// Adds what was done after this, on the graph that this led to.
  CAIRN_API void add(const Sparsification& later);

  CAIRN_API static ResultFields<Sparsification> fields();
};

/// Takes nodes out of a graph and keeps their information, as well as a few factors can (T 4.2).
class CAIRN_API Sparsifier : public Component {
 public:
  static constexpr std::string_view kKind = "sparsifier";
  ~Sparsifier() override;

  /// Removes `nodes` (by index), in that order; the graph should be at its minimum. `step`, if
  /// there is one, is called after each blanket, and now and then within one, with the number of
  /// nodes removed; it returns whether to go on. A blanket that is not finished then stays as it
  /// was.
  virtual Sparsification remove(const Graph& graph, std::span<const int> nodes,
                                const std::function<bool(int)>& step = {}) = 0;
  /// Is called for every problem from now on (empty: none).
  virtual void observe(SparsificationObserver observer) = 0;
  /// For each node (by index) the KLD that removing it, and nothing else, would cost [nats];
  /// infinite where it cannot be removed.
  virtual std::vector<double> losses(const Graph& graph, std::span<const int> nodes) = 0;
};

/// Carries a sparsification out.
CAIRN_API void apply(const Sparsification& change, Graph& graph);

}  // namespace cairn
