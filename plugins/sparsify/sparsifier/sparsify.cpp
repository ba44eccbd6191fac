// SPDX-License-Identifier: BSD-3-Clause
#include "sparsify.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "blanket_matrices.hpp"
#include "cairn/geometry/correlated_pair.hpp"
#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/linear/marginals.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/timed.hpp"
#include "dense/products.hpp"
#include "recovery.hpp"
#include "tree.hpp"

namespace cairn::sparsify {
namespace {

using Clock = std::chrono::steady_clock;
/// So often it is asked whether to go on with a blanket.
constexpr std::chrono::milliseconds kAskEvery(10);
/// Nats by which the divergence of a blanket may be off by rounding of its determinants.
constexpr double kRounding = 1e-9;
/// Nodes that leave together, at most: their blanket is a dense matrix.
constexpr std::ptrdiff_t kLargestGroup = 50;

/// B Ω Bᵀ, packed: the information of a choice's models in the residuals of their types. Throws
/// `Error` (numerical) where rounding has made it indefinite.
std::vector<double> whole_information(const Marginal& marginal, const FactorChoice& choice,
                                      const std::vector<double>& information) {
  int rows = 0, columns = 0;
  for (const int number : choice) {
    rows += marginal.predictions[number].type->residual_size();
    columns += marginal.dense.models[number].size;
  }
  const Eigen::Map<const Matrix> Omega(information.data(), columns, columns);
  if (rows == columns) return pack(Omega);
  Matrix B = Matrix::Zero(rows, columns);
  int row = 0, column = 0;
  for (const int number : choice) {
    const Marginal::Prediction& of = marginal.predictions[number];
    const int m = of.type->residual_size(), n = marginal.dense.models[number].size;
    B.block(row, column, m, n) = m == n ? Matrix(Matrix::Identity(m, m)) : of.directions;
    row += m;
    column += n;
  }
  std::vector<double> packed = pack(dense::congruent(B, Omega)), root(packed.size());
  if (!square_root(packed, rows, root)) {
    throw Error(ErrorCode::numerical,
                "the information of a new factor is indefinite by rounding: its neighbours' states "
                "are too uncertain");
  }
  return packed;
}

/// Throws the reason why nodes stay that leave more open than the pose of the whole.
[[noreturn]] void refuse_open(const Graph& graph, const LocalProblem& local,
                              const Marginal& marginal, Open open) {
  const DenseBlanket& dense = marginal.dense;
  const int all = dense.size() - (dense.absolute ? 0 : dense.node_sizes.front());
  throw Error(ErrorCode::numerical,
              fmt::format("{}: its factors do not determine the {} of its {} neighbours (their "
                          "information has rank {} of {}){}",
                          graph.describe_variable(local.removed.front()),
                          dense.absolute ? "absolute poses" : "relative poses",
                          dense.node_sizes.size(), all - marginal.open, all,
                          open == Open::refuse
                              ? "; sparsify:open=reduce replaces them by factors of lower rank"
                              : ""));
}

/// Both are watched as long as it lives.
class Watched {
 public:
  Watched(Topology& topology, FactorRecovery& recovery, const std::function<bool()>& go_on)
      : topology_(topology), recovery_(recovery) {
    topology.watch(go_on);
    recovery.watch(go_on);
  }
  ~Watched() {
    topology_.watch({});
    recovery_.watch({});
  }
  Watched(const Watched&) = delete;
  Watched& operator=(const Watched&) = delete;

