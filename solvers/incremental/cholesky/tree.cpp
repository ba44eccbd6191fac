// SPDX-License-Identifier: BSD-3-Clause
#include "tree.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "block/front.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;

}  // namespace

Tree::Tree(const Tree& other, const System& system, States& states,
           const std::vector<std::int32_t>& bound)
    : Tree(other) {
  system_ = &system;
  states_ = &states;
  bound_ = &bound;
}

// --- the affected part ---

void Tree::clear_affected() {
  for (const std::int32_t n : affected_) nodes_[n].affected = false;
  affected_.clear();
  affected_variables_ = 0;
  for (const std::int32_t v : fresh_) is_fresh_[v] = 0;
  fresh_.clear();
}

void Tree::make_room_for_variables() {
  const std::size_t size = static_cast<std::size_t>(system_->variables());
  if (node_of_.size() >= size) return;
  node_of_.resize(size, -1);
  is_fresh_.resize(size, 0);
  retired_.resize(size, 0);
  local_.resize(size, -1);
  front_row_.resize(size, -1);
}

void Tree::touch(std::int32_t variable) {
  make_room_for_variables();
  retired_[variable] = 0;
  if (node_of_[variable] < 0) {
    if (!is_fresh_[variable]) fresh_.push_back(variable);
    is_fresh_[variable] = 1;
    return;
  }
  for (std::int32_t n = node_of_[variable]; n >= 0 && !nodes_[n].affected; n = nodes_[n].parent) {
    nodes_[n].affected = true;
    affected_.push_back(n);
    affected_variables_ += nodes_[n].own;
  }
}

void Tree::retire(std::int32_t variable) {
  make_room_for_variables();
  assert(node_of_[variable] < 0 || nodes_[node_of_[variable]].affected);
  retired_[variable] = 1;
}

// --- numbers ---

void Tree::begin_factorization(double damping) {
  std::ranges::sort(affected_, {}, [&](std::int32_t n) { return nodes_[n].sequence; });
  factorized_ = 0;
  damping_ = damping;
}

std::int32_t Tree::factorize_more(Pace& pace) {
  for (; factorized_ < affected_.size(); ++factorized_) {
    Node& node = nodes_[affected_[factorized_]];
    if (!pace.allows(Work::factorize, kCost.time(node.columns, node.below()))) return kPaused;
    if (factorize_node(node)) continue;
    for (const std::int32_t v : node.own_variables()) {
      const std::int32_t row = front_row(node, v);
      for (std::int32_t c = row; c < row + system_->size(v); ++c) {
        const double pivot = node.panel[std::int64_t{c} * node.stride + c];
        if (!(pivot > 0.0) || !std::isfinite(pivot)) return v;
      }
    }
    return node.variables.front();
  }
  return -1;
}

/// H's entries into the panel.
void Tree::assemble(Node& node) {
  double* panel = node.panel.data();
  const std::int64_t stride = node.stride;
  std::fill(node.panel.begin(), node.panel.end(), 0.0);
  std::int32_t row = 0;
  for (const std::int32_t v : node.variables) {
    front_row_[v] = row;
    row += system_->size(v);
  }
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system_->size(v), at = front_row_[v];
    double* columns = panel + at * stride;
    const double* diagonal = system_->diagonal(v);
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) columns[c * stride + at + r] = *diagonal++;
      columns[c * stride + at + c] *= 1.0 + damping_;
    }
    for (const System::Link& link : system_->links(v)) {
      const std::int32_t other = front_row_[link.other];
      if (other < at) continue;  // in a subtree, or done from the other side
      const std::int32_t rows = system_->size(link.other);
      const double* block = system_->block(link.entry);
      if (link.other < v) {
        for (std::int32_t c = 0; c < size; ++c) {
          for (std::int32_t r = 0; r < rows; ++r) columns[c * stride + other + r] = *block++;
        }
      } else {
        for (std::int32_t r = 0; r < rows; ++r) {
          for (std::int32_t c = 0; c < size; ++c) columns[c * stride + other + r] = *block++;
        }
      }
    }
  }
}

