// SPDX-License-Identifier: BSD-3-Clause
// Substitution, up and down the tree, and what is moved without being solved for.
#include <algorithm>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "tree.hpp"

namespace cairn::incremental {
namespace {

/// A motion, in metres and radians, that hardly turns what is left of another.
constexpr double kShort = 0.05;

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

/// out = M v with a square matrix; `size` may be a constant, which unrolls the loops.
template <class Size>
void multiply_square(Size size, const double* matrix, const double* vector, double* out) {
  for (std::int32_t r = 0; r < size; ++r) {
    double sum = 0.0;
    for (std::int32_t c = 0; c < size; ++c) sum += matrix[c * size + r] * vector[c];
    out[r] = sum;
  }
}
/// Doubles that substitution reads of a node; the number of nodes counts as well.
double work_of(const Node& node) {
  constexpr double kNode = 300.0;
  return kNode + static_cast<double>(std::ssize(node.panel));
}

template <std::int32_t n>
using Constant = std::integral_constant<std::int32_t, n>;

}  // namespace

/// Solves for a node's own variables, given y (null: zero) and what it owes, and hands the steps of
/// its front on to its children.
void Tree::solve_node(Node& node, const double* y, std::vector<double>& steps,
                      std::vector<std::int32_t>& changed) {
  double* const front = front_.data();
  double* const own = front + node.stride;
  if (y) {
    gather_own(*system_, node, y, 1, own);
  } else {
    std::fill_n(own, node.columns, 0.0);
  }
  std::ranges::copy(node.owed, front + node.columns);
  kernels_->backward(node.panel.data(), node.stride, node.columns, node.m, own, nullptr, 0, nullptr,
                     front);
  std::copy_n(own, node.columns, front);
  const double* next = own;
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system_->size(v);
    double* step = steps.data() + system_->offset(v);
    for (std::int32_t k = 0; k < size; ++k) step[k] += next[k];
    next += size;
    changed.push_back(v);
  }
  std::ranges::fill(node.owed, 0.0);
  node.owes = false;
  for (const std::int32_t c : node.children) {
    Node& child = nodes_[c];
    double* owed = child.owed.data();
    const auto separator = child.separator();
    for (std::size_t k = 0; k < separator.size(); ++k) {
      const std::int32_t size = system_->size(separator[k]);
      const double* step = front + child.rows_above[k];
      for (std::int32_t i = 0; i < size; ++i) *owed++ += step[i];
    }
    child.owes = true;
  }
}

// --- moving as a whole ---

/// Takes the motion of the separator as a whole out of what a node owes, if little is then left.
bool Tree::move_as_a_whole(Node& node, double tolerance) {
  const auto separator = node.separator();
  const LieGroup& group = *states_->type(separator.front()).lie_group();
  const std::int32_t size = system_->size(separator.front()), square = size * size;
  const std::int32_t ambient = states_->ambient(separator.front());
  rigid_.resize(node.owed.size());
  matrix_.resize(static_cast<std::size_t>(square));
  lead_.resize(static_cast<std::size_t>(ambient) + static_cast<std::size_t>(size));
  double* const twist = lead_.data() + ambient;
  const auto multiply = [&](const double* matrix, const double* vector, double* out) {
    if (size == 3)
      multiply_square(Constant<3>{}, matrix, vector, out);
    else if (size == 6)
      multiply_square(Constant<6>{}, matrix, vector, out);
    else
      multiply_square(size, matrix, vector, out);
  };
  // The motion is that of the separator's first variable: η = Ad(F_0) δ_0 …
  group.adjoint(states_->frame(separator.front()), matrix_.data());
  multiply(matrix_.data(), node.owed.data(), twist);
  // … and would be δ_i = Ad(F_i⁻¹) η of the others.
  double left = 0.0;
  const double* owed = node.owed.data();
  double* rigid = rigid_.data();
  for (const std::int32_t v : separator) {
    multiply(states_->world_to_frame(v), twist, rigid);
    const double* weight = system_->diagonal(v);
    for (std::int32_t k = 0; k < size; ++k) {
      const double rest = owed[k] - rigid[k];
      left += weight[k * (size + 1)] * rest * rest;
    }
    if (left > tolerance) return false;
    owed += size;
    rigid += size;
  }
  // exp(rigid + rest) = exp(D rest) exp(rigid), with the left Jacobian: what is left is counted
  // from where the motion has brought x. D is the identity but for about half the motion.
  double* rest = node.owed.data();
  rigid = rigid_.data();
  for (const std::int32_t v : separator) {
    double length = 0.0;  // squared
    for (std::int32_t k = 0; k < size; ++k) {
      rest[k] -= rigid[k];
      length += rigid[k] * rigid[k];
      rigid[k] = -rigid[k];
    }
    if (length > kShort * kShort) {
      states_->type(v).retract_jacobian(states_->x(v), rigid, matrix_.data());
      multiply(matrix_.data(), rest, rigid);
      turns_.push_back({static_cast<std::int32_t>(&node - nodes_.data()), v, turned_steps_.size()});
      for (std::int32_t k = 0; k < size; ++k)
        turned_steps_.push_back(rigid[k] - std::exchange(rest[k], rigid[k]));
    }
    rest += size;
    rigid += size;
  }
  group.exp(twist, lead_.data());
  add_lead(node, lead_);
  ++leads_;
  return true;
}

