// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/runtime/enum_names.hpp"

// Sparsification: taking nodes out of a graph, and replacing the dense Gaussian that marginalising
// them leaves by a few factors, which can be relinearised. Chapter 4 of J. Vallvé, Information
// metrics for localization and mapping (thesis, UPC Barcelona 2018); its equations are cited as
// (T n). All matrices are column-major.

namespace cairn {

// One blanket -------------------------------------------------------------------------------------

/// A measurement model that could become a factor of the approximation.
struct FactorModel {
  std::vector<int> nodes;        ///< of the blanket, those it measures
  int size = 0;                  ///< m, of its residual
  std::vector<double> jacobian;  ///< J: dr/dδ where r = 0, not whitened; m × d
};

/// What marginalising leaves on a Markov blanket: N(0, Λ⁻¹) in the tangent space of its nodes,
/// whose sizes add up to d. Λ is singular where only relative measurements led to it.
struct DenseBlanket {
  std::vector<int> node_sizes;      ///< tangent size of each node
  std::vector<double> information;  ///< Λ, d × d
  std::vector<FactorModel> models;  ///< what a topology can choose from

  CAIRN_API int size() const;  ///< d
};

/// A factor of a topology: the models that it measures together, by number. Nearly always one; two
/// where their errors are correlated.
using FactorChoice = std::vector<int>;

/// Chooses which models become factors (T 4.4).
class CAIRN_API Topology : public Component {
 public:
  static constexpr std::string_view kKind = "topology";
  ~Topology() override;

  /// At most `population` factors that connect all nodes, the most important first; at least as
  /// many as a spanning tree has. Throws `Error` (usage) for a blanket that it does not know how to
  /// connect.
  virtual std::vector<FactorChoice> choose(const DenseBlanket& blanket, int population) = 0;
};

/// How many factors a topology gets (T 4.4.1).
struct CAIRN_API Population {
  enum class Kind {
    tree,  ///< γ times as many as a spanning tree (T 4.21)
    fill,  ///< the fraction α of all pairs (T 4.22)
    loss,  ///< as few as keep the KLD of the blanket below a bound [nats]
  };
  Kind kind = Kind::tree;
  double value = 2.0;

  /// "tree:2", "fill:0.5", "loss:0.01". Throws `Error` (usage) for anything else.
  static Population parse(const std::string& text);
  /// What `parse` reads back as the same.
  std::string text() const;

  /// Factors for a blanket of n nodes, rounded up and clipped to [n − 1, n (n − 1) / 2] (T 4.20);
  /// of `loss` the least.
  int count(int nodes) const;
};

// Factor recovery ---------------------------------------------------------------------------------

/// The information matrices Ω_k ≻ 0 of a topology's factors are sought that minimise
///
///     KLD = ½ (tr Λ̆ − ln |Λ̆| − r),   Λ̆ = Σ_k J_kᵀ Ω_k J_k
///
/// (T 4.2), in r coordinates in which the dense Gaussian is N(0, I): the projection (T 4.3),
/// scaled.
struct RecoveryProblem {
  struct Factor {
    int size = 0;                  ///< m
    std::vector<double> jacobian;  ///< J_k, m × r, of full rank
    /// J_a⁻ᵀ Λ_ab J_b⁻¹ (T 4.8) with the two nodes' blocks; not symmetric in general. Empty: not
    /// defined.
    std::vector<double> off_diagonal;
  };
  int rank = 0;  ///< r
  std::vector<Factor> factors;
};

/// How coordinates are chosen in which the dense Gaussian has a covariance (T 4.3).
enum class Projection {
  eigen,  ///< those of the eigenvectors of Λ whose eigenvalues are not zero
  node,   ///< relative to the blanket's first node, which must be all that Λ leaves open
};
constexpr auto enum_names(Projection) {
  return std::to_array<EnumName<Projection>>(
      {{Projection::node, "node"}, {Projection::eigen, "eigen"}});
}

/// Coordinates z with δ = T z in which the dense Gaussian is N(0, I): TᵀΛT = I.
class CAIRN_API BlanketProjection {
 public:
  /// Throws `Error` (numerical) if Λ is zero, or, for `node`, if more than one node is open.
  BlanketProjection(const DenseBlanket& blanket, Projection projection);

