// SPDX-License-Identifier: BSD-3-Clause
#include "substitution.hpp"

#include <algorithm>
#include <utility>

namespace cairn::incremental {
namespace {

/// The rows of a node's own variables, one below the other, out of a vector whose rows hold `width`
/// numbers.
void gather_own(const System& system, const Node& node, const double* vector, std::int64_t width,
                double* own) {
  for (const std::int32_t v : node.own_variables())
    own = std::copy_n(vector + system.offset(v) * width, system.size(v) * width, own);
}
/// And back.
void scatter_own(const System& system, const Node& node, const double* own, std::int64_t width,
                 double* vector) {
  for (const std::int32_t v : node.own_variables()) {
    std::copy_n(own, system.size(v) * width, vector + system.offset(v) * width);
    own += system.size(v) * width;
  }
}

/// g is zero again for a node's own variables.
void clear_own(System& system, const Node& node) {
  for (const std::int32_t v : node.own_variables()) std::fill_n(system.g(v), system.size(v), 0.0);
}

/// Doubles for the rows of a front and those of its own variables, eight side by side.
std::int64_t room_of(const Node& node) { return std::int64_t{node.stride + node.columns} * 8; }

/// Doubles that substitution reads of a node; the number of nodes counts as well.
double work_of(const Node& node) {
  constexpr double kNode = 300.0;
  return kNode + static_cast<double>(std::ssize(node.panel));
}

/// What a node owes, squared and weighted with the diagonal of H.
double owed_square(const System& system, const Node& node) {
  double sum = 0.0;
  const double* owed = node.owed.data();
  for (const std::int32_t v : node.separator()) {
    const std::int32_t size = system.size(v);
    const double* weight = system.diagonal(v);
    for (std::int32_t k = 0; k < size; ++k) sum += weight[k * (size + 1)] * owed[k] * owed[k];
    owed += size;
  }
  return sum;
}

}  // namespace

void Steps::clear(const System& system) {
  for (const std::int32_t v : changed)
    std::fill_n(values.data() + system.offset(v), system.size(v), 0.0);
  changed.clear();
}

// --- one right-hand side ---

/// Solves for a node's own variables, given y (null: zero) and what it owes, and hands the steps of
/// its front on to its children.
void Substitution::solve_node(const System& system, Tree& tree, Node& node, const double* y,
                              Steps& steps) {
  make_room(room_of(node));
  double* const front = front_.data();
  double* const own = front + node.stride;
  if (y) {
    gather_own(system, node, y, 1, own);
  } else {
    std::fill_n(own, node.columns, 0.0);
  }
  std::ranges::copy(node.owed, front + node.columns);
  tree.kernels().backward(node.panel.data(), node.stride, node.columns, node.m, own, nullptr, 0,
                          nullptr, front);
  std::copy_n(own, node.columns, front);
  const double* next = own;
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system.size(v);
    double* step = steps.values.data() + system.offset(v);
    for (std::int32_t k = 0; k < size; ++k) step[k] += next[k];
    next += size;
    steps.changed.push_back(v);
  }
  std::ranges::fill(node.owed, 0.0);
  node.owes = false;
  for (const std::int32_t c : node.children) {
    Node& child = tree.node(c);
    double* owed = child.owed.data();
    const auto separator = child.separator();
    for (std::size_t k = 0; k < separator.size(); ++k) {
      const std::int32_t size = system.size(separator[k]);
      const double* step = front + child.rows_above[k];
      for (std::int32_t i = 0; i < size; ++i) *owed++ += step[i];
    }
    child.owes = true;
  }
}

void Substitution::begin_climb(const Tree& tree, std::span<const std::int32_t> sources) {
  collect_paths(tree, sources);
  next_on_path_ = 0;
  climbed_ = 0.0;
}

/// g ← L⁻¹ g along `path_`, whose norm is squared on the way.
bool Substitution::climb(System& system, const Tree& tree, Pace& pace) {
  double* const own = front_.data();
  double* const g = system.g().data();
  for (; next_on_path_ < path_.size(); ++next_on_path_) {
    const Node& node = tree.nodes()[path_[next_on_path_]];
    if (!pace.allows(Work::substitute, work_of(node))) return false;
    double* const front = own + node.stride;
    gather_own(system, node, g, 1, own);
    tree.kernels().forward(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                           static_cast<int>(node.runs.size()), g, front);
    for (std::int32_t c = 0; c < node.columns; ++c) climbed_ += own[c] * own[c];
    scatter_own(system, node, own, 1, g);
  }
  return true;
}

void Substitution::end_decrement(System& system, const Tree& tree) const {
  for (const std::int32_t n : path_) clear_own(system, tree.nodes()[n]);
}

double Substitution::decrement(System& system, const Tree& tree,
                               std::span<const std::int32_t> sources) {
  Pace any;
  begin_climb(tree, sources);
  climb(system, tree, any);
  end_decrement(system, tree);
  return climbed_;
}

void Substitution::begin_descent(const Tree& tree, Motions& motions) {
  motions.forget_turns();
  begin_at_roots(tree);
}

