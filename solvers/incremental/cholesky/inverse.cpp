// SPDX-License-Identifier: BSD-3-Clause
#include "inverse.hpp"

#include <algorithm>
#include <vector>

#include "block/front.hpp"

namespace cairn::incremental {
namespace {

/// The inverse in the front of one supernode.
struct Front {
  UninitializedVector panel;  ///< Z_JJ whole, Z_RJ below it; laid out as the node's panel
  UninitializedVector below;  ///< Z_RR, both triangles; laid out as the node's update matrix
};

class Recursion {
 public:
  using Visit = std::function<void(std::int32_t, const double*, std::int64_t)>;
  Recursion(const System& system, const Tree& tree, const Visit& visit)
      : system_(system), tree_(tree), visit_(visit) {}

  void run() {
    for (const Node& node : tree_.nodes()) {
      if (node.live && node.parent < 0) descend(node);
    }
  }

 private:
  /// Fronts are kept as long as there are children to come: one for each level of the tree.
  void descend(const Node& root) {
    struct Visited {
      const Node* node;
      std::size_t next_child;
    };
    std::vector<Visited> path;
    compute(root, nullptr, 0);
    path.push_back({&root, 0});
    while (!path.empty()) {
      Visited& last = path.back();
      if (last.next_child == last.node->children.size()) {
        path.pop_back();
        continue;
      }
      const Node& child = tree_.nodes()[last.node->children[last.next_child++]];
      compute(child, last.node, path.size());
      path.push_back({&child, 0});
    }
  }

  void compute(const Node& node, const Node* parent, std::size_t depth) {
    if (fronts_.size() <= depth) fronts_.resize(depth + 1);
    Front& front = fronts_[depth];
    const std::size_t size = static_cast<std::size_t>(node.stride) * node.columns;
    if (front.panel.size() < size) front.panel = UninitializedVector(size);
    if (parent) gather(node, *parent, fronts_[depth - 1], front);
    const auto room = static_cast<std::size_t>(block::room_to_invert(node.columns, node.m));
    if (room_.size() < room) room_ = UninitializedVector(room);
    block::invert_front(tree_.kernels(), node.panel.data(), node.stride, node.columns, node.m,
                        front.below.data(), front.panel.data(), room_.data());
    std::int64_t row = 0;
    for (const std::int32_t v : node.own_variables()) {
      visit_(v, front.panel.data() + row * node.stride + row, node.stride);
      row += system_.size(v);
    }
  }

  /// Z_RR out of the parent's front, block by block: the separator need not have its order.
  void gather(const Node& node, const Node& parent, const Front& above, Front& front) {
    const std::int64_t stride = node.update_stride(), lead = node.columns % 8;
    const std::size_t size = static_cast<std::size_t>(node.below()) * stride;
    if (front.below.size() < size) front.below = UninitializedVector(size);
    std::fill_n(front.below.begin(), size, 0.0);
    const double* const panel = above.panel.data();
    const double* const rest = above.below.data();
    const auto separator = node.separator();
    std::int64_t j = 0;
    for (std::size_t b = 0; b < separator.size(); ++b) {
      const std::int32_t width = system_.size(separator[b]), from_j = node.rows_above[b];
      for (std::int32_t c = 0; c < width; ++c, ++j) {
        double* out = front.below.data() + j * stride + lead;
        const std::int64_t column = from_j + c;
        for (std::size_t a = 0; a < separator.size(); ++a) {
          const std::int32_t height = system_.size(separator[a]);
          const std::int64_t row = node.rows_above[a];
          const double* source;
          std::int64_t step = 1;
          if (column < parent.columns) {
            source = panel + column * parent.stride + row;
          } else if (row < parent.columns) {
            source = panel + row * parent.stride + column;
            step = parent.stride;
          } else {
            source = rest + parent.update_place(static_cast<std::int32_t>(row),
                                                static_cast<std::int32_t>(column));
          }
          for (std::int32_t r = 0; r < height; ++r) *out++ = source[r * step];
        }
      }
    }
  }

  const System& system_;
  const Tree& tree_;
  const Visit& visit_;
  std::vector<Front> fronts_;  // by depth
  UninitializedVector room_;
};

}  // namespace

void diagonal_of_inverse(
    const System& system, const Tree& tree,
    const std::function<void(std::int32_t, const double*, std::int64_t)>& visit) {
  Recursion(system, tree, visit).run();
}

}  // namespace cairn::incremental
