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

#include "cairn/plugin/options.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/threads.hpp"
#include "trial.hpp"

namespace cairn::scales {
namespace {

constexpr const char* kHelp =
    "cairn_scales [--graph NAME] [--change NAME] [--method NAME] [--without NAME]...\n"
    "             [--few] [--verbose]\n"
    "\n"
    "  --graph, --change, --method   only those whose name contains NAME\n"
    "  --without                     no methods whose name contains NAME\n"
    "  --few                         optimizers and linear solvers by their defaults only\n"
    "  --verbose                     every run that is not right, not only those that are wrong\n"
    "\n"
    "Ends with 1 where an optimizer converged to another estimate.\n";

struct Options {
  std::string graph, change, method;
  std::vector<std::string> without;
  bool few = false, verbose = false;
};

Options parse(const std::vector<std::string>& words) {
  Options options;
  for (std::size_t k = 0; k < words.size(); ++k) {
    const auto value = [&] {
      if (k + 1 == words.size()) throw std::invalid_argument(words[k] + " needs a value");
      return words[++k];
    };
    if (words[k] == "--graph") {
      options.graph = value();
    } else if (words[k] == "--change") {
      options.change = value();
    } else if (words[k] == "--method") {
      options.method = value();
    } else if (words[k] == "--without") {
      options.without.push_back(value());
    } else if (words[k] == "--few") {
      options.few = true;
    } else if (words[k] == "--verbose") {
      options.verbose = true;
    } else {
      throw std::invalid_argument(kHelp);
    }
  }
  return options;
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
  try {
    return cairn::scales::run(
        cairn::scales::parse(std::vector<std::string>(argv + 1, argv + argc)));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn_scales: %s\n", error.what());
    return 2;
  }
}