 private:
  Topology& topology_;
  FactorRecovery& recovery_;
};

/// Alone, a blanket with one or two measured positions has a minimum far from that of the graph,
/// whose orientations all of them determine.
LocalMinimum local_minimum(const SparsifyOptions& options, const LocalProblem& local) {
  if (!options.resolve || (options.open == Open::reduce && local.absolute))
    return LocalMinimum::ignored;
  return options.linearize == LinearizeAt::graph ? LocalMinimum::measured
                                                 : LocalMinimum::linearized;
}

}  // namespace

Sparsify::Sparsify(std::unique_ptr<Topology> topology, std::unique_ptr<FactorRecovery> recovery,
                   SparsifyOptions options, std::unique_ptr<LinearSolver> solver)
    : topology_(std::move(topology)),
      recovery_(std::move(recovery)),
      options_(std::move(options)),
      solver_(std::move(solver)) {
  if (options_.fit != Fit::blanket) check_fit();
}

void Sparsify::check_fit() const {
  const std::string fit = fmt::format("sparsify:fit={}", to_string(options_.fit));
  if (topology_->whole()) {
    throw Error(ErrorCode::usage,
                fmt::format("topology {} has one factor that repeats Λ of the blanket, so that {} "
                            "has nothing to fit: leave fit at blanket, or take another topology",
                            options_.topology, fit));
  }
  if (options_.fit == Fit::graph && !recovery_->takes_background()) {
    throw Error(ErrorCode::usage,
                fmt::format("{} is not for recovery={}, which does not take account of the rest of "
                            "the graph: take ncfd or fd, without conservative, or fit=scaled",
                            fit, options_.recovery));
  }
  if (!solver_ || !query<Marginals>(*solver_)) {
    throw Error(ErrorCode::usage,
                fmt::format("{} needs a linear solver that gives covariances, which {} does not: "
                            "take linear_solver=block_cholesky",
                            fit, solver_ ? options_.linear_solver : "none"));
  }
}

/// Nodes that leave together: one by one, or those that factors connect, in the order in which
/// their first is asked for.
std::vector<std::vector<int>> Sparsify::groups(const WorkGraph& work,
                                               std::span<const int> nodes) const {
  std::vector<std::vector<int>> result;
  std::vector<bool> wanted(work.graph().variable_count());
  for (const int v : nodes) wanted[v] = true;
  for (const int v : nodes) {
    if (!wanted[v]) continue;
    wanted[v] = false;
    std::vector<int> group{v};
    for (std::size_t k = 0; options_.scheme != Scheme::single && k < group.size(); ++k) {
      for (const int other : work.blanket({&group[k], 1})) {
        if (!wanted[other] || std::ssize(group) >= kLargestGroup) continue;
        if (options_.scheme == Scheme::runs && std::abs(other - group[k]) != 1) continue;
        wanted[other] = false;
        group.push_back(other);
      }
    }
    result.push_back(std::move(group));
  }
  return result;
}

Sparsify::Recovered Sparsify::prepared(const DenseBlanket& dense, Matrix own_covariance,
                                       SparsificationSeconds& seconds) const {
  const Timed timed(seconds.recovery);
  if (options_.fit != Fit::graph || own_covariance.size() == 0)
    return {std::move(own_covariance), {}, project(dense, options_.projection)};
  DenseBlanket whole = within_graph(dense, own_covariance);
  BlanketProjection coordinates = project(whole, options_.projection);
  return {std::move(own_covariance), std::move(whole), std::move(coordinates)};
}

void Sparsify::recover(const Recovered& of, Solved& solved, SparsificationSeconds& seconds) {
  const Timed timed(seconds.recovery);
  const DenseBlanket& own = solved.marginal.dense;
  RecoveryProblem problem = of.coordinates.problem(of.whole ? *of.whole : own, solved.topology);
  if (of.whole) problem.background = background(*of.whole, own, of.coordinates);
  solved.recovery =
      topology_->whole() ? ClosedForm().recover(problem) : recovery_->recover(problem);
  if (options_.fit != Fit::scaled || of.own_covariance.size() == 0) return;
  scale(problem,
        certainty_scale(own, solved.topology, solved.recovery.information, of.own_covariance),
        solved.recovery);
}

/// The whole graph as it was when at most a hundredth of its variables fewer had left.
Sparsify::WholeGraph& Sparsify::whole_graph(const WorkGraph& work) {
  constexpr int kPart = 100;
  const Graph& graph = work.graph();
  int there = 0;
  for (int v = 0; v < graph.variable_count(); ++v) there += !work.gone(v);
  if (whole_ && whole_->graph.variable_count() - there <= graph.variable_count() / kPart)
    return *whole_;
  Sparsification so_far;
  collect(work, so_far);
  Graph now = graph.clone();
  if (!so_far.removed_variables.empty()) apply(so_far, now);
  whole_ = std::make_unique<WholeGraph>(std::move(now), *solver_);
  return *whole_;
}

/// What the whole graph knows of a blanket; empty where that is not asked for, or not determined,
/// which is noted.
Matrix Sparsify::known_in_graph(const WorkGraph& work, const LocalProblem& local, Solved& solved,
                                SparsificationSeconds& seconds) {
  if (options_.fit == Fit::blanket) return {};
  const Timed timed(seconds.covariance);
  const auto by_itself = [&](const char* reason) {
    solved.notes.push_back(std::string(reason) + "; fitted to the blanket alone (fit=blanket)");
    return Matrix();
  };
  if (solved.marginal.open > 0) return by_itself("what leaves does not determine the neighbours");
  WholeGraph& whole = whole_graph(work);
  if (!whole.regular) return by_itself("the information of the whole graph is singular");
  std::vector<int> there;
  for (const int v : local.blanket) there.push_back(whole.graph.find(work.graph().id(v)).value());
  const Matrix joint = joint_covariance(whole.graph, whole.marginals, there);
  const std::optional<Matrix> own = own_covariance(solved.marginal.dense, joint);
  return own ? *own : by_itself("its covariance in the whole graph is singular");
}

Sparsify::Solved Sparsify::solve(const WorkGraph& work, const LocalProblem& local,
                                 SparsificationSeconds& seconds, bool in_graph) {
  Solved solved;
  {
    const Timed timed(seconds.marginalize);
    // A linear constraint has a mean, so that the minimum stays where it is by itself.
    solved.marginal = topology_->whole()
                          ? marginalize(work, local, LocalMinimum::ignored, &constraints_)
                          : marginalize(work, local, local_minimum(options_, local));
  }
  const DenseBlanket& dense = solved.marginal.dense;
  if (dense.models.empty()) return solved;
  // After a pose has left, what is open is open for want of measurements. Factors of lower rank
  // leave it open at the states where they were made, and no longer where the map has moved far.
  const bool landmarks =
      std::ranges::all_of(local.removed, [&](int v) { return is_point(work.graph().type(v)); });
  if (solved.marginal.open > 0 && !landmarks && options_.open == Open::refuse)
    refuse_open(work.graph(), local, solved.marginal, options_.open);
  Matrix known = in_graph ? known_in_graph(work, local, solved, seconds) : Matrix();
  const Recovered of = prepared(dense, std::move(known), seconds);
  const int nodes = static_cast<int>(std::ssize(dense.node_sizes));
  // One prior of those that there are models of, besides the factors between nodes.
  const int prior = dense.absolute ? 1 : 0;
  const int pairs = static_cast<int>(std::ssize(pair_models(dense)));
  const int all =
      pairs + (topology_->parts() ? static_cast<int>(std::ssize(prior_models(dense))) : prior);
  const bool bounded = options_.population.kind == Population::Kind::loss;
  std::string of_topology;
  for (int count = std::min(all, prior + options_.population.count(nodes));;) {
    try {
      {
        const Timed timed(seconds.topology);
        solved.topology = topology_->choose(dense, count);
        of_topology = topology_->note();
      }
      recover(of, solved, seconds);
    } catch (const Error&) {
      if (solved.marginal.open > 0)
        refuse_open(work.graph(), local, solved.marginal, options_.open);
      throw;
    }
    // A topology that does not grow any more has done what it can.
    const int size = static_cast<int>(std::ssize(solved.topology));
    if (!bounded || solved.recovery.kld <= options_.population.value + kRounding) break;
    if (count >= all || (size < count && !topology_->parts())) {
      solved.notes.push_back(
          fmt::format("population=loss:{:g} was not reached with all factors that topology={} has",
                      options_.population.value, options_.topology));
      break;
    }
    count = std::min(all, count + std::max(1, count / 8));
  }
  solved.notes.push_back(std::move(of_topology));
  for (std::size_t k = 0; k < solved.topology.size(); ++k)
    solved.information.push_back(
        whole_information(solved.marginal, solved.topology[k], solved.recovery.information[k]));
  return solved;
}

void Sparsify::add_factors(WorkGraph& work, const LocalProblem& local, const Solved& solved) {
  for (std::size_t k = 0; k < solved.topology.size(); ++k) {
    const std::vector<FactorModel>& models = solved.marginal.dense.models;
    const FactorChoice& choice = solved.topology[k];
    std::vector<int> nodes;
    std::vector<std::array<int, 2>> between;
    std::vector<double> measurement;
    for (const int number : choice) {
      std::vector<int> ends;
      for (const int of : models[number].nodes) {
        const int node = local.blanket[of];
        const auto at = std::ranges::find(nodes, node);
        ends.push_back(static_cast<int>(at - nodes.begin()));
        if (at == nodes.end()) nodes.push_back(node);
      }
      if (choice.size() > 1) between.push_back({ends.at(0), ends.at(1)});
      const std::vector<double>& z = solved.marginal.predictions[number].measurement;
      measurement.insert(measurement.end(), z.begin(), z.end());
    }
    const std::shared_ptr<const FactorType>& type =
        solved.marginal.predictions[choice.front()].type;
    if (nodes.size() == 1 && !topology_->whole()) {
      work.add_prior(type, nodes.front(), std::move(measurement), solved.information[k]);
    } else {
      work.add(choice.size() == 1 ? type : pair_type(type, between), std::move(nodes),
               std::move(measurement), solved.information[k]);
    }
  }
}

/// One type for each pattern, so that a graph has them in few pools.
std::shared_ptr<const FactorType> Sparsify::pair_type(
    const std::shared_ptr<const FactorType>& relative,
    const std::vector<std::array<int, 2>>& between) {
  for (const PairType& known : pair_types_) {
    if (known.relative == relative && known.between == between) return known.type;
  }
  pair_types_.push_back(
      {relative, between, std::make_shared<CorrelatedPair>(relative, between[0], between.at(1))});
  return pair_types_.back().type;
}

LocalProblem Sparsify::cropped(const WorkGraph& work, std::vector<int> group) const {
  LocalProblem local = crop(work, std::move(group), topology_->whole());
  local.parts = topology_->parts();
  return local;
}

void Sparsify::take_out(WorkGraph& work, std::vector<int> group, Sparsification& result) {
  const Graph& graph = work.graph();
  const LocalProblem local = [&] {
    const Timed timed(result.seconds.marginalize);
    return cropped(work, std::move(group));
  }();
  const auto refuse = [&](const std::string& reason) {
    for (const int v : local.removed) result.refused.push_back({graph.id(v), reason});
  };
  if (!local.refusal.empty()) return refuse(local.refusal);
  Solved solved;
  if (!local.blanket.empty()) {
    try {
      solved = solve(work, local, result.seconds, true);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::numerical) throw;
      return refuse(error.what());
    }
  }
  const bool replaced = !solved.topology.empty();
  if (replaced) {
    const auto n = static_cast<int>(std::ssize(local.blanket));
    result.mean_blanket = (result.problems * result.mean_blanket + n) / (result.problems + 1);
    ++result.problems;
    result.largest_blanket = std::max(result.largest_blanket, n);
    result.kld += solved.recovery.kld;
    result.not_converged += !solved.recovery.converged;
    for (const std::string& note : solved.notes) result.note(note);
  }
  // With a blanket of one node nothing that the factors say is about anything else; those within
  // the blanket stay then.
  for (const int f : local.factors) work.remove_factor(f);
  for (const int v : local.removed) work.remove_variable(v);
  add_factors(work, local, solved);
  if (!observer_) return;
  SparsificationRecord record;
  for (const int v : local.removed) record.removed.push_back(graph.id(v));
  for (const int v : local.blanket) record.blanket.push_back(graph.id(v));
  record.states = solved.marginal.states;
  record.variable_type = graph.type(local.removed.front()).tag();
  if (local.types.relative) record.factor_type = local.types.relative->tag();
  if (replaced) {
    record.dense = &solved.marginal.dense;
    record.recovery = &solved.recovery;
  }
  record.factors_before = static_cast<int>(std::ssize(local.factors));
  record.factors_after = static_cast<int>(std::ssize(solved.topology));
  observer_(record);
}