/// All of the subtree is to be moved by a lead, after what it is to be moved by already.
void Tree::add_lead(Node& node, const std::vector<double>& lead) {
  const std::int32_t v = node.variables.front();
  states_->log_other(static_cast<std::int32_t>(&node - nodes_.data()), node.lead);
  node.settled_at = -1;
  if (node.lead.empty()) {
    node.lead = lead;
  } else {
    states_->type(v).lie_group()->compose(lead.data(), node.lead.data(), node.lead.data());
    for (std::size_t k = static_cast<std::size_t>(states_->ambient(v)); k < lead.size(); ++k)
      node.lead[k] += lead[k];
  }
}

/// Moves a node's own variables by what its subtree is to be moved by, and leaves the rest of it to
/// its children.
void Tree::hand_down(Node& node) {
  if (node.lead.empty()) return;
  const double* twist = node.lead.data() + states_->ambient(node.variables.front());
  for (const std::int32_t v : node.own_variables()) states_->lead(v, node.lead.data(), twist);
  for (const std::int32_t c : node.children) add_lead(nodes_[c], node.lead);
  states_->log_other(static_cast<std::int32_t>(&node - nodes_.data()), node.lead);
  node.lead.clear();
}

void Tree::settle(std::int32_t variable) {
  settle_path_.clear();
  for (std::int32_t n = node_of(variable); n >= 0 && nodes_[n].settled_at != leads_;
       n = nodes_[n].parent)
    settle_path_.push_back(n);
  for (std::size_t k = settle_path_.size(); k-- > 0;) {
    hand_down(nodes_[settle_path_[k]]);
    nodes_[settle_path_[k]].settled_at = leads_;
  }
}

void Tree::settle_all() {
  top_down(stack_);
  for (const std::int32_t n : stack_) hand_down(nodes_[n]);
}

bool Tree::read(std::int32_t variable, double* x) const {
  const std::int32_t first = node_of(variable);
  if (first < 0) return false;
  const LieGroup* group = states_->type(variable).lie_group();
  std::vector<double> total;
  for (std::int32_t n = first; n >= 0 && nodes_[n].settled_at != leads_; n = nodes_[n].parent) {
    const std::vector<double>& lead = nodes_[n].lead;
    if (lead.empty()) continue;
    if (total.empty()) {
      total.assign(lead.begin(), lead.end());
    } else {
      group->compose(lead.data(), total.data(), total.data());
    }
  }
  if (total.empty()) return false;
  group->compose(total.data(), states_->x(variable), x);
  return true;
}

