// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <atomic>
#include <cmath>
#include <concepts>
#include <limits>
#include <stdexcept>

#include "block/supernodal_cholesky.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::block {
namespace {

/// Right-hand sides that are solved for together.
constexpr int kTogether = 8;

/// Adds a stretch to the list that starts at `begin`, to its last one where it follows on it.
void append(std::vector<Run>& runs, std::int64_t begin, const Run& run) {
  if (std::ssize(runs) > begin) {
    Run& last = runs.back();
    if (last.source + last.length == run.source && last.target + last.length == run.target) {
      last.length += run.length;
      return;
    }
  }
  runs.push_back(run);
}

}  // namespace

/// Lists for every supernode where its rows below are in the vector. What a task updates outside
/// itself goes to copies of its own, behind the permuted vector.
void SupernodalCholesky::plan_solve() {
  const auto nodes = symbolic_.supernodes();
  const auto offsets = symbolic_.offsets();
  const auto rows = symbolic_.rows();
  const auto size_of = [&](std::int32_t row) {
    return static_cast<std::int32_t>(offsets[row + 1] - offsets[row]);
  };
  gathers_.clear();
  gather_begin_.assign(1, 0);
  outside_.clear();
  outside_of_.assign(schedule_.tasks.size(), {0, 0});
  vector_rows_ = structure_->size();
  front_rows_ = 0;

  std::vector<std::int32_t> outside;
  std::vector<std::int64_t> copy_of(symbolic_.order().size());
  for (std::int32_t s = 0; s < std::ssize(nodes); ++s) {
    const Supernode& node = nodes[s];
    const std::int32_t t = schedule_.task_of[s];
    const std::int32_t end = t < 0 ? -1 : nodes[schedule_.tasks[t].end - 1].block_end;
    if (t >= 0 && schedule_.tasks[t].begin == s) {
      outside.clear();
      for (std::int32_t k = s; k < schedule_.tasks[t].end; ++k) {
        for (std::int64_t r = nodes[k].rows_begin; r < nodes[k].rows_end; ++r) {
          if (rows[r] >= end) outside.push_back(rows[r]);
        }
      }
      std::ranges::sort(outside);
      outside.erase(std::unique(outside.begin(), outside.end()), outside.end());
      outside_of_[t].first = std::ssize(outside_);
      for (const std::int32_t row : outside) {
        copy_of[row] = vector_rows_;
        append(outside_, outside_of_[t].first,
               {static_cast<std::int32_t>(offsets[row]), static_cast<std::int32_t>(vector_rows_),
                size_of(row)});
        vector_rows_ += size_of(row);
      }
      outside_of_[t].second = std::ssize(outside_);
    }

    std::int32_t target = node.columns;
    for (std::int64_t r = node.rows_begin; r < node.rows_end; ++r) {
      const bool copied = t >= 0 && rows[r] >= end;
      const std::int64_t source = copied ? copy_of[rows[r]] : offsets[rows[r]];
      append(gathers_, gather_begin_.back(),
             {static_cast<std::int32_t>(source), target, size_of(rows[r])});
      target += size_of(rows[r]);
    }
    gather_begin_.push_back(std::ssize(gathers_));
    front_rows_ = std::max<std::int64_t>(front_rows_, node.stride);
  }
}

