// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/problem_setup.hpp"

#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/optimization.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/table.hpp"

namespace cairn::app {

OptionFields<ProblemOptions> ProblemOptions::loss_fields() {
  return OptionFields<ProblemOptions>()
      .component("loss", &ProblemOptions::loss, {"loss"},
                 "robust loss, such as huber:scale=1 [none]")
      .text("loss_on", &ProblemOptions::loss_on,
            "factors that the loss applies to: all, loops, or those of a type by its tag")
      .placeholder("WHICH")
      .suggest({"all", "loops"});
}

OptionFields<ProblemOptions> ProblemOptions::fields() {
  return OptionFields<ProblemOptions>()
      .component("initial", &ProblemOptions::initial, {"initial_guess"},
                 "initial estimate: a name of kind initial_guess")
      .all_of(loss_fields())
      .part(
          &ProblemOptions::stop,
          OptionFields<Stop>()
              .integer("iterations", &Stop::max_iterations, 0, 1e9, "maximum number of iterations")
              .real("tolerance", &Stop::tolerance, 0.0, 1.0,
                    "stop when a step could lower chi2 by less than this fraction; 0: exactly N "
                    "times")
              .placeholder("T"));
}

OptionFields<ProblemOptions> ProblemOptions::limit_fields() {
  return OptionFields<ProblemOptions>().part(
      &ProblemOptions::stop,
      OptionFields<Stop>()
          .real("max_seconds", &Stop::max_seconds, 0.0, 1e9,
                "stop a run that takes longer, with its best estimate; 0: no limit")
          .placeholder("S"));
}

void keep_states(ProblemOptions& options) {
  if (options.initial == ProblemOptions().initial) options.initial.clear();
}

ProblemSetup::ProblemSetup(const ProblemOptions& options, Registry& registry)
    : initial_name_(options.initial),
      initial_(options.initial.empty() ? nullptr : registry.make<InitialGuess>(options.initial)),
      selector_(FactorSelector::parse(options.loss_on)) {
  if (!options.loss.empty()) loss_ = registry.make<Loss>(options.loss);
  if (options.loss.empty() && options.loss_on != "all") {
    throw Error(ErrorCode::usage, "--loss-on says where a loss applies, but there is no --loss");
  }
  if (selector_.kind() == FactorSelector::Kind::tag && !registry.has("factor", selector_.tag())) {
    throw Error(ErrorCode::usage,
                fmt::format("--loss-on: '{}' is neither all, loops nor a type of factors, such as "
                            "{}",
                            selector_.tag(), registry.names("factor").front()));
  }
}

std::vector<std::string> ProblemSetup::apply(Graph& graph, WatchedGuess::GoOn go_on) const {
  graph.set_loss(loss_, selector_);
  std::vector<std::string> notes;
  if (loss_ && std::ranges::none_of(select(graph, selector_), std::identity())) {
    notes.push_back("--loss-on selects no factor of this graph: none has the loss");
  }
  if (!initial_) return notes;
  for (std::string& note : compute_guess(graph, *initial_, initial_name_, std::move(go_on)))
    notes.push_back(std::move(note));
  return notes;
}

void ProblemSetup::look_again(Graph& graph, Optimizer& optimizer, std::string_view name,
                              const Stop& stop, Observer& observer, WatchedGuess::GoOn go_on,
                              Summary& summary) const {
  cairn::look_again(graph, {optimizer, name, initial_.get(), initial_name_}, stop, observer,
                    std::move(go_on), summary);
}

void note_the_end(Summary& summary, const Stop& stop, const Graph& graph) {
  cairn::note_the_end(summary, stop, graph, "--iterations");
}

int exit_code(const Summary& summary, const Stop& stop) {
  if (summary.status == Status::interrupted) return kExitInterrupted;
  return is_estimate(summary, stop) ? 0 : static_cast<int>(ErrorCode::numerical);
}

namespace {

/// An optimizer's option that chooses among solvers of its own, such as Ceres' linear_solver_type.
const OptionSpec* own_linear_solver_option(Registry& registry, const ComponentSpec& optimizer) {
  for (const OptionSpec& spec : registry.options(Optimizer::kKind, optimizer.name).specs()) {
    if (spec.name.starts_with(kLinearSolverOption) && spec.type != OptionType::component)
      return &spec;
  }
  return nullptr;
}

}  // namespace

bool takes_linear_solver(Registry& registry, const ComponentSpec& optimizer) {
  const OptionSpec* option =
      registry.options(Optimizer::kKind, optimizer.name).find(kLinearSolverOption);
  return option && option->type == OptionType::component;
}

ComponentSpec optimizer_spec(const std::string& optimizer, const std::string& linear_solver,
                             Registry& registry) {
  ComponentSpec spec = parse_component(optimizer);
  const bool takes = takes_linear_solver(registry, spec);
  const bool given = !linear_solver.empty();
  if (given && (!takes || spec.values.contains(kLinearSolverOption))) {
    throw linear_solver_refused(registry, spec);
  }
  if (takes) spec.values.emplace(kLinearSolverOption, given ? linear_solver : kDefaultLinearSolver);
  return spec;
}

Error linear_solver_refused(Registry& registry, const ComponentSpec& optimizer) {
  if (optimizer.values.contains(kLinearSolverOption)) {
    return {
        ErrorCode::usage,
        fmt::format("the linear solver of '{}' is given twice: by --linear-solver and as an option "
                    "of --optimizer",
                    optimizer.name)};
  }
  const OptionSpec* own = own_linear_solver_option(registry, optimizer);
  if (!own) {
    return {
        ErrorCode::usage,
        fmt::format("optimizer '{0}' does not take a linear solver; leave --linear-solver out, or "
                    "see cairn plugins {0} for its own options",
                    optimizer.name)};
  }
  return {
      ErrorCode::usage,
      fmt::format(
          "optimizer '{0}' brings linear solvers of its own; instead of --linear-solver use "
          "--optimizer {0}:{1}=NAME{2}",
          optimizer.name, own->name,
          own->choices.empty() ? std::string()
                               : fmt::format(" with NAME one of {}", joined(own->choices, ", ")))};
}

}  // namespace cairn::app
