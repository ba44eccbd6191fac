// SPDX-License-Identifier: BSD-3-Clause
// One component of each kind, which throws when it is used.
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/lie/point.hpp"
#include "cairn/linear/linear_solver.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/loss.hpp"

namespace {

using namespace cairn;

[[noreturn]] void fail(const char* what) { throw std::runtime_error(what); }

struct ThrowingPoint : PointXY {
  static constexpr std::string_view kTag = "VERTEX_THROWS";
  template <class S>
  static Vector<S, 2> local(const Vector<S, 2>&, const Vector<S, 2>&) {
    fail("in local");
  }
};

class Solver final : public LinearSolver {
 public:
  void analyze(const BlockStructure&) override { fail("in analyze"); }
  Factorization factorize(const BlockMatrix&) override { return {}; }
  void solve(std::span<const double>, std::span<double>) override {}
  const LinearSolverStats& stats() const override { return stats_; }

 private:
  LinearSolverStats stats_;
};

struct Throwing final : Optimizer {
  Summary optimize(Graph&, const Stop&, Observer&) override { fail("in optimize"); }
};

struct Guess final : InitialGuess {
  std::vector<std::string> compute(Graph&) override { fail("in compute"); }
};

struct Text final : Format {
  bool can_read() const override { return true; }
  bool can_write() const override { return true; }
  std::vector<std::string> extensions() const override { return {"throws"}; }
  int detect(std::string_view) const override { return 100; }
  Graph read(std::string_view, const std::string&, Registry&, const ReadOptions&,
             ReadReport&) override {
    fail("in read");
  }
  std::string write(const Graph&) override { return "text"; }
};

struct Generating final : Generator {
  Simulation generate(Registry&, std::uint64_t) override { fail("in generate"); }
};

struct Bent final : Loss {
  void evaluate(std::span<const double>, std::span<double>, std::span<double>) const override {
    fail("in evaluate");
  }
  double second_derivative(double) const override { return 0.0; }
};

template <class Interface, class Wrong>
void add(Registrar& registrar) {
  registrar.add<Interface>("throws", {},
                           [](const Options&, Registry&) { return std::make_unique<Wrong>(); });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add_types("wrong_calls", {}, [](const Options&) {
    return TypeSet{.variables = {define_variable<ThrowingPoint>()}, .factors = {}};
  });
  add<LinearSolver, Solver>(registrar);
  add<Optimizer, Throwing>(registrar);
  add<InitialGuess, Guess>(registrar);
  add<Format, Text>(registrar);
  add<Generator, Generating>(registrar);
  add<Loss, Bent>(registrar);
}