  int rank = 0;                                        ///< r
  const std::vector<double>& T() const { return T_; }  ///< d × r
  /// The recovery problem of a topology.
  RecoveryProblem problem(const DenseBlanket& blanket,
                          std::span<const FactorChoice> topology) const;

 private:
  std::vector<double> T_;
};

/// Where a recovery stood, for plots of its convergence.
struct RecoveryPoint {
  double seconds = 0.0;
  double kld = 0.0;
};

struct RecoveryResult {
  std::vector<std::vector<double>> information;  ///< Ω_k, m × m, positive definite
  double kld = 0.0;                              ///< [nats]
  /// Largest element of the projected gradient, each factor in units in which its optimum alone
  /// would be the identity: max |W − P(W − 2 ∂KLD/∂W)| / 2 with P the nearest W ⪰ 0.
  double gradient = 0.0;
  int iterations = 0;
  bool converged = true;
  double seconds = 0.0;
  std::vector<RecoveryPoint> trace;  ///< if it was asked for
};

/// Finds the information of a topology's factors (T 4.3).
class CAIRN_API FactorRecovery : public Component {
 public:
  static constexpr std::string_view kKind = "factor_recovery";
  ~FactorRecovery() override;

  /// Throws `Error` (usage) if the method cannot solve such a problem, (numerical) if the factors
  /// do not determine all r coordinates.
  virtual RecoveryResult recover(const RecoveryProblem& problem) = 0;
  /// Record `RecoveryResult::trace` from now on.
  virtual void trace(bool on) { (void)on; }
};

// Graphs ------------------------------------------------------------------------------------------

/// A sparsification problem as it came up, and how it was solved.
struct SparsificationRecord {
  std::vector<Id> removed;                   ///< the nodes that leave
  std::vector<Id> blanket;                   ///< the nodes that stay
  std::vector<std::vector<double>> states;   ///< of the blanket, where it was linearised
  std::string variable_type, factor_type;    ///< tags
  const DenseBlanket* dense = nullptr;       ///< good during the call
  const RecoveryResult* recovery = nullptr;  ///< likewise; null: the blanket had one node
  int factors_before = 0;                    ///< that leave
  int factors_after = 0;                     ///< that come
};
using SparsificationObserver = std::function<void(const SparsificationRecord&)>;

/// Seconds of each part.
struct SparsificationSeconds {
  double total = 0.0;
  double marginalize = 0.0;  ///< cropping, solving and marginalising the local problem
  double topology = 0.0;
  double recovery = 0.0;

  CAIRN_API SparsificationSeconds& operator+=(const SparsificationSeconds& other);
};

/// A node that could not be removed, and why.
struct RefusedNode {
  Id node = 0;
  std::string reason;
};

/// The result of removing nodes from a graph. Nothing has changed yet: see `apply`.
struct Sparsification {
  std::vector<int> removed_variables;  ///< by index, rising
  std::vector<int> removed_factors;    ///< by position, rising
  std::vector<Factor> factors;         ///< that take their place
  std::vector<RefusedNode> refused;

  int problems = 0;           ///< blankets of two nodes and more
  double mean_blanket = 0.0;  ///< nodes of a blanket, on average
  int largest_blanket = 0;
  double kld = 0.0;       ///< sum over the problems, each by itself [nats]
  int not_converged = 0;  ///< recoveries that ended before
  SparsificationSeconds seconds;

  /// Adds what was done after this, on the graph that this led to.
  CAIRN_API void add(const Sparsification& later);
};

/// Takes nodes out of a graph and keeps their information, as well as a few factors can (T 4.2).
class CAIRN_API Sparsifier : public Component {
 public:
  static constexpr std::string_view kKind = "sparsifier";
  ~Sparsifier() override;

