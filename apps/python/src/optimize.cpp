// SPDX-License-Identifier: BSD-3-Clause
// cairn.optimize and its summary.
#include <cmath>
#include <cstdint>
#include <exception>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "bound_graph.hpp"
#include "cairn/evaluation/optimization.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/typed/print.hpp"
#include "component_names.hpp"
#include "follower.hpp"
#include "graph_arrays.hpp"
#include "interrupt.hpp"
#include "named_guess.hpp"
#include "result_attributes.hpp"

namespace cairn::python {
namespace {

/// What a callback is given; the states are there while it runs.
struct BoundIteration {
  Iteration iteration;
  const Graph* graph = nullptr;
  const Values* values = nullptr;
};

py::array_t<double> states_at(const BoundIteration& bound, const py::object& type) {
  if (!bound.graph) {
    throw Error(ErrorCode::usage,
                "the states of an iteration are there while the callback runs; ask for them in it");
  }
  return states_of(*bound.graph, *bound.values, type);
}

/// Calls a function written in Python after each iteration.
class Callback final : public Observer {
 public:
  Callback(py::object function, const std::atomic<bool>& interrupt)
      : function_(std::move(function)), interrupt_(&interrupt) {}

  bool on_iteration(const Iteration& iteration, const Graph& graph, const Values& values) override {
    if (function_.is_none()) return true;
    const py::gil_scoped_acquire locked;
    try {
      const auto bound =
          std::make_shared<BoundIteration>(BoundIteration{iteration, &graph, &values});
      const py::object answer = function_(bound);
      bound->graph = nullptr;
      return !is_false(answer);
    } catch (py::error_already_set& error) {
      const bool obeyed = error.matches(PyExc_KeyboardInterrupt) && interrupt_->load();
      if (!obeyed) raised_ = std::current_exception();
      return false;
    }
  }

  /// What the function raised, if it did.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  py::object function_;
  const std::atomic<bool>* interrupt_;
  std::exception_ptr raised_;
};

/// The components that an optimisation is made of, and when it stops.
struct Plan {
  std::string optimizer_name;
  std::unique_ptr<Optimizer> optimizer;
  NamedGuess initial;
  Stop stop;

  Plan(const ComponentSpec& spec, const py::object& guess)
      : optimizer_name(spec.name),
        optimizer(default_registry().make<Optimizer>(spec)),
        initial(guess) {}
};

Summary optimize(BoundGraph& bound, const std::string& optimizer, const py::object& initial,
                 const py::object& loss, const std::string& loss_on, int max_iterations,
                 double tolerance, double max_seconds, const py::object& callback,
                 const py::kwargs& options) {
  const ComponentSpec spec = component_spec(optimizer, options, Optimizer::kKind, "optimize");
  Plan plan(with_suited_linear_solver(spec, bound.get(), default_registry()), initial);
  plan.stop.max_iterations = max_iterations;
  plan.stop.tolerance = tolerance;
  plan.stop.max_seconds = max_seconds;
  check(plan.stop);
  if (loss.is_none() && loss_on != "all")
    throw Error(ErrorCode::usage, "loss_on says where a loss applies, but there is no loss");
  const GraphUse use(bound);
  if (!loss.is_none()) use.graph().set_loss(loss_of(loss), selector_of(loss_on));
  const InterruptGuard guard;
  plan.stop.interrupt = &guard.flag();
  Callback observer(callback, guard.flag());
  Summary summary;
  {
    const py::gil_scoped_release unlocked;
    summary =
        optimize(use.graph(),
                 {*plan.optimizer, plan.optimizer_name, plan.initial.guess(), plan.initial.name()},
                 plan.stop, observer);
  }
  guard.absorb();
  observer.rethrow();
  return summary;
}

void bind_iteration(py::module_& module) {
  py::class_<BoundIteration, std::shared_ptr<BoundIteration>> type(
      module, "Iteration", "One iteration of an optimisation.");
  type.def("states", &states_at, py::arg("type"),
           "In a callback: the best estimates so far of all variables of a type, (n, m), in the "
           "order of `Graph.ids(type)`.")
      .def("__repr__", [](const BoundIteration& it) {
        return fmt::format("<cairn.Iteration {}: chi2 {:.6g}>", it.iteration.number,
                           it.iteration.chi2);
      });
  bind_fields<Iteration>(type,
                         [](const BoundIteration& it) -> const Iteration& { return it.iteration; });
}

void bind_summary(py::module_& module) {
  py::class_<Summary> type(module, "Summary", "How an optimisation ended.");
  type.def_property_readonly(
          "converged", [](const Summary& summary) { return summary.status == Status::converged; })
      .def_property_readonly(
          "iterations",
          [](const Summary& summary) {
            std::vector<BoundIteration> all;
            for (const Iteration& iteration : summary.iterations) all.push_back({iteration});
            return all;
          },
          "A list of Iteration.")
      .def("__repr__",
           [](const Summary& summary) {
             const std::string text = to_string(summary);
             return "<cairn.Summary " + text.substr(0, text.find('\n')) + ">";
           })
      .def("__str__", [](const Summary& summary) { return to_string(summary); });
  bind_fields<Summary>(type);
}

}  // namespace

void bind_optimize(py::module_& module) {
  bind_iteration(module);
  bind_summary(module);
  module.def(
      "optimize", &optimize, py::arg("graph"), py::arg("optimizer") = "levenberg_marquardt",
      py::kw_only(), py::arg("initial") = "auto", py::arg("loss") = py::none(),
      py::arg("loss_on") = "all", py::arg("max_iterations") = Stop().max_iterations,
      py::arg("tolerance") = Stop().tolerance, py::arg("max_seconds") = 0.0,
      py::arg("callback") = py::none(),
      R"(Minimises chi2 over the variables of a graph, and leaves the best estimate found in it.

optimizer: a name of `cairn.components("optimizer")`. Its options are further keyword arguments, such as
    linear_solver="cholmod" or linear_solver="cholmod:ordering=metis", or follow its name: "dogleg:linear_solver=cholmod".
initial: the initial estimate, a name of `cairn.components("initial_guess")`. "auto" takes the best by chi2 of the states
    as given and of the chordal relaxation, and where neither is plausible the incremental estimate too; None: the states
    as given.
loss, loss_on: as of `Graph.set_loss`, which is called beforehand; None: each factor keeps the loss that it has.
max_iterations: largest number of iterations.
tolerance: stop when a step could lower chi2 by less than this fraction; 0: exactly max_iterations.
max_seconds: limit of the time; 0: none.
callback: called with an Iteration after each; when it returns False, the optimisation ends.

Not converging is no exception: see `Summary.status`. Ctrl-C ends it too, with the status "interrupted" and the best
estimate, and without a KeyboardInterrupt. The interpreter's lock is released meanwhile.)");
  module.def("set_threads", &set_threads, py::arg("count"),
             "The number of threads that cairn computes with; 0: all cores. Results do not depend "
             "on it.");
}

}  // namespace cairn::python
