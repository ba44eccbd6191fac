// SPDX-License-Identifier: BSD-3-Clause
#include "pcg/spanning_tree.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/graph/disjoint_sets.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn {
namespace {

struct Edge {
  std::int32_t a, b;
  std::int64_t entry;
};

/// All off-diagonal blocks, by entry.
std::vector<Edge> edges_of(const BlockStructure& s) {
  std::vector<Edge> edges;
  edges.reserve(static_cast<std::size_t>(s.entries() - s.blocks()));
  for (std::int32_t j = 0; j < s.blocks(); ++j) {
    for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e)
      edges.push_back({s.rows()[e], j, e});
  }
  return edges;
}

/// A forest with its roots, and the length of the way between two of its blocks.
class Forest {
 public:
  Forest(int blocks, const std::vector<Edge>& edges, const std::vector<double>& strength)
      : parent_(static_cast<std::size_t>(blocks), -1),
        depth_(static_cast<std::size_t>(blocks), -1),
        length_(static_cast<std::size_t>(blocks), 0.0) {
    std::vector<std::vector<std::pair<std::int32_t, double>>> neighbours(
        static_cast<std::size_t>(blocks));
    for (const Edge& edge : edges) {
      const double length = 1.0 / std::max(strength[edge.entry], 1e-100);
      neighbours[edge.a].emplace_back(edge.b, length);
      neighbours[edge.b].emplace_back(edge.a, length);
    }
    std::vector<std::int32_t> queue;
    for (std::int32_t root = 0; root < blocks; ++root) {
      if (depth_[root] >= 0) continue;
      depth_[root] = 0;
      queue.assign(1, root);
      for (std::size_t k = 0; k < queue.size(); ++k) {
        const std::int32_t at = queue[k];
        for (const auto& [next, length] : neighbours[at]) {
          if (depth_[next] >= 0) continue;
          parent_[next] = at;
          depth_[next] = depth_[at] + 1;
          length_[next] = length;
          queue.push_back(next);
        }
      }
    }
  }

  double distance(std::int32_t a, std::int32_t b) const {
    double sum = 0.0;
    while (a != b) {
      std::int32_t& deeper = depth_[a] >= depth_[b] ? a : b;
      sum += length_[deeper];
      deeper = parent_[deeper];
    }
    return sum;
  }

 private:
  std::vector<std::int32_t> parent_, depth_;
  std::vector<double> length_;  // of the edge to the parent
};

}  // namespace

std::vector<double> coupling_strengths(const BlockMatrix& H,
                                       const iterative::DiagonalBlocks& diagonal) {
  const BlockStructure& s = H.structure();
  std::vector<double> strength(static_cast<std::size_t>(s.entries()), 0.0);
  for_each_range(
      static_cast<std::size_t>(s.blocks()), 512, [&](std::size_t begin, std::size_t end) {
        std::vector<double> scaled, row;
        for (std::size_t j = begin; j < end; ++j) {
          const int columns = s.block_size(static_cast<int>(j));
          row.resize(static_cast<std::size_t>(columns));
          for (std::int64_t e = s.column_begin()[j] + 1; e < s.column_begin()[j + 1]; ++e) {
            const int i = s.rows()[e], rows = s.block_size(i);
            scaled.assign(H.block(e), H.block(e) + static_cast<std::ptrdiff_t>(rows) * columns);
            for (int c = 0; c < columns; ++c)
              iterative::forward_block(diagonal.block(i), rows, scaled.data() + c * rows);
            double sum = 0.0;
            for (int r = 0; r < rows; ++r) {
              for (int c = 0; c < columns; ++c) row[c] = scaled[c * rows + r];
              iterative::forward_block(diagonal.block(static_cast<int>(j)), columns, row.data());
              for (const double value : row) sum += value * value;
            }
            strength[e] = std::sqrt(sum);
          }
        }
      });
  return strength;
}

std::vector<std::int64_t> choose_subgraph(const BlockStructure& structure,
                                          const std::vector<double>& strength, std::int64_t extra) {
  std::vector<Edge> edges = edges_of(structure);
  std::stable_sort(edges.begin(), edges.end(), [&](const Edge& x, const Edge& y) {
    return strength[x.entry] > strength[y.entry];
  });
  DisjointSets components(structure.blocks());
  const auto rest = std::stable_partition(edges.begin(), edges.end(), [&](const Edge& edge) {
    return components.join(edge.a, edge.b);
  });
  std::vector<Edge> chosen(edges.begin(), rest);

  if (extra > 0 && rest != edges.end()) {
    const Forest forest(structure.blocks(), chosen, strength);
    std::vector<std::pair<double, Edge>> others;
    for (auto it = rest; it != edges.end(); ++it)
      others.emplace_back(strength[it->entry] * forest.distance(it->a, it->b), *it);
    const auto count = static_cast<std::ptrdiff_t>(
        std::min<std::int64_t>(extra, static_cast<std::int64_t>(others.size())));
    std::partial_sort(
        others.begin(), others.begin() + count, others.end(), [](const auto& x, const auto& y) {
          return x.first != y.first ? x.first > y.first : x.second.entry < y.second.entry;
        });
    for (std::ptrdiff_t k = 0; k < count; ++k) chosen.push_back(others[k].second);
  }

  std::vector<std::int64_t> entries;
  entries.reserve(chosen.size());
  for (const Edge& edge : chosen) entries.push_back(edge.entry);
  std::sort(entries.begin(), entries.end());
  return entries;
}

}  // namespace cairn
