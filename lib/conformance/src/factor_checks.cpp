// SPDX-License-Identifier: BSD-3-Clause
// Laws of factor types.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "cairn/conformance/repetition.hpp"
#include "cairn/evaluation/check_factor.hpp"
#include "factor_pool_checks.hpp"
#include "factor_samples.hpp"
#include "wrapping_checks.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-10;    // of sums of a few products, relative to their size
constexpr double kDifferences = 1e-6;  // of differences, relative to the largest entry

std::vector<double> unit_whitening(int size) {
  std::vector<double> packed;
  for (int row = 0; row < size; ++row) {
    packed.push_back(1.0);
    packed.insert(packed.end(), static_cast<std::size_t>(size - row - 1), 0.0);
  }
  return packed;
}

MatrixXd whole(const std::vector<double>& packed, int size) {
  MatrixXd U = MatrixXd::Zero(size, size);
  auto entry = packed.begin();
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column) U(row, column) = *entry++;
  }
  return U;
}

void check_sizes(const Subject& subject, Checker& check) {
  const FactorSamples samples(subject, check);
  const FactorType& type = samples.type();
  check.expect(type.arity() == static_cast<int>(samples.arity()) && type.arity() > 0,
               "arity is the number of variable_tags",
               [&] { return fmt::format("{} and {}", type.arity(), samples.arity()); });
  for (std::size_t v = 0; v < samples.arity(); ++v) {
    const int k = static_cast<int>(v);
    if (k >= type.arity()) break;
    const VariableType& variable = *samples.variables()[v];
    const auto compare = [&](std::string_view what, int here, int there) {
      check.expect(here == there, fmt::format("{} is that of the variable", what), [&] {
        return fmt::format("{} of variable {}: {}, but {} has {}", what, v, here, variable.tag(),
                           there);
      });
    };
    compare("tangent_size", type.tangent_size(k), variable.tangent_size());
    compare("ambient_size", type.ambient_size(k), variable.ambient_size());
  }
  check.expect(type.residual_size() > 0, "residual_size is positive",
               [&] { return fmt::format("it is {}", type.residual_size()); });
  check.expect(type.tag() == subject.name, "tag is the name on offer",
               [&] { return fmt::format("it is '{}'", type.tag()); });
  if (!type.is_relative()) return;
  const bool related = samples.arity() == 2 && samples.variables()[0] == samples.variables()[1] &&
                       samples.variables()[0]->lie_group() != nullptr;
  check.expect(related, "a relative factor has two variables of one Lie group",
               [] { return std::string("is_relative is true, and this does not hold"); });
}

void check_residual(const Subject& subject, Checker& check) {
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    const State r = type.residual(s);
    const bool finite =
        check.expect(is_finite(r), "the residual is finite", [&] { return "it is " + text_of(r); });
    if (!finite) return;
    FactorSample plain = s;
    plain.U = unit_whitening(type.type().residual_size());
    const State e = type.residual(plain);
    const VectorXd expected =
        whole(s.U, type.type().residual_size()) * Map<const VectorXd>(e.data(), std::ssize(e));
    check.within((Map<const VectorXd>(r.data(), std::ssize(r)) - expected).norm(),
                 kRounding * (1.0 + expected.norm()), "the residual is whitened: r = U e");
  });
}

void check_measurements(const Subject& subject, Checker& check) {
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    const auto normalize = [&](State& z) {
      Guarded in = Guarded::in_place("measurement", z);
      std::string problem =
          check.call("normalize", {&in}, [&] { return type.type().normalize(in.data()); });
      z = in.values();
      return problem;
    };
    State again = s.z;
    const std::string problem = normalize(again);
    check.expect(problem.empty(), "normalize accepts what it has accepted",
                 [&] { return "it says: " + problem; });
    check.within(norm(difference(again, s.z)), 1e-14 * (1.0 + norm(s.z)),
                 "normalize changes nothing when it is repeated");
    // A graph refuses what is not finite in any case; normalize need not, but must return.
    for (std::size_t k = 0; k < s.z.size(); ++k) {
      State broken = s.z;
      broken[k] = std::numeric_limits<double>::quiet_NaN();
      normalize(broken);
    }
  });
}

/// How `check_factor` judges one sample. Differences show nothing near a kink or a pole of the
/// residual: there, those of different steps differ from each other.
enum class Verdict { right, wrong, unclear };
Verdict judge(const std::array<FactorCheck, 3>& checks) {
  for (const FactorCheck& check : checks) {
    if (check.largest_deviation <= kDifferences) return Verdict::right;
    if (!std::isfinite(check.claimed)) return Verdict::wrong;
  }
  for (std::size_t a = 0; a < checks.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const FactorCheck &one = checks[a], &other = checks[b];
      if (one.variable == other.variable && one.row == other.row && one.column == other.column &&
          std::abs(one.numeric - other.numeric) <= 0.1 * std::abs(one.claimed - one.numeric))
        return Verdict::wrong;
    }
  }
  return Verdict::unclear;
}

