// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "cairn/sparsification/sparsifier.hpp"
#include "local_problem.hpp"
#include "sparsify/sparsifier/blankets.hpp"

namespace cairn::sparsify {

/// Poses and landmarks at random; every measurement is what it would be at the states, so that
/// these are the minimum of any of its parts.
class World {
 public:
  World(int dimension, unsigned seed) : draw_(seed), dimension_(dimension) {}

  void pose(Id id);
  void landmark(Id id);
  void relate(Id a, Id b);
  void observe(Id pose, Id landmark);
  void bearing_range(Id pose, Id landmark);
  /// A pose or a landmark in the world.
  void place(Id id);
  /// A pose's position in the world, and not its orientation.
  void locate(Id id);
  int index(Id id) const { return graph.find(id).value(); }
  std::vector<int> indices(const std::vector<Id>& ids) const;
  DenseBlanket blanket(const std::vector<Id>& removed, bool parts = false) const;
  std::string refusal(Id id) const;
  Sparsification removal(const std::vector<Id>& ids, const std::string& sparsifier = "sparsify");
  Graph without(const std::vector<Id>& ids, const std::string& sparsifier = "sparsify");
  bool plane() const { return dimension_ == 2; }
  Draw& draw() { return draw_; }

  Graph graph;

 private:
  void add(const char* tag, const std::vector<int>& on, std::vector<double> z);

  Registry registry_;
  Draw draw_;
  int dimension_;
};

/// Λ of the marginal of a graph, none of whose variables are held, on those that another has, in
/// the other's order, by the pseudoinverse of the block of the others.
Matrix marginal_of(const Graph& graph, const Graph& kept);

/// ½ (tr(Λ̆ Λ⁺) − ln |Λ̆| / |Λ| − r) in the range of Λ, by its eigenvectors.
double dense_divergence(const Matrix& L, const Matrix& sparse);

}  // namespace cairn::sparsify
