// SPDX-License-Identifier: BSD-3-Clause
// Laws of variable types.
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/samples.hpp"

namespace cairn::conformance {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAccuracy = 1e-9;  // of a closed form, relative to the size of what it is given
constexpr double kDifferences = 1e-6;

/// Calls body(samples, x, delta) for random states and steps of all sizes.
template <class Body>
void for_steps(const Subject& subject, Checker& check, const Body& body) {
  const auto type = subject.registry.variable_type(subject.name);
  VariableSamples samples(*type, check, check.options().seed);
  for (const double length : samples.norms()) {
    for (int k = 0; k < check.options().samples; ++k) {
      check.sample("", [&] {
        const State x = samples.state(), delta = samples.step(length);
        check.describe(fmt::format("x = {}, δ = {}", text_of(x), text_of(delta)));
        body(samples, x, delta, kAccuracy * (1.0 + norm(x) + length));
      });
    }
  }
}

void check_retract_and_local(const Subject& subject, Checker& check) {
  for_steps(subject, check,
            [&](const VariableSamples& type, const State& x, const State& delta, double tolerance) {
              const State zero(type.tangent(), 0.0);
              check.within(type.apart(x, type.retract(x, zero)), tolerance, "retract(x, 0) = x");
              check.within(type.apart(x, x), tolerance, "local(x, x) = 0");
              const State y = type.retract(x, delta);
              check.within(norm(difference(type.local(x, y), delta)), tolerance,
                           "local(x, retract(x, δ)) = δ");
            });
}

/// D of `retract_jacobian` against central differences of local(y, retract(x, δ + ε)).
void check_retract_jacobian(const Subject& subject, Checker& check) {
  for_steps(
      subject, check, [&](const VariableSamples& type, const State& x, const State& delta, double) {
        const std::size_t n = type.tangent();
        Guarded from("x", x), step("delta", delta), out("D", n * n);
        check.call("retract_jacobian", {&from, &step, &out},
                   [&] { type.type().retract_jacobian(from.data(), step.data(), out.data()); });
        const State D = out.values(), y = type.retract(x, delta);
        const double h = 1e-5;
        double worst = 0.0;
        for (std::size_t c = 0; c < n; ++c) {
          State forward = delta, backward = delta;
          forward[c] += h;
          backward[c] -= h;
          const State up = type.local(y, type.retract(x, forward)),
                      down = type.local(y, type.retract(x, backward));
          for (std::size_t r = 0; r < n; ++r) {
            const double off = std::abs(D[c * n + r] - (up[r] - down[r]) / (2.0 * h));
            if (!(off <= worst)) worst = off;
          }
        }
        check.within(worst, kDifferences * (1.0 + norm(x) + norm(delta)),
                     "retract_jacobian is the derivative of retract");
      });
}

/// Three variables in one call, in place, the second of them constant.
void check_pools(const Subject& subject, Checker& check) {
  const auto type = subject.registry.variable_type(subject.name);
  VariableSamples samples(*type, check, check.options().seed);
  const std::size_t a = samples.ambient(), t = samples.tangent();
  for (int k = 0; k < check.options().samples; ++k) {
    check.sample("", [&] {
      State x, deltas;
      std::array<State, 3> states{samples.state(), samples.state(), samples.state()};
      const State first = samples.step(0.3), third = samples.step(0.3);
      for (const State& state : states) x.insert(x.end(), state.begin(), state.end());
      deltas = third;
      deltas.insert(deltas.end(), first.begin(), first.end());
      check.describe(fmt::format("three states x = {}, δ = {} and {}", text_of(x), text_of(first),
                                 text_of(third)));
      const std::array<std::int64_t, 3> offsets{static_cast<std::int64_t>(t), -1, 0};
      Guarded moved = Guarded::in_place("x", x);
      Guarded step("delta", deltas);
      check.call("retract", {&moved, &step}, [&] {
        type->retract(3, moved.data(), offsets.data(), step.data(), moved.data());
      });
      const State y = moved.values();
      const auto one = [&](const State& all, std::size_t s, std::size_t size) {
        return State(all.begin() + static_cast<std::ptrdiff_t>(s * size),
                     all.begin() + static_cast<std::ptrdiff_t>((s + 1) * size));
      };
      check.within(norm(difference(one(y, 0, a), samples.retract(states[0], first))), 0.0,
                   "retract of several, in place, is that of each");
      check.within(norm(difference(one(y, 2, a), samples.retract(states[2], third))), 0.0,
                   "retract of several, in place, is that of each");
      check.within(norm(difference(one(y, 1, a), states[1])), 0.0,
                   "retract leaves a variable with a negative offset as it is");
      Guarded from("x", x), to("y", y), out("delta", 3 * t);
      check.call("local", {&from, &to, &out},
                 [&] { type->local(3, from.data(), to.data(), out.data()); });
      check.within(
          norm(difference(one(out.values(), 2, t), samples.local(states[2], one(y, 2, a)))), 0.0,
          "local of several is that of each");
    });
  }
}

void check_normalize(const Subject& subject, Checker& check) {
  const auto normalize = [&](const VariableSamples& type, State& x) {
    Guarded state = Guarded::in_place("x", x);
    std::string problem =
        check.call("normalize", {&state}, [&] { return type.type().normalize(state.data()); });
    x = state.values();
    return problem;
  };
  for_steps(subject, check,
            [&](const VariableSamples& type, const State& x, const State& delta, double tolerance) {
              const State y = type.retract(x, delta);
              State once = y;
              const std::string problem = normalize(type, once);
              check.expect(problem.empty(), "normalize accepts what retract gives",
                           [&] { return fmt::format("it refuses {}: {}", text_of(y), problem); });
              if (!problem.empty()) return;
              check.within(type.apart(y, once), tolerance,
                           "normalize leaves the state where it is");
              State twice = once;
              normalize(type, twice);
              check.within(norm(difference(twice, once)), 1e-14 * (1.0 + norm(once)),
                           "normalize changes nothing when it is repeated");
              // A graph refuses what is not finite in any case; normalize need not, but must
              // return.
              for (std::size_t k = 0; k < once.size(); ++k) {
                for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                                         std::numeric_limits<double>::infinity()}) {
                  State broken = once;
                  broken[k] = bad;
                  normalize(type, broken);
                }
              }
            });
}

