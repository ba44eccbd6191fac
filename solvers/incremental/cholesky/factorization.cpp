// SPDX-License-Identifier: BSD-3-Clause
#include "factorization.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "block/front.hpp"
#include "block/schedule.hpp"

namespace cairn::incremental {
namespace {

constexpr block::CostModel kCost;
/// What a piece of a front is to take at most [ns by `kCost`].
constexpr double kPiece = 2e5;
/// Rows are divided at multiples of so many, the height of the kernels' tiles.
constexpr std::int64_t kRows = 24;

std::int32_t round_up(std::int32_t rows) { return (rows + 7) / 8 * 8; }

}  // namespace

/// The front of a node, how the work on it is divided where the time is limited, and what the
/// pieces take [ns by `kCost`]. A front that is not large, or whose time is not limited, is one
/// piece.
class Factorization::Front {
 public:
  Front(const System& of_system, Tree& of_tree, std::int32_t n, Pace& pace)
      : system(of_system),
        tree(of_tree),
        node(of_tree.node(n)),
        pace_(pace),
        in_pieces_(block::is_large(node.m) && pace.limited()) {}

  const System& system;
  const Tree& tree;
  Node& node;

  const Node& child(std::int64_t k) const {
    return tree.nodes()[node.children[static_cast<std::size_t>(k)]];
  }
  bool allows(double nanoseconds) const {
    return !in_pieces_ || pace_.allows(Work::factorize, nanoseconds);
  }
  /// Whether the whole may begin, where it is one piece.
  bool may_begin() const {
    return in_pieces_ || pace_.allows(Work::factorize, kCost.time(node.columns, node.below()));
  }

  /// Where a piece of so many doubles ends that begins at `next`.
  std::int64_t end_of_doubles(std::int64_t next, std::int64_t all) const {
    return in_pieces_ ? std::min(all, next + block::kTileZeroed) : all;
  }
  /// Columns of a child's update matrix.
  double of_child(const Node& child, std::int64_t columns) const {
    return kCost.extend_entry * static_cast<double>(columns) * child.below();
  }
  std::int64_t end_of_child(const Node& child, std::int64_t column, std::int64_t last) const {
    if (!in_pieces_) return last;
    const auto columns = static_cast<std::int64_t>(kPiece / of_child(child, 1));
    return std::min(last, column + std::max<std::int64_t>(8, columns));
  }
  /// Rows of the columns [first, last), those before being done.
  double of_rows(int first, int last, std::int64_t rows) const {
    return kCost.panel_flop * static_cast<double>(rows) * (last - first) * (first + last);
  }
  std::int64_t end_of_rows(int first, int last, std::int64_t row) const {
    return end_of(row, [&](std::int64_t end) { return of_rows(first, last, end - row); });
  }
  /// Rows [begin, end) of the update matrix's lower triangle, counted in the front.
  double of_update(std::int64_t begin, std::int64_t end) const {
    const double width = 0.5 * static_cast<double>(begin + end) - node.columns + 8.0;
    return kCost.update_flop * 2.0 * node.columns * width * static_cast<double>(end - begin);
  }
  std::int64_t end_of_update(std::int64_t row) const {
    return end_of(row, [&](std::int64_t end) { return of_update(row, end); });
  }

 private:
  /// `time` is that of the rows from `row` up to some other one.
  template <class Time>
  std::int64_t end_of(std::int64_t row, Time time) const {
    if (!in_pieces_) return node.stride;
    std::int64_t end = row + kRows;
    while (end < node.stride && time(end + kRows) <= kPiece) end += kRows;
    return std::min<std::int64_t>(node.stride, end);
  }

