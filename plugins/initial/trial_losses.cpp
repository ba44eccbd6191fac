// SPDX-License-Identifier: BSD-3-Clause
#include "trial_losses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace cairn::initial {
namespace {

struct Value {
  double rho, first, second;
};

/// The loss whose value at s a function gives.
template <class At>
class TrialLoss final : public Loss {
 public:
  explicit TrialLoss(At at) : at_(std::move(at)) {}
  void evaluate(std::span<const double> s, std::span<double> rho,
                std::span<double> weight) const override {
    for (std::size_t k = 0; k < s.size(); ++k) {
      const Value value = at_(s[k]);
      if (!rho.empty()) rho[k] = value.rho;
      if (!weight.empty()) weight[k] = value.first;
    }
  }
  double second_derivative(double s) const override { return at_(s).second; }

 private:
  At at_;
};

template <class At>
std::shared_ptr<const Loss> make(At at) {
  return std::make_shared<TrialLoss<At>>(std::move(at));
}

double rho_of(const Loss& loss, double s) {
  double rho = 0.0;
  loss.evaluate({&s, 1}, {&rho, 1}, {});
  return rho;
}

}  // namespace

std::shared_ptr<const Loss> make_cauchy(double q) {
  return make([q](double s) {
    const double weight = 1.0 / (1.0 + s / q);
    return Value{q * std::log1p(s / q), weight, -weight * weight / q};
  });
}

std::shared_ptr<const Loss> make_geman_mcclure(double q) {
  return make([q](double s) {
    const double ratio = 1.0 / (1.0 + s / q);
    return Value{s * ratio, ratio * ratio, -2.0 * ratio * ratio * ratio / q};
  });
}

std::shared_ptr<const Loss> make_weight(double w) {
  return make([w](double s) { return Value{w * s, w, 0.0}; });
}

std::shared_ptr<const Loss> make_wider(std::shared_ptr<const Loss> loss, double k) {
  return make([loss = std::move(loss), square = k * k](double s) {
    const double narrow = s / square;
    Value value{};
    loss->evaluate({&narrow, 1}, {&value.rho, 1}, {&value.first, 1});
    value.rho *= square;
    value.second = loss->second_derivative(narrow) / square;
    return value;
  });
}

bool is_bounded(const Loss& loss) { return rho_of(loss, 1e200) <= 1.0001 * rho_of(loss, 1e150); }

bool has_bounded_losses(const Graph& graph) {
  return std::ranges::any_of(graph.losses(),
                             [](const auto& loss) { return loss && is_bounded(*loss); });
}

KeptLosses::KeptLosses(Graph& graph) : graph_(graph) {
  if (!graph.has_losses()) return;
  losses_.reserve(static_cast<std::size_t>(graph.factor_count()));
  for (int f = 0; f < graph.factor_count(); ++f) {
    const FactorRef at = graph.ref(f);
    const auto entry = static_cast<std::size_t>(at.entry);
    const auto& pool = graph.factor_pools()[static_cast<std::size_t>(at.pool)];
    losses_.push_back(graph.losses()[static_cast<std::size_t>(pool.losses[entry])]);
  }
}

void KeptLosses::put_back() {
  graph_.set_loss(std::shared_ptr<const Loss>());
  for (std::size_t f = 0; f < losses_.size(); ++f) {
    if (losses_[f]) graph_.set_loss(static_cast<int>(f), losses_[f]);
  }
}

void set_instead_of_bounded(
    Graph& graph, const KeptLosses& losses,
    const std::function<std::shared_ptr<const Loss>(std::shared_ptr<const Loss>)>& instead) {
  std::map<const Loss*, std::shared_ptr<const Loss>> made;
  for (int f = 0; f < graph.factor_count(); ++f) {
    const std::shared_ptr<const Loss>& own = losses.losses()[static_cast<std::size_t>(f)];
    if (!own) continue;
    std::shared_ptr<const Loss>& other = made[own.get()];
    if (!other) other = is_bounded(*own) ? instead(own) : own;
    graph.set_loss(f, other);
  }
}

}  // namespace cairn::initial