/// A child whose separator has another order than the front: block by block. Into the panel and
/// what is there of the update matrix, which must have been computed.
void Tree::add_scattered(const Node& child, Node& parent) {
  const std::int32_t shift = child.columns / 8 * 8;
  // Element (row, column) of the parent's front, row ≥ column, is column_of(column)[row].
  const auto column_of = [&](std::int32_t column) {
    return column < parent.columns
               ? parent.panel.data() + std::int64_t{column} * parent.stride
               : parent.update.data() + parent.update_place(column, column) - column;
  };
  std::int32_t j = 0;
  const auto separator = child.separator();
  for (std::size_t b = 0; b < separator.size(); ++b) {
    const std::int32_t width = system_->size(separator[b]), to_j = front_row_[separator[b]];
    std::int32_t i = j;
    for (std::size_t a = b; a < separator.size(); ++a) {
      const std::int32_t height = system_->size(separator[a]), to_i = front_row_[separator[a]];
      for (std::int32_t c = 0; c < width; ++c) {
        const double* column = child.update.data() + std::int64_t{j + c} * child.update_stride() +
                               (i + child.columns - shift);
        if (to_i >= to_j) {
          double* target = column_of(to_j + c) + to_i;
          for (std::int32_t r = a == b ? c : 0; r < height; ++r) target[r] += column[r];
        } else {
          for (std::int32_t r = 0; r < height; ++r) column_of(to_i + r)[to_j + c] += column[r];
        }
      }
      i += height;
    }
    j += width;
  }
}

bool Tree::factorize_node(Node& node) {
  assemble(node);
  double* panel = node.panel.data();
  double* update = node.update.data();
  const bool inner = node.below() > 0;
  const std::int64_t stride = node.stride, update_stride = node.update_stride();
  // The update matrix starts with what comes from children; the product is taken off it later.
  bool scattered = false;
  for (const std::int32_t c : node.children) {
    const Node& child = nodes_[c];
    if (!child.straight) {
      scattered = true;
      continue;
    }
    kernels_->extend_add(child.spreads.data(), static_cast<int>(child.spreads.size()), 0,
                         child.panel_rows, child.update.data() + child.columns % 8,
                         child.update_stride(), panel, stride);
  }
  UninitializedVector children_part;
  if (scattered) {
    // Panel and update matrix at once: the latter into zeros, to be added after the product.
    if (inner) std::fill(node.update.begin(), node.update.end(), 0.0);
    for (const std::int32_t c : node.children) {
      if (!nodes_[c].straight) add_scattered(nodes_[c], node);
    }
    if (inner) std::swap(children_part, node.update), node.update.resize(children_part.size());
    update = node.update.data();
  }
  for (const std::int32_t v : node.variables) front_row_[v] = -1;

  if (block::factor_front<double>(*kernels_, panel, stride, node.columns, node.m) >= 0)
    return false;
  if (!inner) return true;
  kernels_->update(panel, stride, node.columns, node.m, update, node.columns / 8 * 8, node.stride);
  for (std::size_t k = 0; k < children_part.size(); ++k) update[k] += children_part[k];
  double* front = update - node.columns * update_stride - node.columns / 8 * 8;
  for (const std::int32_t c : node.children) {
    const Node& child = nodes_[c];
    if (!child.straight) continue;
    kernels_->extend_add(child.spreads.data(), static_cast<int>(child.spreads.size()),
                         child.panel_rows, child.below(), child.update.data() + child.columns % 8,
                         child.update_stride(), front, update_stride);
  }
  return true;
}

std::int32_t Tree::front_row(const Node& node, std::int32_t variable) const {
  std::int32_t row = 0;
  for (const std::int32_t v : node.variables) {
    if (v == variable) return row;
    row += system_->size(v);
  }
  return -1;
}

double Tree::log_determinant() const {
  double sum = 0.0;
  for (const Node& node : nodes_) {
    if (!node.live) continue;
    for (std::int64_t c = 0; c < node.columns; ++c)
      sum += std::log(node.panel[c * node.stride + c]);
  }
  return 2.0 * sum;
}

void Tree::top_down(std::vector<std::int32_t>& nodes) const {
  nodes.clear();
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n].live && nodes_[n].parent < 0) nodes.push_back(static_cast<std::int32_t>(n));
  }
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const auto& children = nodes_[nodes[k]].children;
    nodes.insert(nodes.end(), children.begin(), children.end());
  }
}

}  // namespace cairn::incremental
