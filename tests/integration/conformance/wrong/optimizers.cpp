// SPDX-License-Identifier: BSD-3-Clause
// Gauss-Newton of cairn's own, with one thing wrong each.
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/solve/optimizer.hpp"

namespace {

using cairn::Graph, cairn::Observer, cairn::Optimizer, cairn::Status, cairn::Stop, cairn::Summary;

class Wrapped : public Optimizer {
 public:
  explicit Wrapped(std::unique_ptr<Optimizer> right) : right_(std::move(right)) {}
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    return right_->optimize(graph, stop, observer);
  }

 private:
  std::unique_ptr<Optimizer> right_;
};

/// One step, whatever is left.
struct StopsShort final : Wrapped {
  using Wrapped::Wrapped;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    Stop once = stop;
    once.max_iterations = stop.max_iterations > 0 ? 1 : 0;
    Summary summary = Wrapped::optimize(graph, once, observer);
    if (summary.status == Status::max_iterations) summary.status = Status::converged;
    return summary;
  }
};

struct IgnoresInterrupts final : Wrapped {
  using Wrapped::Wrapped;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    Stop deaf = stop;
    deaf.interrupt = nullptr;
    return Wrapped::optimize(graph, deaf, observer);
  }
};

/// Leaves the last states of a run that diverged instead of the best.
struct LeavesNan final : Wrapped {
  using Wrapped::Wrapped;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    Summary summary = Wrapped::optimize(graph, stop, observer);
    if (summary.status != Status::diverged) return summary;
    cairn::Values values = graph.values();
    values.pools.front().front() = std::numeric_limits<double>::quiet_NaN();
    graph.set_values(std::move(values));
    return summary;
  }
};

struct MovesFixed final : Wrapped {
  using Wrapped::Wrapped;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    std::vector<int> fixed;
    for (int v = 0; v < graph.variable_count(); ++v) {
      if (graph.fixed(v)) fixed.push_back(v);
      graph.set_fixed(v, v == 0);
    }
    Summary summary = Wrapped::optimize(graph, stop, observer);
    graph.set_fixed(0, false);
    for (const int v : fixed) graph.set_fixed(v);
    return summary;
  }
};

/// Keeps every run.
struct Remembers final : Wrapped {
  using Wrapped::Wrapped;
  Summary optimize(Graph& graph, const Stop& stop, Observer& observer) override {
    runs_.push_back(Wrapped::optimize(graph, stop, observer));
    return runs_.back();
  }

 private:
  std::vector<Summary> runs_;
};

template <class Wrong>
void add(cairn::Registrar& registrar, const char* name) {
  registrar.add<Optimizer>(name, {}, [](const cairn::Options&, cairn::Registry& registry) {
    return std::make_unique<Wrong>(registry.make<Optimizer>("gauss_newton"));
  });
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  add<StopsShort>(registrar, "stops_short");
  add<IgnoresInterrupts>(registrar, "ignores_interrupts");
  add<LeavesNan>(registrar, "leaves_nan");
  add<MovesFixed>(registrar, "moves_fixed");
  add<Remembers>(registrar, "remembers");
}
