// SPDX-License-Identifier: BSD-3-Clause
// ./dev scales: solves the same graphs in other numbers, with every optimizer and linear solver on
// offer, and says where the estimate is another without a word.
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/threads.hpp"
#include "trial.hpp"

namespace cairn::scales {
namespace {

struct Options {
  std::string graph, change, method;
  std::vector<std::string> without;
  bool few = false, verbose = false;
};

void add_options(CLI::App& app, Options& options) {
  app.add_option("--graph", options.graph, "only graphs whose name contains this");
  app.add_option("--change", options.change, "only changes whose name contains this");
  app.add_option("--method", options.method, "only methods whose name contains this");
  app.add_option("--without", options.without, "no methods whose name contains this; repeatedly")
      ->expected(1)
      ->take_all();
  app.add_flag("--few", options.few, "optimizers and linear solvers by their defaults only");
  app.add_flag("--verbose", options.verbose,
               "every run that is not right, not only those that are wrong");
  app.footer(
      "Ends with 1 where an optimizer converged to another estimate, and with 2 where it "
      "cannot be said.");
}

bool contains(const std::string& name, const std::string& part) {
  return name.find(part) != std::string::npos;
}

/// What a row of the second table is about: "levenberg_marquardt, pcg".
std::string without_options(const Method& method) {
  const std::string optimizer = parse_component(method.optimizer).name;
  if (method.linear_solver.empty()) return optimizer;
  return optimizer + ", " + parse_component(method.linear_solver).name;
}

/// How often each verdict was given: same, honest, wrong.
struct Counts {
  std::array<int, 3> of{};
  void add(Verdict verdict) { ++of[static_cast<std::size_t>(verdict)]; }
};

class Campaign {
 public:
  explicit Campaign(const Options& options)
      : options_(options), methods_(options.few ? few_methods() : all_methods()) {
    std::erase_if(methods_, [&](const Method& method) {
      const auto excluded = [&](const std::string& name) { return contains(method.spec(), name); };
      return !contains(method.spec(), options.method) ||
             std::ranges::any_of(options.without, excluded);
    });
    for (const Method& method : methods_) optimizers_.push_back(method.make(registry_));
  }

  void run(const Problem& problem) {
    if (!contains(problem.name, options_.graph)) return;
    const Reference reference = solve_reference(problem, registry_);
    for (const Change& change : all_changes()) {
      if (contains(change.name, options_.change)) run(problem, reference, change);
    }
    std::fprintf(stderr, "%s\n", problem.name.c_str());
  }

  void print() const {
    std::printf(
        "\n| change | same | said not to have converged | wrong |\n| --- | ---: | ---: | ---: |\n");
    for (const Change& change : all_changes()) {
      if (const auto row = by_change_.find(change.name); row != by_change_.end())
        print(row->first, row->second);
    }
    std::printf(
        "\n| optimizer and linear solver | same | said not to have converged | wrong |\n| --- | "
        "---: | ---: | ---: |\n");
    for (const auto& [name, counts] : by_method_) print(name, counts);
    print("in all", all_);
  }

  bool any_wrong() const { return all_.of[2] > 0; }

 private:
  void run(const Problem& problem, const Reference& reference, const Change& change) {
    const Graph start = changed_problem(problem, change, registry_);
    for (std::size_t m = 0; m < methods_.size(); ++m) {
      const std::string name = methods_[m].spec(), row = without_options(methods_[m]);
      const Outcome outcome = try_out(reference, change, start, *optimizers_[m]);
      by_change_[change.name].add(outcome.verdict);
      by_method_[row].add(outcome.verdict);
      all_.add(outcome.verdict);
      if (outcome.verdict == Verdict::wrong ||
          (options_.verbose && outcome.verdict == Verdict::honest)) {
        std::printf("%s: %s, %s, %s: %s\n", outcome.verdict == Verdict::wrong ? "WRONG" : "said so",
                    problem.name.c_str(), change.name.c_str(), name.c_str(), outcome.words.c_str());
        std::fflush(stdout);
      }
    }
  }

  static void print(const std::string& name, const Counts& counts) {
    std::printf("| %s | %d | %d | %d |\n", name.c_str(), counts.of[0], counts.of[1], counts.of[2]);
  }

  Options options_;
  Registry registry_;
  std::vector<Method> methods_;
  std::vector<std::unique_ptr<Optimizer>> optimizers_;
  std::map<std::string, Counts> by_change_, by_method_;
  Counts all_;
};

int run(const Options& options) {
  set_threads(1);  // the graphs are small, and results do not depend on it
  Campaign campaign(options);
  for (const Problem& problem : all_problems()) campaign.run(problem);
  campaign.print();
  return campaign.any_wrong() ? 1 : 0;
}

}  // namespace
}  // namespace cairn::scales

int main(int argc, char** argv) {
  CLI::App app("Solves graphs in other numbers with every optimizer and linear solver.");
  cairn::scales::Options options;
  cairn::scales::add_options(app, options);
  try {
    app.parse(argc, argv);
    return cairn::scales::run(options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn_scales: %s\n", error.what());
    return 2;
  }
}
