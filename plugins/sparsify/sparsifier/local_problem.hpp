// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "approximation.hpp"
#include "cairn/sparsification/sparsification.hpp"
#include "work_graph.hpp"

namespace cairn::sparsify {

class LinearConstraints;

/// The types of the factors to come, which are types of factors that the graph has. Null where none
/// is needed.
struct BlanketTypes {
  std::shared_ptr<const FactorType> relative;     ///< a whole relative pose
  std::shared_ptr<const FactorType> observation;  ///< a landmark's position in the frame of a pose
  bool bearing_range = false;                     ///< or that by bearing and range, in the plane
  std::shared_ptr<const FactorType> prior;        ///< a whole pose in the world
};

/// Nodes that leave together, the Markov blanket around them, and the factors that are cropped with
/// them: all on the nodes that leave, and the relative ones within the blanket (T 4.2). Absolute
/// factors on nodes of the blanket stay as they are.
struct LocalProblem {
  std::vector<int> removed;  ///< variables of the graph
  std::vector<int> blanket;  ///< poses first, then landmarks, each rising
  int poses = 0;             ///< of the blanket
  std::vector<int> factors;  ///< of the work graph
  bool absolute = false;     ///< a factor on `removed` determines absolute states
  int absolute_size = 0;     ///< how many degrees of freedom of them such factors measure
  bool parts = false;        ///< models of a part of a measurement are wanted, too
  std::string refusal;       ///< why these nodes cannot leave; empty: they can
  BlanketTypes types;
};

/// Crops it. `removed` must be connected, or alone. Where the new factor is one on the `whole`
/// blanket, poses need no types of their own.
LocalProblem crop(const WorkGraph& work, std::vector<int> removed, bool whole = false);

/// What is left of it on the blanket. The models are a relative factor for each pair of poses, an
/// observation for each pose and landmark, and, where the problem is absolute, a prior for each
/// pose that is not fixed; or one on the whole blanket (`add_constraint_model`). With
/// `LocalProblem::parts` each of a pose is followed by that of its position and that of its
/// orientation alone, and one by bearing and range by those of the bearing and of the range.
struct Marginal {
  DenseBlanket dense;
  std::vector<std::vector<double>> states;  ///< of the blanket, where it was linearised
  Vector gradient;  ///< g = −Jᵀr there, the removed nodes taken out of it

  /// By model.
  struct Prediction {
    std::shared_ptr<const FactorType> type;
    std::vector<double> measurement;  ///< `LocalMinimum`: of the states, or of that minimum
    /// B, size of the type's residual × size of the model: the model's residual is Bᵀ r. Empty: r.
    Matrix directions;
  };
  std::vector<Prediction> predictions;
  /// Directions of Λ that are open besides the gauge; models measure none of them.
  int open = 0;
};

/// What becomes of the minimum that the cropped problem has by itself.
enum class LocalMinimum {
  ignored,     ///< new factors measure the graph's states, and repeat what the rest of it says
  measured,    ///< they measure the minimum; all is linearised at the graph's states
  linearized,  ///< they measure it, and all is linearised there (T figure 4.2)
};

/// Linearises the cropped problem and takes the removed nodes out by the Schur complement. What the
/// new factors measure is its own minimum: so they say only what its own factors do, do not repeat
/// what the rest of the graph says, and the minimum of the whole stays where it is, to second
/// order. Throws `Error` (numerical) where its factors leave a removed node
/// open.
///
/// Where Λ leaves more open than the gauge, as after the removal of a landmark, about which each
/// pose that observed it may turn, a whole relative pose would claim what is not known. Each model
/// is then reduced to what Λ determines: with N a basis of Λ's null space, to the residual Bᵀ r, B
/// a basis of the rows for which Bᵀ J N = 0. Its information B Ω Bᵀ is semidefinite.
///
/// `whole` makes the type of the model on the whole blanket; null: models are of pairs.
Marginal marginalize(const WorkGraph& work, const LocalProblem& local, LocalMinimum minimum,
                     LinearConstraints* whole = nullptr);

}  // namespace cairn::sparsify
