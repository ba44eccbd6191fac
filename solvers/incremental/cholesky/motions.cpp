// SPDX-License-Identifier: BSD-3-Clause
#include "motions.hpp"

#include <type_traits>
#include <utility>

namespace cairn::incremental {
namespace {

/// A motion, in metres and radians, that hardly turns what is left of another.
constexpr double kShort = 0.05;

/// out = M v with a square matrix; `size` may be a constant, which unrolls the loops.
template <class Size>
void multiply_square(Size size, const double* matrix, const double* vector, double* out) {
  for (std::int32_t r = 0; r < size; ++r) {
    double sum = 0.0;
    for (std::int32_t c = 0; c < size; ++c) sum += matrix[c * size + r] * vector[c];
    out[r] = sum;
  }
}
template <std::int32_t n>
using Constant = std::integral_constant<std::int32_t, n>;

}  // namespace

bool Motions::move(const System& system, Tree& tree, States& states, Node& node, double tolerance) {
  const auto separator = node.separator();
  const LieGroup& group = *states.type(separator.front()).lie_group();
  const std::int32_t size = system.size(separator.front()), square = size * size;
  const std::int32_t ambient = states.ambient(separator.front());
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
  group.adjoint(states.frame(separator.front()), matrix_.data());
  multiply(matrix_.data(), node.owed.data(), twist);
  // … and would be δ_i = Ad(F_i⁻¹) η of the others.
  double left = 0.0;
  const double* owed = node.owed.data();
  double* rigid = rigid_.data();
  for (const std::int32_t v : separator) {
    multiply(states.world_to_frame(v), twist, rigid);
    const double* weight = system.diagonal(v);
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
      states.type(v).retract_jacobian(states.x(v), rigid, matrix_.data());
      multiply(matrix_.data(), rest, rigid);
      turns_.push_back({tree.number_of(node), v, turned_steps_.size()});
      for (std::int32_t k = 0; k < size; ++k)
        turned_steps_.push_back(rigid[k] - std::exchange(rest[k], rigid[k]));
    }
    rest += size;
    rigid += size;
  }
  group.exp(twist, lead_.data());
  add(tree, states, node, lead_);
  ++leads_;
  return true;
}

/// All of the subtree is to be moved by a lead, after what it is to be moved by already.
void Motions::add(Tree& tree, States& states, Node& node, const std::vector<double>& lead) {
  const std::int32_t v = node.variables.front();
  states.log_other(tree.number_of(node), node.lead);
  node.settled_at = -1;
  if (node.lead.empty()) {
    node.lead = lead;
  } else {
    states.type(v).lie_group()->compose(lead.data(), node.lead.data(), node.lead.data());
    for (std::size_t k = static_cast<std::size_t>(states.ambient(v)); k < lead.size(); ++k)
      node.lead[k] += lead[k];
  }
}

void Motions::hand_down(Tree& tree, States& states, Node& node) {
  if (node.lead.empty()) return;
  const double* twist = node.lead.data() + states.ambient(node.variables.front());
  for (const std::int32_t v : node.own_variables()) states.lead(v, node.lead.data(), twist);
  for (const std::int32_t c : node.children) add(tree, states, tree.node(c), node.lead);
  states.log_other(tree.number_of(node), node.lead);
  node.lead.clear();
}

void Motions::settle(Tree& tree, States& states, std::int32_t variable) {
  const std::vector<Node>& nodes = tree.nodes();
  path_.clear();
  for (std::int32_t n = tree.node_of(variable); n >= 0 && nodes[n].settled_at != leads_;
       n = nodes[n].parent)
    path_.push_back(n);
  for (std::size_t k = path_.size(); k-- > 0;) {
    Node& node = tree.node(path_[k]);
    hand_down(tree, states, node);
    node.settled_at = leads_;
  }
}

void Motions::settle_all(Tree& tree, States& states) {
  tree.top_down(path_);
  for (const std::int32_t n : path_) hand_down(tree, states, tree.node(n));
}

bool Motions::read(const Tree& tree, const States& states, std::int32_t variable, double* x) const {
  const std::vector<Node>& nodes = tree.nodes();
  const std::int32_t first = tree.node_of(variable);
  if (first < 0) return false;
  const LieGroup* group = states.type(variable).lie_group();
  std::vector<double> total;
  for (std::int32_t n = first; n >= 0 && nodes[n].settled_at != leads_; n = nodes[n].parent) {
    const std::vector<double>& lead = nodes[n].lead;
    if (lead.empty()) continue;
    if (total.empty()) {
      total.assign(lead.begin(), lead.end());
    } else {
      group->compose(lead.data(), total.data(), total.data());
    }
  }
  if (total.empty()) return false;
  group->compose(total.data(), states.x(variable), x);
  return true;
}

Estimate settled(const Tree& tree, const States& states, Estimate estimate, const Leads& leads) {
  const std::vector<Node>& nodes = tree.nodes();
  constexpr std::int32_t kUnknown = -2, kNone = -1;
  std::vector<std::vector<double>> totals;                     // leads with all above them
  std::vector<std::int32_t> total_of(nodes.size(), kUnknown);  // by node: which total
  std::vector<std::int32_t> path;
  for (std::int32_t v = 0; v < estimate.size(); ++v) {
    const std::int32_t own = tree.node_of(v);
    if (own < 0) continue;
    const LieGroup* group = states.type(v).lie_group();
    for (std::int32_t n = own; n >= 0 && total_of[n] == kUnknown; n = nodes[n].parent)
      path.push_back(n);
    for (; !path.empty(); path.pop_back()) {
      const Node& node = nodes[path.back()];
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

}  // namespace cairn::incremental