  Pace& pace_;
  bool in_pieces_;
};

void Factorization::begin(Tree& tree, double damping) {
  tree.put_affected_children_first();
  next_ = 0;
  progress_ = {};
  damping_ = damping;
}

std::int32_t Factorization::more(const System& system, Tree& tree, Pace& pace) {
  front_row_.resize(static_cast<std::size_t>(system.variables()), -1);
  for (; next_ < tree.affected().size(); ++next_, progress_ = {}) {
    Front front(system, tree, tree.affected()[next_], pace);
    if (!factorize(front)) return kPaused;
    if (progress_.failed >= 0) return bad_pivot(front);
  }
  return kDone;
}

/// The variable of the first pivot that is not positive.
std::int32_t Factorization::bad_pivot(const Front& front) {
  const Node& node = front.node;
  std::int64_t c = 0;
  for (const std::int32_t v : node.own_variables()) {
    for (const std::int64_t end = c + front.system.size(v); c < end; ++c) {
      const double pivot = node.panel[c * node.stride + c];
      if (!(pivot > 0.0) || !std::isfinite(pivot)) return v;
    }
  }
  return node.variables.front();
}

/// H's entries into the panel, which is zero before. From here on `front_row_` is that of the node.
void Factorization::assemble(Front& front) {
  const System& system = front.system;
  Node& node = front.node;
  double* panel = node.panel.data();
  const std::int64_t stride = node.stride;
  std::int32_t row = 0;
  for (const std::int32_t v : node.variables) {
    front_row_[v] = row;
    row += system.size(v);
  }
  for (const std::int32_t v : node.own_variables()) {
    const std::int32_t size = system.size(v), at = front_row_[v];
    double* columns = panel + at * stride;
    const double* diagonal = system.diagonal(v);
    for (std::int32_t c = 0; c < size; ++c) {
      for (std::int32_t r = 0; r < size; ++r) columns[c * stride + at + r] = *diagonal++;
      columns[c * stride + at + c] *= 1.0 + damping_;
    }
    for (const System::Link& link : system.links(v)) {
      const std::int32_t other = front_row_[link.other];
      if (other < at) continue;  // in a subtree, or done from the other side
      const std::int32_t rows = system.size(link.other);
      const double* block = system.block(link.entry);
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
bool Factorization::add_scattered(const Node& child, Front& front) {
  const System& system = front.system;
  Node& parent = front.node;
  const std::int32_t shift = child.columns / 8 * 8;
  // Element (row, column) of the parent's front, row ≥ column, is column_of(column)[row].
  const auto column_of = [&](std::int32_t column) {
    return column < parent.columns
               ? parent.panel.data() + std::int64_t{column} * parent.stride
               : parent.update.data() + parent.update_place(column, column) - column;
  };
  const auto separator = child.separator();
  std::int64_t& next = progress_.end;  // of the separator: those before are done
  std::int32_t j = 0;
  for (std::int64_t b = 0; b < next; ++b) j += system.size(separator[b]);
  for (; next < std::ssize(separator); ++next) {
    const std::size_t b = static_cast<std::size_t>(next);
    const std::int32_t width = system.size(separator[b]), to_j = front_row_[separator[b]];
    if (!front.allows(front.of_child(child, width))) return false;
    std::int32_t i = j;
    for (std::size_t a = b; a < separator.size(); ++a) {
      const std::int32_t height = system.size(separator[a]), to_i = front_row_[separator[a]];
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
  next = 0;
  return true;
}

/// Sets all of an array to zero.
bool Factorization::fill_with_zeros(std::span<double> array, const Front& front) {
  const std::int64_t all = std::ssize(array);
  for (std::int64_t& next = progress_.next; next < all; next = progress_.end) {
    progress_.end = front.end_of_doubles(next, all);
    if (!front.allows(kCost.panel_entry * static_cast<double>(progress_.end - next))) return false;
    std::fill(array.begin() + next, array.begin() + progress_.end, 0.0);
  }
  return true;
}

/// Adds columns [first, last) of the update matrix of a child that is `straight`, see `extend_add`.
bool Factorization::add_child(const Node& child, std::int32_t first, std::int32_t last,
                              double* parent, std::int64_t parent_stride, const Front& front) {
  std::int64_t& column = progress_.end;
  column = std::max<std::int64_t>(column, first);
  while (column < last) {
    const std::int64_t end = front.end_of_child(child, column, last);
    if (!front.allows(front.of_child(child, end - column))) return false;
    front.tree.kernels().extend_add(child.spreads.data(), static_cast<int>(child.spreads.size()),
                                    static_cast<int>(column), static_cast<int>(end),
                                    child.update.data() + child.columns % 8, child.update_stride(),
                                    parent, parent_stride);
    column = end;
  }
  column = 0;
  return true;
}

/// Computes a node. Where its front is large and the time is limited, in pieces: false if there was
/// no time for the next one, and then the next call goes on there. `progress_.failed` says whether
/// there is a pivot that is not positive.
bool Factorization::factorize(Front& front) {
  using enum Progress::Part;
  if (!front.may_begin()) return false;
  Node& node = front.node;
  double* const panel = node.panel.data();
  const bool inner = node.below() > 0;
  const std::int64_t stride = node.stride;
  std::int64_t& next = progress_.next;
  switch (progress_.part) {
    case zero:
      if (!fill_with_zeros(node.panel, front)) return false;
      progress_.go_to(assemble_H);
      [[fallthrough]];
    case assemble_H:
      if (!front.allows(kCost.supernode * static_cast<double>(node.own))) return false;
      assemble(front);
      progress_.go_to(add_to_panel);
      [[fallthrough]];
    case add_to_panel:
      // What comes from children goes into the panel here, into the update matrix at the end.
      for (; next < std::ssize(node.children); ++next) {
        const Node& child = front.child(next);
        if (!child.straight) {
          progress_.scattered = true;
          continue;
        }
        if (!add_child(child, 0, child.panel_rows, panel, stride, front)) return false;
      }
      progress_.go_to(zero_update);
      [[fallthrough]];
    case zero_update:
      if (progress_.scattered && inner && !fill_with_zeros(node.update, front)) return false;
      progress_.go_to(add_scattered_ones);
      [[fallthrough]];
    case add_scattered_ones:
      // Panel and update matrix at once: the latter into zeros, to be added after the product.
      for (; progress_.scattered && next < std::ssize(node.children); ++next) {
        const Node& child = front.child(next);
        if (!child.straight && !add_scattered(child, front)) return false;
      }
      for (const std::int32_t v : node.variables) front_row_[v] = -1;
      if (progress_.scattered && inner) {
        UninitializedVector product(node.update.size());  // where memory ends, all is as it was
        progress_.children_part = std::exchange(node.update, std::move(product));
      }
      progress_.go_to(columns);
      [[fallthrough]];
    case columns:
      if (!factorize_columns(front)) return false;
      if (progress_.failed >= 0 || !inner) return true;
      progress_.go_to(update);
      next = node.columns / 8 * 8;
      [[fallthrough]];
    case update:
      for (; next < stride; next = progress_.end) {
        progress_.end = front.end_of_update(next);
        if (!front.allows(front.of_update(next, progress_.end))) return false;
        front.tree.kernels().update(panel, stride, node.columns, node.m, node.update.data(),
                                    static_cast<int>(next), static_cast<int>(progress_.end));
      }
      progress_.go_to(add_scattered_part);
      [[fallthrough]];
    case add_scattered_part:
      if (!add_children_part(front)) return false;
      progress_.go_to(add_to_update);
      [[fallthrough]];
    case add_to_update:
      for (; next < std::ssize(node.children); ++next) {
        const Node& child = front.child(next);
        if (!child.straight) continue;
        // The update matrix as if it were a part of the whole front.
        double* const whole =
            node.update.data() - node.columns * node.update_stride() - node.columns / 8 * 8;
        if (!add_child(child, child.panel_rows, child.below(), whole, node.update_stride(), front))
          return false;
      }
  }
  return true;
}

/// The panel, strip by strip if the front is large.
bool Factorization::factorize_columns(Front& front) {
  const block::Kernels& kernels = front.tree.kernels();
  Node& node = front.node;
  double* const panel = node.panel.data();
  const std::int64_t stride = node.stride;
  if (!block::is_large(node.m)) {
    progress_.failed = block::factor_front<double>(kernels, panel, stride, node.columns, node.m);
    return true;
  }
  std::int64_t& row = progress_.end;  // of the strip at hand: 0 before its pivots
  for (; progress_.next < node.columns; progress_.next += block::kStripColumns, row = 0) {
    const int first = static_cast<int>(progress_.next),
              last = std::min(node.columns, first + block::kStripColumns);
    if (row == 0) {
      const int below = std::min(node.stride, round_up(last));
      if (!front.allows(front.of_rows(first, last, below - first))) return false;
      const int failed = kernels.factor_panel(panel, stride, 0, first, last, below);
      if (progress_.failed < 0) progress_.failed = failed;
      row = below;
    }
    while (row < stride) {
      const std::int64_t end = front.end_of_rows(first, last, row);
      if (!front.allows(front.of_rows(first, last, end - row))) return false;
      kernels.factor_rows(panel, stride, 0, first, last, static_cast<int>(row),
                          static_cast<int>(end));
      row = end;
    }
  }
  return true;
}

/// What scattered children have added beside the product.
bool Factorization::add_children_part(Front& front) {
  const std::int64_t all = std::ssize(progress_.children_part);
  for (std::int64_t& next = progress_.next; next < all; next = progress_.end) {
    progress_.end = front.end_of_doubles(next, all);
    if (!front.allows(kCost.panel_entry * static_cast<double>(progress_.end - next))) return false;
    for (std::int64_t k = next; k < progress_.end; ++k)
      front.node.update[k] += progress_.children_part[k];
  }
  progress_.children_part = UninitializedVector();
  return true;
}

}  // namespace cairn::incremental
