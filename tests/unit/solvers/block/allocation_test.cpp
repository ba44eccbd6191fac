// SPDX-License-Identifier: BSD-3-Clause
// A program of its own: it counts every `operator new` of the process, cairn's libraries included,
// and every array that they ask for.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "block/selected_inverse.hpp"
#include "block/supernodal_cholesky.hpp"
#include "cairn/graph/gauge.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/runtime/aligned.hpp"
#include "cairn/runtime/threads.hpp"
#include "support/planar_graph.hpp"

namespace {

std::atomic<int> allocations{0};

void* allocate(std::size_t size, std::size_t alignment) {
  ++allocations;
  const std::size_t whole = (size + alignment - 1) / alignment * alignment;
  if (void* memory = std::aligned_alloc(alignment, whole)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return allocate(size, alignof(std::max_align_t));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace cairn {

// In the place of those of the core, which need not ask for memory anew.
void* allocate_aligned(std::size_t bytes) { return ::operator new (bytes, std::align_val_t{64}); }
void release_aligned(void* memory, std::size_t) noexcept {
  ::operator delete (memory, std::align_val_t{64});
}

namespace {

class AllocationTest : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    before_ = threads();
    set_threads(GetParam());
  }
  void TearDown() override { set_threads(before_); }
  int before_ = 0;
};

TEST_P(AllocationTest, AnIterationAllocatesNothingOnceTheStructureIsAnalysed) {
  const test::PlanarTypes types;
  const Graph graph = test::random_graph(types, 2000, 300, 5);
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(linearizer.structure().size()), x(g.size());
  block::SupernodalCholesky cholesky;
  cholesky.analyze(linearizer.structure(), "auto");
  Values values = graph.values(), moved = values;
  bool ok = true;
  const auto iterate = [&] {
    linearizer.linearize(values, H, g);
    ok &= cholesky.factorize(H).ok;
    cholesky.solve(g, x);
    linearizer.retract(values, x, moved);
    linearizer.chi2(moved);
  };
  iterate();  // the threads that oneTBB starts are made by now
  const int before = allocations;
  for (int k = 0; k < 3; ++k) iterate();
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(ok);
  EXPECT_GT(before, 0);  // or nothing was counted
}

TEST_P(AllocationTest, CovariancesOfAnIterationAllocateNothingOnceTheyWereComputed) {
  const test::PlanarTypes types;
  const Graph graph = test::random_graph(types, 2000, 300, 5);
  Linearizer linearizer(graph, resolve_gauge(graph).held);
  BlockMatrix H(linearizer.structure());
  std::vector<double> g(linearizer.structure().size()), column(g.size());
  linearizer.linearize(graph.values(), H, g);
  block::SupernodalCholesky cholesky;
  cholesky.analyze(linearizer.structure(), "auto");
  block::SelectedInverse inverse(cholesky);
  const std::vector<std::int64_t> last{linearizer.structure().size() - 1};
  bool ok = true;
  const auto iterate = [&] {
    ok &= cholesky.factorize(H).ok;
    inverse.compute();
    cholesky.inverse_columns(last, column);
  };
  iterate();
  const int before = allocations;
  for (int k = 0; k < 3; ++k) iterate();
  EXPECT_EQ(allocations - before, 0);
  EXPECT_TRUE(ok);
}

TEST(Allocations, OfArraysAreCountedWhateverTheirSize) {
  for (const std::size_t bytes : {100U, 10000U, 100000U, 10000000U}) {
    const int before = allocations;
    const AlignedVector array(bytes / sizeof(double));
    EXPECT_EQ(allocations - before, 1) << bytes;
  }
}

INSTANTIATE_TEST_SUITE_P(Threads, AllocationTest, ::testing::Values(1, 2));

}  // namespace
}  // namespace cairn