/// The functions of `LieGroup` in guarded arrays.
class GuardedGroup {
 public:
  GuardedGroup(const VariableSamples& type, const LieGroup& group, Checker& check)
      : type_(type), group_(group), check_(check) {}

  State compose(const State& a, const State& b) const {
    Guarded left("a", a), right("b", b), out("ab", type_.ambient());
    check_.call("compose", {&left, &right, &out},
                [&] { group_.compose(left.data(), right.data(), out.data()); });
    return out.values();
  }
  State inverse(const State& a) const {
    Guarded in("a", a), out("a_inverse", type_.ambient());
    check_.call("inverse", {&in, &out}, [&] { group_.inverse(in.data(), out.data()); });
    return out.values();
  }
  State exp(const State& delta) const {
    Guarded in("tangent", delta), out("a", type_.ambient());
    check_.call("exp", {&in, &out}, [&] { group_.exp(in.data(), out.data()); });
    return out.values();
  }
  State log(const State& a) const {
    Guarded in("a", a), out("tangent", type_.tangent());
    check_.call("log", {&in, &out}, [&] { group_.log(in.data(), out.data()); });
    return out.values();
  }
  MatrixXd adjoint(const State& a) const {
    const auto n = type_.tangent();
    Guarded in("a", a), out("Ad", n * n);
    check_.call("adjoint", {&in, &out}, [&] { group_.adjoint(in.data(), out.data()); });
    return matrix(out);
  }
  MatrixXd adjoint_between(const State& a, const State& b) const {
    const auto n = type_.tangent();
    Guarded from("a", a), to("b", b), out("Ad", n * n);
    check_.call("adjoint_between", {&from, &to, &out},
                [&] { group_.adjoint_between(from.data(), to.data(), out.data()); });
    return matrix(out);
  }

 private:
  MatrixXd matrix(const Guarded& out) const {
    const State values = out.values();
    const auto n = static_cast<Index>(type_.tangent());
    return Map<const MatrixXd>(values.data(), n, n);
  }

  const VariableSamples& type_;
  const LieGroup& group_;
  Checker& check_;
};

