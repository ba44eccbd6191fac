// SPDX-License-Identifier: BSD-3-Clause
// A linear solver whose exceptions are not cairn's, thrown where its option says; or it ends the
// program.
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"

namespace {

class FragileSolver final : public cairn::LinearSolver {
 public:
  explicit FragileSolver(std::string where) : where_(std::move(where)) { fail_in("construction"); }

  void analyze(const cairn::BlockStructure&) override { fail_in("analyze"); }
  cairn::Factorization factorize(const cairn::BlockMatrix&) override {
    fail_in("factorize");
    return {};
  }
  void solve(std::span<const double>, std::span<double>) override {}
  const cairn::LinearSolverStats& stats() const override { return stats_; }

 private:
  void fail_in(const std::string& place) const {
    if (where_ == place) throw std::runtime_error("the solver broke in " + place);
    if (where_ == "number" && place == "factorize") throw 7;
    if (where_ == "exit" && place == "factorize") std::exit(0);
  }

  std::string where_;
  cairn::LinearSolverStats stats_;
};

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::LinearSolver>(
      "fragile",
      cairn::OptionTable{}.choice("in", "factorize",
                                  {"construction", "analyze", "factorize", "number", "exit"},
                                  "where it throws; number: no exception but a number; exit: it "
                                  "ends the program as if all were well"),
      [](const cairn::Options& options, cairn::Registry&) {
        return std::make_unique<FragileSolver>(options.text("in"));
      });
}