template <class Real>
void SupernodalCholesky::substitute(Numbers<Real>& numbers, int width, bool marked) {
  const auto nodes = symbolic_.supernodes();
  const auto offsets = symbolic_.offsets();
  Real* const vector = numbers.vectors.data();
  const auto front_of = [&](std::size_t lane) {
    return numbers.fronts.data() + static_cast<std::int64_t>(lane) * front_rows_ * width;
  };
  const auto forward = [&](std::int32_t s, Real* front) {
    if (marked && !on_path_[s]) return;
    const Supernode& node = nodes[s];
    auto kernel = numbers.kernels->forward;
    if constexpr (std::same_as<Real, double>) {
      if (width > 1) kernel = kernels_->forward_many;
    }
    kernel(numbers.panels.data() + node.panel, node.stride, node.columns,
           vector + offsets[node.block_begin] * width, gathers_.data() + gather_begin_[s],
           static_cast<int>(gather_begin_[s + 1] - gather_begin_[s]), vector, front);
  };
  const auto backward = [&](std::int32_t s, Real* front) {
    const Supernode& node = nodes[s];
    auto kernel = numbers.kernels->backward;
    if constexpr (std::same_as<Real, double>) {
      if (width > 1) kernel = kernels_->backward_many;
    }
    kernel(numbers.panels.data() + node.panel, node.stride, node.columns, node.m,
           vector + offsets[node.block_begin] * width, gathers_.data() + gather_begin_[s],
           static_cast<int>(gather_begin_[s + 1] - gather_begin_[s]), vector, front);
  };
  const auto copies = [&](std::size_t t) {
    return std::span(outside_).subspan(outside_of_[t].first,
                                       outside_of_[t].second - outside_of_[t].first);
  };
  const auto for_each_task = [&](const auto& body) {
    std::atomic<std::size_t> next{0};
    const auto lane_loop = [&](std::size_t lane) {
      for (std::size_t t = next++; t < schedule_.tasks.size(); t = next++) body(t, front_of(lane));
    };
    for_each_chunk(static_cast<std::size_t>(schedule_.lanes), lane_loop);
  };

  for_each_task([&](std::size_t t, Real* front) {
    for (const Run& run : copies(t))
      std::fill_n(vector + std::int64_t{run.target} * width, run.length * width, Real{});
    for (std::int32_t s = schedule_.tasks[t].begin; s < schedule_.tasks[t].end; ++s)
      forward(s, front);
  });
  for (std::size_t t = 0; t < schedule_.tasks.size(); ++t) {
    for (const Run& run : copies(t)) {
      Real* target = vector + std::int64_t{run.source} * width;
      const Real* source = vector + std::int64_t{run.target} * width;
      for (std::int32_t k = 0; k < run.length * width; ++k) target[k] += source[k];
    }
  }
  for (const std::vector<std::int32_t>& level : schedule_.levels) {
    for (const std::int32_t s : level) forward(s, front_of(0));
  }
  for (std::size_t l = schedule_.levels.size(); l-- > 0;) {
    for (const std::int32_t s : schedule_.levels[l]) backward(s, front_of(0));
  }
  for_each_task([&](std::size_t t, Real* front) {
    for (const Run& run : copies(t)) {
      std::copy_n(vector + std::int64_t{run.source} * width, run.length * width,
                  vector + std::int64_t{run.target} * width);
    }
    for (std::int32_t s = schedule_.tasks[t].end; s-- > schedule_.tasks[t].begin;)
      backward(s, front);
  });
}

template <class Real>
void SupernodalCholesky::solve_in(Numbers<Real>& numbers, std::span<const double> g,
                                  std::span<double> x) {
  if (!numbers.factorized) throw std::logic_error("solve: there is no factorisation");
  const auto order = symbolic_.order();
  const auto offsets = symbolic_.offsets();
  const auto from = structure_->offsets();
  Real* p = numbers.vectors.data();
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (std::int64_t i = 0; i < offsets[k + 1] - offsets[k]; ++i)
      p[offsets[k] + i] = static_cast<Real>(g[from[order[k]] + i]);
  }
  substitute(numbers, 1);
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (std::int64_t i = 0; i < offsets[k + 1] - offsets[k]; ++i)
      x[from[order[k]] + i] = p[offsets[k] + i];
  }
}

void SupernodalCholesky::solve(std::span<const double> g, std::span<double> x) {
  solve_in(double_, g, x);
}
void SupernodalCholesky::solve_single(std::span<const double> g, std::span<double> x) {
  solve_in(single_, g, x);
}

void SupernodalCholesky::solve(std::span<const double> G, std::span<double> X, int columns) {
  if (!double_.factorized) throw std::logic_error("solve: there is no factorisation");
  const std::int64_t size = structure_->size();
  if (std::ssize(G) != size * columns || std::ssize(X) != size * columns)
    throw std::logic_error("solve: right-hand sides or solutions are not size × columns");
  double_.vectors.resize(vector_rows_ * kTogether);
  double_.fronts.resize(front_rows_ * schedule_.lanes * kTogether);
  const auto order = symbolic_.order();
  const auto offsets = symbolic_.offsets();
  const auto from = structure_->offsets();
  // Row by row, eight columns side by side; columns that there are not stay zero.
  const auto for_each_number = [&](int first, int count, auto visit) {
    for (std::size_t k = 0; k < order.size(); ++k) {
      for (std::int64_t i = 0; i < offsets[k + 1] - offsets[k]; ++i) {
        double* row = double_.vectors.data() + (offsets[k] + i) * kTogether;
        const std::int64_t at = from[order[k]] + i;
        for (int c = 0; c < count; ++c) visit(row[c], (first + c) * size + at);
        for (int c = count; c < kTogether; ++c) row[c] = 0.0;
      }
    }
  };
  for (int first = 0; first < columns; first += kTogether) {
    const int count = std::min(kTogether, columns - first);
    for_each_number(first, count, [&](double& number, std::int64_t at) { number = G[at]; });
    substitute(double_, kTogether);
    for_each_number(first, count, [&](double& number, std::int64_t at) { X[at] = number; });
  }
}