bool Substitution::descend(System& system, Tree& tree, States& states, Motions& motions,
                           double tolerance, Steps& steps, Pace& pace) {
  while (!stack_.empty()) {
    const std::int32_t n = stack_.back();
    Node& node = tree.node(n);
    if (!pace.allows(Work::substitute, work_of(node))) return false;
    stack_.pop_back();
    const double enough = tolerance * static_cast<double>(node.separator().size());
    if (!on_path_[n] && (owed_square(system, node) <= enough ||
                         (node.movable && motions.move(system, tree, states, node, enough)))) {
      continue;
    }
    motions.hand_down(tree, states, node);
    solve_node(system, tree, node, on_path_[n] ? system.g().data() : nullptr, steps);
    if (std::exchange(on_path_[n], 0)) clear_own(system, node);
    stack_.insert(stack_.end(), node.children.begin(), node.children.end());
  }
  return true;
}

double Substitution::solve(System& system, Tree& tree, States& states, Motions& motions,
                           std::span<const std::int32_t> sources, double tolerance, Steps& steps) {
  Pace any;
  begin_climb(tree, sources);
  climb(system, tree, any);
  begin_descent(tree, motions);
  descend(system, tree, states, motions, tolerance, steps, any);
  return climbed_;
}

void Substitution::follow(const System& system, Tree& tree, States& states, Motions& motions,
                          std::int32_t variable, Steps& steps) {
  motions.settle(tree, states, variable);
  stack_.clear();
  bool any = false;
  for (std::int32_t n = tree.node_of(variable); n >= 0; n = tree.nodes()[n].parent) {
    stack_.push_back(n);
    any = any || tree.nodes()[n].owes;
  }
  if (!any) return;
  for (std::size_t k = stack_.size(); k-- > 0;) {
    Node& node = tree.node(stack_[k]);
    if (node.owes) solve_node(system, tree, node, nullptr, steps);
  }
}

void Substitution::drop_deferred(Tree& tree) {
  // Zeros of L beyond a node's last row are multiplied with what is here, which must be finite.
  std::ranges::fill(front_, 0.0);
  for (std::size_t n = 0; n < tree.nodes().size(); ++n) {
    Node& node = tree.node(static_cast<std::int32_t>(n));
    if (!std::exchange(node.owes, false)) continue;
    std::ranges::fill(node.owed, 0.0);
  }
}

/// The nodes on the paths from these variables to the roots, children first.
void Substitution::collect_paths(const Tree& tree, std::span<const std::int32_t> sources) {
  path_.clear();
  on_path_.resize(tree.nodes().size(), 0);
  std::int64_t room = 0;
  for (const std::int32_t v : sources) {
    for (std::int32_t n = tree.node_of(v); n >= 0 && !on_path_[n]; n = tree.nodes()[n].parent) {
      on_path_[n] = 1;
      path_.push_back(n);
      room = std::max(room, room_of(tree.nodes()[n]));
    }
  }
  make_room(room);
  for (const std::int32_t n : path_) on_path_[n] = 0;
  std::ranges::sort(path_, {}, [&](std::int32_t n) { return tree.nodes()[n].sequence; });
}

/// What the way down along `path_` begins with.
void Substitution::begin_at_roots(const Tree& tree) {
  for (const std::int32_t n : path_) on_path_[n] = 1;
  stack_.clear();
  for (const std::int32_t n : path_) {
    if (tree.nodes()[n].parent < 0) stack_.push_back(n);
  }
}

// --- eight right-hand sides ---

void Substitution::forward_many(const System& system, const Tree& tree,
                                std::span<const std::int32_t> sources, AlignedVector& X) {
  collect_paths(tree, sources);
  for (const std::int32_t n : path_) {
    const Node& node = tree.nodes()[n];
    double* own = front_.data();
    double* front = own + std::int64_t{node.columns} * 8;
    gather_own(system, node, X.data(), 8, own);
    tree.kernels().forward_many(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                                static_cast<int>(node.runs.size()), X.data(), front);
    scatter_own(system, node, own, 8, X.data());
  }
}

void Substitution::backward_many(const System& system, const Tree& tree, const Node& node,
                                 AlignedVector& X) {
  make_room(room_of(node));
  double* own = front_.data();
  double* front = own + std::int64_t{node.columns} * 8;
  gather_own(system, node, X.data(), 8, own);
  tree.kernels().backward_many(node.panel.data(), node.stride, node.columns, node.m, own,
                               node.runs.data(), static_cast<int>(node.runs.size()), X.data(),
                               front);
  scatter_own(system, node, own, 8, X.data());
}

void Substitution::solve_many(const System& system, const Tree& tree,
                              std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(system, tree, sources, X);
  backward_many(
      system, tree, X, [](const Node&) { return true; }, [](const Node&) {});
}

void Substitution::solve_many_above(const System& system, const Tree& tree,
                                    std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(system, tree, sources, X);
  for (std::size_t k = path_.size(); k-- > 0;)
    backward_many(system, tree, tree.nodes()[path_[k]], X);
}

}  // namespace cairn::incremental
