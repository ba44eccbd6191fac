// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <atomic>
#include <string>

#include <fmt/format.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/typed/covariance.hpp"
#include "calls.hpp"
#include "objects.hpp"

using namespace cairn::c;

namespace {

using cairn::Status;

static_assert(static_cast<int>(Status::converged) == CAIRN_CONVERGED);
static_assert(static_cast<int>(Status::max_iterations) == CAIRN_MAX_ITERATIONS);
static_assert(static_cast<int>(Status::diverged) == CAIRN_DIVERGED);
static_assert(static_cast<int>(Status::not_positive_definite) == CAIRN_NOT_POSITIVE_DEFINITE);
static_assert(static_cast<int>(Status::interrupted) == CAIRN_INTERRUPTED);

constexpr const char* kOptimizer = "levenberg_marquardt";
constexpr const char* kInitialGuess = "auto";
constexpr const char* kLinearSolver = "block_cholesky";

/// Calls a function of C after each iteration, and while the initial guess is computed.
class Interrupt final : public cairn::Observer {
 public:
  explicit Interrupt(const cairn_stop& stop) : stop_(stop) {}

  bool on_iteration(const cairn::Iteration& iteration, const cairn::Graph& /*graph*/,
                    const cairn::Values& /*values*/) override {
    return go_on({iteration.number, iteration.accepted ? 1 : 0, iteration.chi2, iteration.step_norm,
                  iteration.lambda, iteration.seconds});
  }
  /// Asks it. `iteration`: zeros where there is none.
  bool go_on(const cairn_iteration& iteration) {
    if (stop_.interrupt && !interrupted_ && stop_.interrupt(&iteration, stop_.data) != 0)
      interrupted_ = true;
    return !interrupted_;
  }
  /// Set for good by the first answer that is not 0.
  const std::atomic<bool>& flag() const { return interrupted_; }

 private:
  const cairn_stop& stop_;
  std::atomic<bool> interrupted_{false};
};

cairn::Stop stop_of(const cairn_stop& from) {
  cairn::Stop stop;
  stop.max_iterations = from.max_iterations;
  stop.tolerance = from.tolerance;
  stop.max_seconds = from.max_seconds;
  cairn::check(stop);
  return stop;
}

/// The notes of the initial guess, and then those of the summary.
cairn::Summary optimize(cairn::Graph& graph, cairn::Registry& registry, std::string_view optimizer,
                        std::string_view initial, const cairn_stop& given_stop) {
  cairn::Stop stop = stop_of(given_stop);
  const auto solver = registry.make<cairn::Optimizer>(cairn::with_suited_linear_solver(
      cairn::parse_component(optimizer), graph, registry));  // both before any work
  const auto guess = registry.make<cairn::InitialGuess>(initial);
  Interrupt observer(given_stop);
  stop.interrupt = &observer.flag();
  return cairn::optimize(graph, {*solver, optimizer, guess.get(), initial}, stop, observer,
                         [&](std::string_view, double) { return observer.go_on({}); });
}

std::vector<double> blocks_of(cairn_graph& from,
                              std::span<const std::pair<cairn::Id, cairn::Id>> pairs,
                              const char* linear_solver) {
  const std::string_view name = name_or(linear_solver, kLinearSolver);
  return cairn::call_plugin(
      [&] { return fmt::format("linear solver '{}'", name); },
      [&] { return cairn::detail::covariance_blocks(from.graph, pairs, name, *from.registry); });
}

}  // namespace

const char* cairn_status_name(int status) {
  const bool known = status >= CAIRN_CONVERGED && status <= CAIRN_INTERRUPTED;
  return known ? to_string(static_cast<Status>(status)).data() : "";
}

void cairn_stop_init(cairn_stop* stop) {
  if (!stop) return;
  const cairn::Stop defaults;
  *stop = {defaults.max_iterations, defaults.tolerance, defaults.max_seconds, nullptr, nullptr};
}

cairn_code cairn_graph_optimize(cairn_graph* graph, const char* optimizer, const char* initial,
                                const cairn_stop* stop, cairn_summary* summary) {
  return guarded([&] {
    cairn_graph& of = given(graph, "graph");
    cairn_stop defaults;
    cairn_stop_init(&defaults);
    const cairn::Summary result =
        optimize(of.graph, *of.registry, name_or(optimizer, kOptimizer),
                 name_or(initial, kInitialGuess), stop ? *stop : defaults);
    of.notes = joined(result.notes);
    of.doubts = joined(result.doubts);
    if (!summary) return;
    *summary = {static_cast<cairn_status>(result.status),
                static_cast<int>(result.iterations.size()), result.initial_chi2, result.final_chi2,
                result.seconds.total};
  });
}

cairn_code cairn_graph_marginals(cairn_graph* graph, const int64_t* ids, size_t id_count,
                                 const char* linear_solver, double* blocks, size_t size) {
  return guarded([&] {
    cairn_graph& of = given(graph, "graph");
    std::vector<std::pair<cairn::Id, cairn::Id>> pairs;
    for (const int v : variables_of(of.graph, ids, id_count))
      pairs.emplace_back(of.graph.id(v), of.graph.id(v));
    size_t expected = 0;
    cairn_graph_sizes(graph, ids, id_count, nullptr, &expected);
    expect_size(size, expected, "the marginals");
    const std::span<double> out = array(blocks, size, "blocks");
    std::ranges::copy(blocks_of(of, pairs, linear_solver), out.begin());  // symmetric, each
  });
}

cairn_code cairn_graph_covariance(cairn_graph* graph, int64_t a, int64_t b,
                                  const char* linear_solver, double* block, size_t size) {
  return guarded([&] {
    cairn_graph& of = given(graph, "graph");
    const std::array<int64_t, 2> ids{a, b};
    const std::vector<int> ends = variables_of(of.graph, ids.data(), ids.size());
    const auto rows = static_cast<size_t>(of.graph.type(ends[0]).tangent_size());
    const auto columns = static_cast<size_t>(of.graph.type(ends[1]).tangent_size());
    expect_size(size, rows * columns, "the covariance");
    const std::pair<cairn::Id, cairn::Id> pair(a, b);
    copy_by_rows(blocks_of(of, {&pair, 1}, linear_solver), rows, array(block, size, "block"));
  });
}