/// Puts a row's supernode and all above it on the path.
void SupernodalCholesky::mark_path(std::int64_t row) {
  const auto nodes = symbolic_.supernodes();
  const auto offsets = symbolic_.offsets();
  const auto after = std::ranges::upper_bound(
      nodes, row, {}, [&](const Supernode& node) { return offsets[node.block_begin]; });
  for (auto s = static_cast<std::int32_t>(after - nodes.begin()) - 1; s >= 0 && !on_path_[s];
       s = nodes[s].parent)
    on_path_[s] = true;
}

void SupernodalCholesky::inverse_columns(std::span<const std::int64_t> scalars,
                                         std::span<double> X) {
  if (!double_.factorized) throw std::logic_error("inverse_columns: there is no factorisation");
  const std::int64_t size = structure_->size();
  if (std::ssize(X) != size * std::ssize(scalars))
    throw std::logic_error("inverse_columns: the result is not size × columns");
  double_.vectors.resize(vector_rows_ * kTogether);
  double_.fronts.resize(front_rows_ * schedule_.lanes * kTogether);
  const auto order = symbolic_.order();
  const auto position = symbolic_.position();
  const auto offsets = symbolic_.offsets();
  const auto from = structure_->offsets();
  for (std::int64_t first = 0; first < std::ssize(scalars); first += kTogether) {
    const auto count = std::min<std::int64_t>(kTogether, std::ssize(scalars) - first);
    std::fill_n(double_.vectors.begin(), size * kTogether, 0.0);
    on_path_.assign(symbolic_.supernodes().size(), false);
    for (std::int64_t c = 0; c < count; ++c) {
      const std::int64_t scalar = scalars[first + c];
      const auto block = std::ranges::upper_bound(from, scalar) - from.begin() - 1;
      const std::int64_t row = offsets[position[block]] + scalar - from[block];
      double_.vectors[row * kTogether + c] = 1.0;
      mark_path(row);
    }
    substitute(double_, kTogether, true);
    for (std::size_t k = 0; k < order.size(); ++k) {
      for (std::int64_t i = 0; i < offsets[k + 1] - offsets[k]; ++i) {
        const double* row = double_.vectors.data() + (offsets[k] + i) * kTogether;
        double* to = X.data() + first * size + from[order[k]] + i;
        for (std::int64_t c = 0; c < count; ++c) to[c * size] = row[c];
      }
    }
  }
}

double SupernodalCholesky::smallest_single_pivot(std::span<const double> d) const {
  if (!single_.factorized) throw std::logic_error("smallest_single_pivot: no factorisation");
  const auto order = symbolic_.order();
  const auto offsets = symbolic_.offsets();
  const auto from = structure_->offsets();
  double smallest = std::numeric_limits<double>::infinity();
  for (const Supernode& node : symbolic_.supernodes()) {
    const float* pivot = single_.panels.data() + node.panel;
    for (std::int32_t b = node.block_begin; b < node.block_end; ++b) {
      for (std::int64_t i = 0; i < offsets[b + 1] - offsets[b]; ++i, pivot += node.stride + 1)
        smallest = std::min(smallest, static_cast<double>(*pivot) / d[from[order[b]] + i]);
    }
  }
  return smallest;
}

double SupernodalCholesky::log_determinant() const {
  if (!double_.factorized) throw std::logic_error("log_determinant: there is no factorisation");
  double sum = 0.0;
  for (const Supernode& node : symbolic_.supernodes()) {
    const double* panel = double_.panels.data() + node.panel;
    for (std::int32_t j = 0; j < node.columns; ++j)
      sum += std::log(panel[static_cast<std::int64_t>(j) * node.stride + j]);
  }
  return 2.0 * sum;
}

}  // namespace cairn::block