void check_group(const Subject& subject, Checker& check) {
  const auto type = subject.registry.variable_type(subject.name);
  const LieGroup* lie = type->lie_group();
  if (!lie) return check.note("its states form no Lie group");
  for_steps(
      subject, check,
      [&](const VariableSamples& samples, const State& x, const State& delta, double tolerance) {
        const GuardedGroup group(samples, *lie, check);
        const State e = samples.identity(), a = group.exp(delta), a_inverse = group.inverse(a);
        const State xa = group.compose(x, a);
        check.within(norm(difference(group.log(a), delta)), tolerance, "log(exp(δ)) = δ");
        check.within(samples.apart(group.exp(group.log(a)), a), tolerance, "exp(log(a)) = a");
        check.within(samples.apart(samples.retract(x, delta), xa), tolerance,
                     "retract(x, δ) = x · exp(δ)");
        check.within(samples.apart(group.compose(a, a_inverse), e), tolerance,
                     "a · a⁻¹ = identity");
        check.within(samples.apart(group.compose(a_inverse, a), e), tolerance,
                     "a⁻¹ · a = identity");
        check.within(samples.apart(group.compose(x, e), x), tolerance, "x · identity = x");
        check.within(samples.apart(group.compose(e, x), x), tolerance, "identity · x = x");
        check.within(samples.apart(group.compose(group.compose(x, a), x),
                                   group.compose(x, group.compose(a, x))),
                     4.0 * tolerance, "(x · a) · x = x · (a · x)");

        // Small, so that the vector carried is one that log can give.
        const VectorXd small =
            Map<const VectorXd>(delta.data(), std::ssize(delta)) * (0.01 / (1.0 + norm(delta)));
        const State step(small.data(), small.data() + small.size());
        const VectorXd carried = group.adjoint(x) * small;
        const State left = group.compose(group.compose(x, group.exp(step)), group.inverse(x));
        check.within(
            samples.apart(left, group.exp({carried.data(), carried.data() + carried.size()})),
            4.0 * tolerance, "x · exp(δ) · x⁻¹ = exp(adjoint(x) δ)");
        check.within((group.adjoint_between(x, xa) - group.adjoint(a)).cwiseAbs().maxCoeff(),
                     4.0 * tolerance, "adjoint_between(x, x · a) = adjoint(a)");
      });
}

void check_placement(const Subject& subject, Checker& check) {
  const auto type = subject.registry.variable_type(subject.name);
  const Placement* placement = type->placement();
  if (!placement) return check.note("it has no position in the plane or in space");
  const int d = placement->dimension();
  check.expect(d == 2 || d == 3, "dimension is 2 or 3", [&] { return fmt::format("it is {}", d); });
  if (d != 2 && d != 3) return;
  const auto n = static_cast<std::size_t>(d);
  for_steps(
      subject, check,
      [&](const VariableSamples& samples, const State& x, const State& delta, double tolerance) {
        const auto split = [&](const State& state) {
          Guarded from("x", state), R = Guarded::sum("R", n * n), t("t", n);
          check.call("split", {&from, &R, &t},
                     [&] { placement->split(from.data(), R.data(), t.data()); });
          return std::pair{R.values(), t.values()};
        };
        const auto [R, t] = split(samples.retract(x, delta));
        if (placement->has_orientation()) {
          const Map<const MatrixXd> rotation(R.data(), d, d);
          check.within((rotation.transpose() * rotation - MatrixXd::Identity(d, d)).norm(),
                       tolerance, "R of split is orthogonal");
        }
        Guarded R_in("R", R), t_in("t", t), out("x", samples.ambient());
        check.call("join", {&R_in, &t_in, &out},
                   [&] { placement->join(R_in.data(), t_in.data(), out.data()); });
        const auto [R_again, t_again] = split(out.values());
        check.within(norm(difference(R_again, R)) + norm(difference(t_again, t)), tolerance,
                     "split(join(R, t)) = (R, t)");
      });
}

Repetition variable_uses(const Subject& subject, Checker& check) {
  return {"retract and local", 200, [&subject, &check](std::uint64_t input) {
            const auto type = subject.registry.variable_type(subject.name);
            VariableSamples samples(*type, check, check.options().seed + input);
            State x, deltas;
            std::vector<std::int64_t> offsets;
            for (int k = 0; k < 20; ++k) {
              const State state = samples.state(), step = samples.step(0.3);
              offsets.push_back(std::ssize(deltas));
              x.insert(x.end(), state.begin(), state.end());
              deltas.insert(deltas.end(), step.begin(), step.end());
            }
            return [type, x, deltas, offsets] {
              State result(x), back(deltas.size());
              type->retract(offsets.size(), x.data(), offsets.data(), deltas.data(), result.data());
              type->local(offsets.size(), x.data(), result.data(), back.data());
              static_cast<void>(type->normalize(result.data()));
              result.insert(result.end(), back.begin(), back.end());
              return result;
            };
          }};
}

}  // namespace

std::span<const Group> variable_groups() {
  static constexpr std::array<Group, 8> groups{{{"retract and local", check_retract_and_local},
                                                {"several at once", check_pools},
                                                {"retract_jacobian", check_retract_jacobian},
                                                {"normalize", check_normalize},
                                                {"Lie group", check_group},
                                                {"position", check_placement},
                                                {"memory", memory_group<variable_uses>, true},
                                                {"threads", threads_group<variable_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