Estimate Tree::settled(Estimate estimate, const Leads& leads) const {
  constexpr std::int32_t kUnknown = -2, kNone = -1;
  std::vector<std::vector<double>> totals;                      // leads with all above them
  std::vector<std::int32_t> total_of(nodes_.size(), kUnknown);  // by node: which total
  std::vector<std::int32_t> path;
  for (std::int32_t v = 0; v < estimate.size(); ++v) {
    const std::int32_t own = node_of(v);
    if (own < 0) continue;
    const LieGroup* group = states_->type(v).lie_group();
    for (std::int32_t n = own; n >= 0 && total_of[n] == kUnknown; n = nodes_[n].parent)
      path.push_back(n);
    for (; !path.empty(); path.pop_back()) {
      const Node& node = nodes_[path.back()];
      const std::int32_t above = node.parent < 0 ? kNone : total_of[node.parent];
      total_of[path.back()] = above;
      const auto other = leads.find(path.back());
      const std::vector<double>& lead = other == leads.end() ? node.lead : other->second;
      if (lead.empty()) continue;
      totals.push_back(lead);
      if (above != kNone) group->compose(totals[above].data(), lead.data(), totals.back().data());
      total_of[path.back()] = static_cast<std::int32_t>(std::ssize(totals) - 1);
    }
    if (const std::int32_t total = total_of[own]; total != kNone)
      group->compose(totals[total].data(), estimate.x(v), estimate.x(v));
  }
  return estimate;
}

bool Tree::below(std::int32_t variable, std::int32_t node) const {
  std::int32_t n = node_of(variable);
  while (n >= 0 && nodes_[n].sequence < nodes_[node].sequence) n = nodes_[n].parent;
  return n == node;
}

/// What a node owes, squared and weighted with the diagonal of H.
double Tree::owed_square(const Node& node) const {
  double sum = 0.0;
  const double* owed = node.owed.data();
  for (const std::int32_t v : node.separator()) {
    const std::int32_t size = system_->size(v);
    const double* weight = system_->diagonal(v);
    for (std::int32_t k = 0; k < size; ++k) sum += weight[k * (size + 1)] * owed[k] * owed[k];
    owed += size;
  }
  return sum;
}

void Tree::begin_climb(std::span<const std::int32_t> sources) {
  collect_paths(sources);
  next_on_path_ = 0;
  climbed_ = 0.0;
}

/// g ← L⁻¹ g along `path_`, whose norm is squared on the way.
bool Tree::climb(std::vector<double>& g, Pace& pace) {
  double* const own = front_.data();
  for (; next_on_path_ < path_.size(); ++next_on_path_) {
    const Node& node = nodes_[path_[next_on_path_]];
    if (!pace.allows(Work::substitute, work_of(node))) return false;
    double* const front = own + node.stride;
    gather_own(*system_, node, g.data(), 1, own);
    kernels_->forward(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                      static_cast<int>(node.runs.size()), g.data(), front);
    for (std::int32_t c = 0; c < node.columns; ++c) climbed_ += own[c] * own[c];
    scatter_own(*system_, node, own, 1, g.data());
  }
  return true;
}

void Tree::end_decrement(std::vector<double>& g) {
  for (const std::int32_t n : path_) {
    for (const std::int32_t v : nodes_[n].own_variables())
      std::fill_n(g.data() + system_->offset(v), system_->size(v), 0.0);
  }
}

double Tree::decrement(std::span<const std::int32_t> sources, std::vector<double>& g) {
  Pace any;
  begin_climb(sources);
  climb(g, any);
  end_decrement(g);
  return climbed_;
}

void Tree::begin_descent() {
  turns_.clear();
  turned_steps_.clear();
  for (const std::int32_t n : path_) on_path_[n] = 1;
  stack_.clear();
  for (const std::int32_t n : path_) {
    if (nodes_[n].parent < 0) stack_.push_back(n);
  }
}