  /// Removes `nodes` (by index), in that order; the graph should be at its minimum. `step`, if
  /// there is one, is called after each blanket with the number of nodes removed; it returns
  /// whether to go on.
  virtual Sparsification remove(const Graph& graph, std::span<const int> nodes,
                                const std::function<bool(int)>& step = {}) = 0;
  /// Is called for every problem from now on (empty: none).
  virtual void observe(SparsificationObserver observer) = 0;
  /// For each node (by index) the KLD that removing it, and nothing else, would cost [nats];
  /// infinite where it cannot be removed.
  virtual std::vector<double> losses(const Graph& graph, std::span<const int> nodes) = 0;
};

/// Chooses which nodes are removed.
class CAIRN_API NodeSelection : public Component {
 public:
  static constexpr std::string_view kKind = "node_selection";
  ~NodeSelection() override;

  /// Nodes by index, in the order in which they are to be removed; `nodes` are those that may be
  /// removed, rising. `sparsifier` computes what that would cost, and can be tried on a copy.
  virtual std::vector<int> select(const Graph& graph, std::span<const int> nodes,
                                  Sparsifier& sparsifier) = 0;
};

/// Carries a sparsification out.
CAIRN_API void apply(const Sparsification& change, Graph& graph);

/// Positions of removed nodes, for later factors on them: such a factor is redirected to the
/// nearest node that stays (T 4.6.4), by the relative pose of the two when the node was removed,
/// which is treated as exact.
class CAIRN_API Redirection {
 public:
  enum class Nearest {
    place,  ///< in space
    order,  ///< by id, as the thesis's figures suggest that it does
  };
  explicit Redirection(Nearest nearest = Nearest::place) : nearest_(nearest) {}

  /// These nodes of `graph` (by index) are about to leave it. Each, and each that had been
  /// redirected to one of them, goes to the nearest pose of its type that stays; `also` are others
  /// to which nothing is redirected.
  void leave(const Graph& graph, std::span<const int> nodes, std::span<const int> also = {});
  bool has(Id node) const { return at_.contains(node); }
  /// Where a node that left would be now: the pose that it goes to, and its state from there.
  Id anchor(Id node) const { return at_.at(node).anchor; }
  std::vector<double> state(Id node, std::span<const double> anchor) const;
  /// The factor, on nodes that are there. None if that is not defined: it is not relative, or both
  /// its ends have become one node, or no pose was left.
  std::optional<Factor> redirect(const Factor& factor) const;

 private:
  struct Place {
    std::shared_ptr<const VariableType> type;
    Id anchor = 0;
    bool lost = false;           ///< there was no node to redirect to
    std::vector<double> motion;  ///< from the anchor
  };
  Nearest nearest_;
  std::unordered_map<Id, Place> at_;
};

// Measures ----------------------------------------------------------------------------------------

/// The divergence of a sparse graph from the original.
struct SparsificationError {
  double kld = 0.0;         ///< D(original ‖ sparse) of the nodes of both [nats] (T 3.4)
  double covariance = 0.0;  ///< of that, the part of the covariances
  double mean = 0.0;        ///< and that of the means: ½ (μ̆ − μ)ᵀ Λ̆ (μ̆ − μ)
  double rmse = 0.0;        ///< of positions, in the common frame [m]; NaN without positions
};

/// D(p‖q) = ½ (tr(Λ̆Σ) − ln |Λ̆Σ| + ‖μ̆ − μ‖²_Λ̆ − d), p the marginal of `original` on the nodes of
/// `sparse`, q `sparse`, each linearised at its own states, which should be minima. Of p only the
/// blocks of Σ on the pattern of Λ̆ are computed, so it works on many thousands of nodes. Nodes
/// that are constant in one graph must be constant in the other; where none is, the first node of
/// `sparse` is. `solver` must have the abilities `LogDeterminant` and `Marginals` (`block_cholesky`
/// has). Throws `Error` (input) if `sparse` has a node that `original` has not, (numerical) where H
/// is singular.
CAIRN_API SparsificationError sparsification_error(const Graph& original, const Graph& sparse,
                                                   LinearSolver& solver);

}  // namespace cairn
