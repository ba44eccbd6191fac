// SPDX-License-Identifier: BSD-3-Clause
// Laws of robust losses.
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/types/loss.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

/// From far below to far above the scale at which a loss bends.
std::vector<double> arguments() {
  std::vector<double> all;
  for (double s = 1e-6; s < 1e6; s *= 1.7) all.push_back(s);
  return all;
}

/// ρ and ρ′ of several arguments, in guarded arrays.
struct Values {
  std::vector<double> rho, weight;
};
Values evaluate(const Loss& loss, const std::vector<double>& s, Checker& check) {
  Guarded in("s", s), rho("rho", s.size()), weight("weight", s.size());
  check.call("evaluate", {&in, &rho, &weight},
             [&] { loss.evaluate(in.span(), rho.span(), weight.span()); });
  return {rho.values(), weight.values()};
}

std::string at(double s) { return fmt::format("s = {}", s); }

void check_shape(const Subject& subject, Checker& check) {
  const auto loss = made<Loss>(subject, check);
  check.sample(at(0.0), [&] {
    const Values zero = evaluate(*loss, {0.0}, check);
    check.within(std::abs(zero.rho[0]), 0.0, "ρ(0) = 0");
    check.within(std::abs(zero.weight[0] - 1.0), 1e-9, "ρ′(0) = 1");
  });
  double last = 0.0;
  for (const double s : arguments()) {
    check.sample(at(s), [&] {
      const Values v = evaluate(*loss, {s}, check);
      const auto found = [&] { return fmt::format("ρ = {}, ρ′ = {}", v.rho[0], v.weight[0]); };
      check.expect(std::isfinite(v.rho[0]) && std::isfinite(v.weight[0]), "ρ and ρ′ are finite",
                   found);
      check.expect(v.weight[0] >= 0.0, "ρ′ ≥ 0", found);
      check.expect(v.rho[0] >= last * (1.0 - 1e-12), "ρ does not decrease", found);
      last = v.rho[0];
    });
  }
}

/// ρ′ against differences of ρ, and ρ″ against those of ρ′, except where they jump.
void check_derivatives(const Subject& subject, Checker& check) {
  const auto loss = made<Loss>(subject, check);
  for (const double s : arguments()) {
    check.sample(at(s), [&] {
      const double h = 1e-4 * s;
      const Values v = evaluate(*loss, {s - h, s, s + h, s - h / 2, s + h / 2}, check);
      const auto slope = [&](const std::vector<double>& f, double step, int low, int high) {
        return (f[static_cast<std::size_t>(high)] - f[static_cast<std::size_t>(low)]) / step;
      };
      // Where differences of both steps agree, the function is smooth there.
      const double rough = slope(v.rho, 2 * h, 0, 2), fine = slope(v.rho, h, 3, 4);
      const double scale = std::abs(v.rho[1]) / s + std::abs(v.weight[1]);
      if (std::abs(rough - fine) <= 1e-6 * scale) {
        check.expect(std::abs(v.weight[1] - fine) <= 1e-5 * scale, "ρ′ is the derivative of ρ",
                     [&] { return fmt::format("{}, differences give {}", v.weight[1], fine); });
      }
      const double second =
          check.call("second_derivative", [&] { return loss->second_derivative(s); });
      const double rough_2 = slope(v.weight, 2 * h, 0, 2), fine_2 = slope(v.weight, h, 3, 4);
      const double scale_2 = v.weight[1] / s + std::abs(second);
      if (std::abs(rough_2 - fine_2) <= 1e-5 * scale_2) {
        check.expect(std::abs(second - fine_2) <= 1e-4 * scale_2, "ρ″ is the derivative of ρ′",
                     [&] { return fmt::format("{}, differences give {}", second, fine_2); });
      }
    });
  }
}

void check_arrays(const Subject& subject, Checker& check) {
  const auto loss = made<Loss>(subject, check);
  check.sample("several arguments at once", [&] {
    const std::vector<double> s = arguments();
    const Values all = evaluate(*loss, s, check);
    for (std::size_t k = 0; k < s.size(); ++k) {
      const Values one = evaluate(*loss, {s[k]}, check);
      check.expect(one.rho[0] == all.rho[k] && one.weight[0] == all.weight[k],
                   "evaluate of several arguments is that of each", [&] {
                     return fmt::format("at {}: {} and {}, alone {} and {}", at(s[k]), all.rho[k],
                                        all.weight[k], one.rho[0], one.weight[0]);
                   });
    }
    Guarded in("s", s), rho("rho", s.size()), weight("weight", s.size());
    check.call("evaluate", {&in, &rho}, [&] { loss->evaluate(in.span(), rho.span(), {}); });
    check.call("evaluate", {&in, &weight}, [&] { loss->evaluate(in.span(), {}, weight.span()); });
    check.within(norm(difference(rho.values(), all.rho)), 0.0, "either output may be left out");
    check.within(norm(difference(weight.values(), all.weight)), 0.0,
                 "either output may be left out");
  });
}

Repetition loss_uses(const Subject& subject, Checker& check) {
  // One object serves all factors and threads: other inputs are for the last one made.
  const auto last = std::make_shared<std::shared_ptr<const Loss>>();
  return {"evaluate", 200, [&subject, &check, last](std::uint64_t input) {
            if (input == 0) *last = made<Loss>(subject, check);
            const std::shared_ptr<const Loss> loss = *last;
            std::vector<double> s = arguments();
            for (double& one : s) one *= 1.0 + 0.1 * static_cast<double>(input);
            return [loss, s] {
              State result(2 * s.size());
              const std::span<double> both(result);
              loss->evaluate(s, both.first(s.size()), both.last(s.size()));
              for (const double one : s) result.push_back(loss->second_derivative(one));
              return result;
            };
          }};
}

}  // namespace

std::span<const Group> loss_groups() {
  static constexpr std::array<Group, 5> groups{{{"shape", check_shape},
                                                {"derivatives", check_derivatives},
                                                {"arrays", check_arrays},
                                                {"memory", memory_group<loss_uses>, true},
                                                {"threads", threads_group<loss_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