bool Tree::descend(double tolerance, std::vector<double>& g, std::vector<double>& steps,
                   std::vector<std::int32_t>& changed, Pace& pace) {
  while (!stack_.empty()) {
    const std::int32_t n = stack_.back();
    Node& node = nodes_[n];
    if (!pace.allows(Work::substitute, work_of(node))) return false;
    stack_.pop_back();
    const double enough = tolerance * static_cast<double>(node.separator().size());
    if (!on_path_[n] &&
        (owed_square(node) <= enough || (node.movable && move_as_a_whole(node, enough)))) {
      continue;
    }
    hand_down(node);
    solve_node(node, on_path_[n] ? g.data() : nullptr, steps, changed);
    if (on_path_[n]) {
      for (const std::int32_t v : node.own_variables())
        std::fill_n(g.data() + system_->offset(v), system_->size(v), 0.0);
    }
    on_path_[n] = 0;
    stack_.insert(stack_.end(), node.children.begin(), node.children.end());
  }
  return true;
}

double Tree::solve(std::span<const std::int32_t> sources, double tolerance, std::vector<double>& g,
                   std::vector<double>& steps, std::vector<std::int32_t>& changed) {
  Pace any;
  begin_climb(sources);
  climb(g, any);
  begin_descent();
  descend(tolerance, g, steps, changed, any);
  return climbed_;
}

void Tree::follow(std::int32_t variable, std::vector<double>& steps,
                  std::vector<std::int32_t>& changed) {
  stack_.clear();
  bool any = false;
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) {
    stack_.push_back(n);
    any = any || nodes_[n].owes;
  }
  settle(variable);
  if (!any) return;
  stack_.clear();
  for (std::int32_t n = node_of(variable); n >= 0; n = nodes_[n].parent) stack_.push_back(n);
  for (std::size_t k = stack_.size(); k-- > 0;) {
    if (nodes_[stack_[k]].owes) solve_node(nodes_[stack_[k]], nullptr, steps, changed);
  }
}

void Tree::drop_deferred() {
  // Zeros of L beyond a node's last row are multiplied with what is here, which must be finite.
  std::ranges::fill(front_, 0.0);
  for (Node& node : nodes_) {
    if (!std::exchange(node.owes, false)) continue;
    std::ranges::fill(node.owed, 0.0);
  }
}

// --- eight right-hand sides ---

/// The nodes on the paths from these variables to the roots, children first.
void Tree::collect_paths(std::span<const std::int32_t> sources) {
  path_.clear();
  on_path_.resize(nodes_.size(), 0);
  for (const std::int32_t v : sources) {
    for (std::int32_t n = node_of(v); n >= 0 && !on_path_[n]; n = nodes_[n].parent) {
      on_path_[n] = 1;
      path_.push_back(n);
    }
  }
  for (const std::int32_t n : path_) on_path_[n] = 0;
  std::ranges::sort(path_, {}, [&](std::int32_t n) { return nodes_[n].sequence; });
}

void Tree::forward_many(std::span<const std::int32_t> sources, AlignedVector& X) {
  collect_paths(sources);
  for (const std::int32_t n : path_) {
    const Node& node = nodes_[n];
    double* own = front_.data();
    double* front = own + std::int64_t{node.columns} * 8;
    gather_own(*system_, node, X.data(), 8, own);
    kernels_->forward_many(node.panel.data(), node.stride, node.columns, own, node.runs.data(),
                           static_cast<int>(node.runs.size()), X.data(), front);
    scatter_own(*system_, node, own, 8, X.data());
  }
}

void Tree::backward_many(const Node& node, AlignedVector& X) {
  double* own = front_.data();
  double* front = own + std::int64_t{node.columns} * 8;
  gather_own(*system_, node, X.data(), 8, own);
  kernels_->backward_many(node.panel.data(), node.stride, node.columns, node.m, own,
                          node.runs.data(), static_cast<int>(node.runs.size()), X.data(), front);
  scatter_own(*system_, node, own, 8, X.data());
}

void Tree::solve_many(std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(sources, X);
  backward_many(
      X, [](const Node&) { return true; }, [](const Node&) {});
}

void Tree::solve_many_above(std::span<const std::int32_t> sources, AlignedVector& X) {
  forward_many(sources, X);
  for (std::size_t k = path_.size(); k-- > 0;) backward_many(nodes_[path_[k]], X);
}

}  // namespace cairn::incremental