/// The change that led to where the work is.
void Sparsify::collect(const WorkGraph& work, Sparsification& result) {
  const Graph& graph = work.graph();
  for (int v = 0; v < graph.variable_count(); ++v) {
    if (work.gone(v)) result.removed_variables.push_back(v);
  }
  for (int f = 0; f < work.factor_count(); ++f) {
    const WorkFactor& factor = work.factor(f);
    if (factor.there && factor.position < 0) {
      Factor fresh{.type = factor.type,
                   .variables = {},
                   .measurement = factor.measurement,
                   .information = factor.information};
      for (const int v : factor.variables) fresh.variables.push_back(graph.id(v));
      result.factors.push_back(std::move(fresh));
    } else if (!factor.there && factor.position >= 0) {
      result.removed_factors.push_back(factor.position);
    }
  }
}

Sparsification Sparsify::remove(const Graph& graph, std::span<const int> nodes,
                                const std::function<bool(int)>& step) {
  Sparsification result;
  const Timed timed(result.seconds.total);
  WorkGraph work(graph);
  whole_ = nullptr;
  int done = 0;
  Clock::time_point asked = Clock::now();
  const Watched watched(*topology_, *recovery_, [&] {
    if (!step || Clock::now() - asked < kAskEvery) return true;
    const bool go_on = step(done);
    asked = Clock::now();
    return go_on;
  });
  try {
    for (std::vector<int>& group : groups(work, nodes)) {
      const int size = static_cast<int>(std::ssize(group));
      take_out(work, std::move(group), result);
      done += size;
      if (step && !step(done)) break;
    }
  } catch (const Interruption&) {  // in a blanket, which stays as it is
  }
  collect(work, result);
  return result;
}

std::vector<double> Sparsify::losses(const Graph& graph, std::span<const int> nodes) {
  const WorkGraph work(graph);
  std::vector<double> klds;
  SparsificationSeconds seconds;
  for (const int v : nodes) {
    const LocalProblem local = cropped(work, {v});
    double kld = std::numeric_limits<double>::infinity();
    if (local.refusal.empty()) {
      try {
        kld = local.blanket.empty() ? 0.0 : solve(work, local, seconds, false).recovery.kld;
      } catch (const Error& error) {
        if (error.code() != ErrorCode::numerical) throw;
      }
    }
    klds.push_back(kld);
  }
  return klds;
}

}  // namespace cairn::sparsify
