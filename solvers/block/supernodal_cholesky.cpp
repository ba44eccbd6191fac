// SPDX-License-Identifier: BSD-3-Clause
#include "block/supernodal_cholesky.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "block/ordering.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"

namespace cairn::block {
namespace {

/// Waiting is short: spinning is faster than sleeping, unless somebody else needs the core.
class Patience {
 public:
  void wait() {
    if (++spins_ < kSpins) {
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    } else {
      std::this_thread::yield();
    }
  }

 private:
  static constexpr int kSpins = 4000;
  int spins_ = 0;
};

}  // namespace

SupernodalCholesky::SupernodalCholesky(std::string_view kernels)
    : kernels_(choose_kernels(std::string(kernels).c_str())) {
  if (!kernels_) {
    throw Error(ErrorCode::usage,
                "this machine cannot run the kernels '" + std::string(kernels) + "'; use auto");
  }
  double_.kernels = kernels_;
  single_.kernels = kernels_->single;
}

void SupernodalCholesky::analyze(const BlockStructure& structure, std::string_view ordering,
                                 const CostModel& cost) {
  if (ordering == "auto") {
    Choice choice = choose(structure);
    ordering_ = std::move(choice.name);
    symbolic_ = std::move(choice.outline);
    symbolic_.complete(structure, cost);
  } else {
    ordering_ = ordering;
    symbolic_ = Symbolic(structure, order(structure, ordering), cost);
  }
  structure_ = &structure;
  version_ = structure.version();
  ++analyses_;
  schedule_ = Schedule(symbolic_, threads());
  failed_.assign(symbolic_.supernodes().size(), -1);
  gates_.assign(schedule_.gates, 0);
  plan_solve();
  const auto forget = []<class Real>(Numbers<Real>& numbers) {
    const FrontKernels<Real>* kernels = numbers.kernels;
    numbers = {};
    numbers.kernels = kernels;
  };
  forget(double_);
  forget(single_);
}

template <class Real>
void SupernodalCholesky::make_room(Numbers<Real>& numbers) const {
  using Array = typename Numbers<Real>::Array;
  numbers.panels = Array(symbolic_.panel_values());
  numbers.workspace = Array(schedule_.placement.size);
  numbers.vectors = decltype(numbers.vectors)(vector_rows_);
  numbers.fronts = decltype(numbers.fronts)(front_rows_ * schedule_.lanes);
}

template <class Real>
Factorization SupernodalCholesky::factorize_in(const BlockMatrix& H, Numbers<Real>& numbers) {
  if (!structure_ || H.structure().version() != version_) {
    throw std::logic_error("factorize: analyze this structure first");
  }
  double_.factorized = single_.factorized = false;
  if (numbers.panels.empty()) make_room(numbers);
  if (schedule_.lanes == 1) {
    for (std::int32_t s = 0; s < static_cast<std::int32_t>(failed_.size()); ++s)
      factorize_supernode(H, numbers, s, 0);
  } else {
    std::ranges::fill(gates_, 0);
    next_step_ = 0;
    const auto lane_loop = [&](std::size_t lane) {
      run_steps(H, numbers, static_cast<std::int64_t>(lane));
    };
    for_each_chunk(static_cast<std::size_t>(schedule_.lanes), lane_loop);
  }

  const auto failed =
      std::ranges::find_if(failed_, [](std::int32_t column) { return column >= 0; });
  if (failed == failed_.end()) {
    numbers.factorized = true;
    return {};
  }
  const Supernode& node = symbolic_.supernodes()[failed - failed_.begin()];
  const auto offsets = symbolic_.offsets();
  std::int32_t position = node.block_begin;
  while (offsets[position + 1] - offsets[node.block_begin] <= *failed) ++position;
  return {.ok = false, .failed_block = symbolic_.order()[position]};
}

template <class Real>
void SupernodalCholesky::factorize_supernode(const BlockMatrix& H, Numbers<Real>& numbers,
                                             std::int32_t s, std::int64_t lane) {
  const auto nodes = symbolic_.supernodes();
  const Supernode& node = nodes[s];
  Real* panel = numbers.panels.data() + node.panel;
  assemble(H, numbers, s, std::int64_t{node.stride} * node.columns);
  for (const std::int32_t c : symbolic_.children(s))
    add_to_panel(numbers, s, c, lane, 0, nodes[c].panel_rows);
  failed_[s] = factor_front(*numbers.kernels, panel, node.stride, node.columns, node.m);
  if (node.m == node.columns) return;
  numbers.kernels->update(panel, node.stride, node.columns, node.m, update_matrix(numbers, s, lane),
                          node.columns / 8 * 8, node.stride);
  for (const std::int32_t c : symbolic_.children(s))
    add_to_update(numbers, s, c, lane, nodes[c].panel_rows, nodes[c].m - nodes[c].columns);
}

/// Entries of H into the panel, `size` doubles of which are set to zero before.
template <class Real>
void SupernodalCholesky::assemble(const BlockMatrix& H, Numbers<Real>& numbers, std::int32_t s,
                                  std::int64_t size) {
  const auto entries = symbolic_.assembly(s);
  numbers.kernels->assemble(entries.data(), static_cast<int>(entries.size()), H.values().data(),
                            numbers.panels.data(),
                            numbers.panels.data() + symbolic_.supernodes()[s].panel, size);
}

template <class Real>
void SupernodalCholesky::add_to_panel(Numbers<Real>& numbers, std::int32_t s, std::int32_t c,
                                      std::int64_t lane, int first, int last) {
  const Supernode& node = symbolic_.supernodes()[s];
  add_child(numbers, c, lane, first, last, numbers.panels.data() + node.panel, node.stride);
}

template <class Real>
void SupernodalCholesky::add_to_update(Numbers<Real>& numbers, std::int32_t s, std::int32_t c,
                                       std::int64_t lane, int first, int last) {
  const Supernode& node = symbolic_.supernodes()[s];
  // The update matrix as if it were a part of the whole front.
  const std::int64_t stride = node.update_stride();
  Real* front = update_matrix(numbers, s, lane) - node.columns * stride - node.columns / 8 * 8;
  add_child(numbers, c, lane, first, last, front, stride);
}

/// Adds columns [first, last) of a child's update matrix to a front.
template <class Real>
void SupernodalCholesky::add_child(Numbers<Real>& numbers, std::int32_t c, std::int64_t lane,
                                   int first, int last, Real* front, std::int64_t stride) {
  const Supernode& child = symbolic_.supernodes()[c];
  numbers.kernels->extend_add(symbolic_.spreads().data() + child.spreads_begin,
                              static_cast<int>(child.spreads_end - child.spreads_begin), first,
                              last, update_matrix(numbers, c, lane) + child.columns % 8,
                              child.update_stride(), front, stride);
}

/// The diagonal block of the strip that begins with column `first`, those before being done.
template <class Real>
void SupernodalCholesky::factor_pivots(Numbers<Real>& numbers, std::int32_t s, int first) {
  const Supernode& node = symbolic_.supernodes()[s];
  const int last = std::min(node.columns, first + kStripColumns);
  const int failed = numbers.kernels->factor_panel(numbers.panels.data() + node.panel, node.stride,
                                                   block_of(first), first, last,
                                                   std::min(node.stride, (last + 7) / 8 * 8));
  if (failed_[s] < 0) failed_[s] = failed;
}

template <class Real>
void SupernodalCholesky::run_steps(const BlockMatrix& H, Numbers<Real>& numbers,
                                   std::int64_t lane) {
  const auto count = static_cast<std::int32_t>(schedule_.steps.size());
  for (std::int32_t k = next_step_++; k < count; k = next_step_++) {
    const Step& step = schedule_.steps[k];
    wait_for(step);
    run(step, H, numbers, lane);
    for (const std::int32_t gate : step.signals) signal(gate);
  }
}

void SupernodalCholesky::wait_for(const Step& step) {
  const auto wait = [&](std::int32_t gate, std::int32_t count) {
    const std::atomic_ref<std::int32_t> signalled(gates_[gate]);
    for (Patience patience; signalled.load(std::memory_order_acquire) < count;) patience.wait();
  };
  for (const Step::Wait& each : step.waits) {
    if (each.gate >= 0) wait(each.gate, each.count);
  }
  for (std::int32_t k = step.freed_begin; k < step.freed_end; ++k) wait(schedule_.freed[k], 1);
}

void SupernodalCholesky::signal(std::int32_t gate) {
  if (gate >= 0)
    std::atomic_ref<std::int32_t>(gates_[gate]).fetch_add(1, std::memory_order_acq_rel);
}

template <class Real>
void SupernodalCholesky::run(const Step& step, const BlockMatrix& H, Numbers<Real>& numbers,
                             std::int64_t lane) {
  const auto nodes = symbolic_.supernodes();
  if (step.kind == Step::Kind::task) {
    const Schedule::Task& task = schedule_.tasks[step.which];
    for (std::int32_t s = task.begin; s < task.end; ++s) {
      factorize_supernode(H, numbers, s, lane);
      if (nodes[s].parent >= task.end) signal(schedule_.ready[nodes[s].parent]);
    }
    return;
  }
  const std::int32_t s = step.which;
  const Supernode& node = nodes[s];
  Real* panel = numbers.panels.data() + node.panel;
  const auto begin = static_cast<int>(step.begin), end = static_cast<int>(step.end);
  const auto children = symbolic_.children(s).subspan(
      step.child, static_cast<std::size_t>(step.child_end - step.child));
  switch (step.kind) {
    case Step::Kind::task:
    case Step::Kind::finish:
      break;
    case Step::Kind::front:
      factorize_supernode(H, numbers, s, lane);
      break;
    case Step::Kind::zero:
      std::fill(panel + step.begin, panel + step.end, Real{});
      break;
    case Step::Kind::assemble:
      failed_[s] = -1;
      assemble(H, numbers, s, 0);
      break;
    case Step::Kind::add_to_panel:
      for (const std::int32_t c : children)
        add_to_panel(numbers, s, c, lane, begin, end > begin ? end : nodes[c].panel_rows);
      break;
    case Step::Kind::pivots:
      factor_pivots(numbers, s, step.first);
      break;
    case Step::Kind::rows:
      numbers.kernels->factor_rows(panel, node.stride, block_of(step.first), step.first, step.last,
                                   begin, end);
      if (step.pivots_follow) factor_pivots(numbers, s, step.last);
      break;
    case Step::Kind::subtract:
      numbers.kernels->subtract(panel, node.stride, step.first, step.last, begin, end);
      if (step.pivots_follow) factor_pivots(numbers, s, step.first);
      break;
    case Step::Kind::update:
      numbers.kernels->update(panel, node.stride, node.columns, node.m,
                              update_matrix(numbers, s, lane), begin, end);
      break;
    case Step::Kind::add_to_update:
      for (const std::int32_t c : children) {
        add_to_update(numbers, s, c, lane, end > begin ? begin : nodes[c].panel_rows,
                      end > begin ? end : nodes[c].m - nodes[c].columns);
      }
      break;
  }
}

template Factorization SupernodalCholesky::factorize_in(const BlockMatrix&, Numbers<double>&);
template Factorization SupernodalCholesky::factorize_in(const BlockMatrix&, Numbers<float>&);

}  // namespace cairn::block