void check_jacobians(const Subject& subject, Checker& check) {
  int judged = 0, unclear = 0;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    if (!is_finite(type.evaluate(s).r)) return;  // a finding of the residual
    std::vector<const double*> x;
    for (const State& state : s.x) x.push_back(state.data());
    std::array<FactorCheck, 3> checks;
    double step = 1e-3;
    for (FactorCheck& one : checks) {
      step *= 0.1;
      one = check.call("evaluate", [&] {
        return check_factor(type.type(), type.variables(), x, s.z, s.U, step);
      });
    }
    const Verdict verdict = judge(checks);
    ++judged;
    if (verdict == Verdict::unclear) ++unclear;
    const FactorCheck& shown = checks[1];
    if (shown.column < 0) {
      check.expect(verdict != Verdict::wrong,
                   "evaluate gives one residual, with Jacobians and without", [&] {
                     return fmt::format("row {}: {} with, {} without", shown.row, shown.claimed,
                                        shown.numeric);
                   });
      return;
    }
    check.expect(verdict != Verdict::wrong, "Jacobians are the derivatives of the residual", [&] {
      return fmt::format("variable {}, entry ({}, {}): {} where differences give {}",
                         shown.variable, shown.row, shown.column, shown.claimed, shown.numeric);
    });
  });
  check.describe("");
  check.expect(2 * unclear <= judged, "the residual is smooth at most states", [&] {
    return fmt::format("at {} of {} random states its differences depend on the step", unclear,
                       judged);
  });
}

/// A variable that no residual depends on is not determined by its factor, and does not belong to
/// it.
void check_influence(const Subject& subject, Checker& check) {
  std::vector<double> largest;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    largest.resize(type.arity(), 0.0);
    const Evaluation evaluation = type.evaluate(s);
    for (std::size_t v = 0; v < type.arity(); ++v) {
      const double norm = evaluation.J[v].norm();
      if (!(norm <= largest[v])) largest[v] = norm;
    }
  });
  check.describe("");
  for (std::size_t v = 0; v < largest.size(); ++v) {
    check.expect(largest[v] != 0.0, "every variable has an influence on the residual", [&] {
      return fmt::format("the Jacobian by variable {} is zero at all random states", v);
    });
  }
}

void check_propagate(const Subject& subject, Checker& check) {
  bool some = false;
  for_factors(subject, check, [&](const FactorSamples& type, const FactorSample& s) {
    FactorSample plain = s;
    plain.U = unit_whitening(type.type().residual_size());
    for (std::size_t target = 0; target < type.arity(); ++target) {
      const std::optional<State> at = type.propagate(plain, target);
      if (!at) continue;
      some = true;
      FactorSample moved = plain;
      moved.x[target] = *at;
      check.within(norm(type.residual(moved)), 1e-9 * (1.0 + norm(s.z)),
                   fmt::format("propagate to variable {} makes the error zero", target));
    }
    const LieGroup* group = type.variables()[0]->lie_group();
    if (!type.type().is_relative() || !group) return;
    some = true;
    FactorSample composed = plain;
    Guarded a("a", s.x[0]), b("b", s.z), ab("ab", s.x[0].size());
    check.call("compose", {&a, &b, &ab}, [&] { group->compose(a.data(), b.data(), ab.data()); });
    composed.x[1] = ab.values();
    check.within(norm(type.residual(composed)), 1e-9 * (1.0 + norm(s.z)),
                 "a relative factor has no error at x1 = x0 · z");
  });
  if (!some) check.note("it determines no variable from the others");
}

/// Residual and Jacobians of every factor, as they come.
State evaluate_all(const FactorSamples& samples, const std::vector<FactorSample>& factors) {
  State all;
  for (const FactorSample& s : factors) {
    std::vector<const double*> x;
    State r(samples.residual_size());
    std::vector<State> J;
    std::vector<double*> J_pointers;
    for (const State& state : s.x) x.push_back(state.data());
    for (std::size_t v = 0; v < samples.arity(); ++v)
      J.emplace_back(samples.residual_size() * samples.tangent(v));
    for (State& one : J) J_pointers.push_back(one.data());
    samples.type().evaluate(x.data(), s.z.data(), s.U.data(), r.data(), J_pointers.data());
    all.insert(all.end(), r.begin(), r.end());
    for (const State& one : J) all.insert(all.end(), one.begin(), one.end());
  }
  return all;
}

Repetition factor_uses(const Subject& subject, Checker& check) {
  const auto samples = std::make_shared<FactorSamples>(subject, check);
  if (!samples->fits() || !samples->sample(false)) return {};
  // All threads use the type's one object, each with factors of its own.
  return {"evaluate", 100, [samples, &check](std::uint64_t) {
            return [samples, factors = some_factors(
                                 *samples, static_cast<std::size_t>(check.options().samples))] {
              return evaluate_all(*samples, factors);
            };
          }};
}

}  // namespace

std::span<const Group> factor_groups() {
  static constexpr std::array<Group, 11> groups{{{"sizes", check_sizes},
                                                 {"measurement", check_measurements},
                                                 {"residual", check_residual},
                                                 {"Jacobians", check_jacobians},
                                                 {"influence", check_influence},
                                                 {"wrapping", check_wrapping},
                                                 {"pool", check_pools},
                                                 {"propagate", check_propagate},
                                                 {"memory", memory_group<factor_uses>, true},
                                                 {"threads", threads_group<factor_uses>, true},
                                                 {"time", note_time}}};
  return groups;
}

}  // namespace cairn::conformance
