// SPDX-License-Identifier: BSD-3-Clause
// An estimator of cairn's own, with one thing wrong each.
#include <algorithm>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/solve/estimator.hpp"

namespace {

using namespace cairn;

class Wrapped : public Estimator {
 public:
  explicit Wrapped(std::shared_ptr<Estimator> right) : right_(std::move(right)) {}

  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    return right_->update(update, options);
  }
  void set_loss(std::shared_ptr<const Loss> loss, const FactorSelector& which) override {
    right_->set_loss(std::move(loss), which);
  }
  bool has(Id id) const override { return right_->has(id); }
  int variable_count() const override { return right_->variable_count(); }
  int factor_count() const override { return right_->factor_count(); }
  std::vector<Id> variables() const override { return right_->variables(); }
  std::shared_ptr<const VariableType> type(Id id) const override { return right_->type(id); }
  std::vector<FactorId> factors() const override { return right_->factors(); }
  bool has_factor(FactorId id) const override { return right_->has_factor(id); }
  Factor factor(FactorId id) const override { return right_->factor(id); }
  std::span<const double> state(Id id) override { return right_->state(id); }
  double chi2() override { return right_->chi2(); }
  Graph graph() override { return right_->graph(); }
  void keep_marginals(KeptMarginals kept) override { right_->keep_marginals(kept); }
  void keep_cross(Id a, Id b) override { right_->keep_cross(a, b); }
  bool covariance(Id a, Id b, std::span<double> block) override {
    return right_->covariance(a, b, block);
  }
  bool covariance_column(Id id, std::span<const Id> variables, std::span<double> out) override {
    return right_->covariance_column(id, variables, out);
  }
  void reset() override { right_->reset(); }
  std::unique_ptr<Estimator> clone() const override {
    return std::make_unique<Wrapped>(right_->clone());
  }

 protected:
  std::shared_ptr<Estimator> right_;
};

/// Gives a covariance that it has given once for ever.
struct StaleCovariances final : Wrapped {
  using Wrapped::Wrapped;
  bool covariance(Id a, Id b, std::span<double> block) override {
    if (const auto known = known_.find({a, b}); known != known_.end()) {
      std::ranges::copy(known->second, block.begin());
      return true;
    }
    const bool found = Wrapped::covariance(a, b, block);
    if (found) known_[{a, b}] = {block.begin(), block.end()};
    return found;
  }

 private:
  std::map<std::pair<Id, Id>, std::vector<double>> known_;
};

/// Has taken in the variables when it finds that the factors are wrong.
struct HalfRefuses final : Wrapped {
  using Wrapped::Wrapped;
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    try {
      return Wrapped::update(update, options);
    } catch (const Error&) {
      GraphUpdate half;
      half.variables = {update.variables.front()};
      half.factors = {update.factors.front()};
      Wrapped::update(half, options);
      throw;
    }
  }
};

/// Has taken in the variables when a factor throws while it is evaluated.
struct KeepsHalves final : Wrapped {
  using Wrapped::Wrapped;
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    try {
      return Wrapped::update(update, options);
    } catch (const Error& error) {
      if (error.code() == ErrorCode::plugin) {
        GraphUpdate half;
        half.variables = update.variables;
        Wrapped::update(half, {.defer = true});
      }
      throw;
    }
  }
};

/// A copy is the same map under another name.
struct SharesCopies final : Wrapped {
  using Wrapped::Wrapped;
  std::unique_ptr<Estimator> clone() const override {
    return std::make_unique<SharesCopies>(right_);
  }
};

/// Factors that it is to remove stay.
struct Keeps final : Wrapped {
  using Wrapped::Wrapped;
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    GraphUpdate less = update;
    less.removed_variables.clear();
    return Wrapped::update(less, options);
  }
};

/// So do those that it is to remove by their ids.
struct RemovesNoFactor final : Wrapped {
  using Wrapped::Wrapped;
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    GraphUpdate less = update;
    less.removed_factors.clear();
    return Wrapped::update(less, options);
  }
};

/// Solves every third update, and does not say so.
struct SolvesSeldom final : Wrapped {
  using Wrapped::Wrapped;
  UpdateReport update(const GraphUpdate& update, const UpdateOptions& options) override {
    UpdateOptions less = options;
    less.defer = !options.full && ++updates_ % 3 != 0;
    UpdateReport report = Wrapped::update(update, less);
    report.owed = 0;
    report.converged = true;
    return report;
  }

 private:
  int updates_ = 0;
};

template <class Wrong>
void add(Registrar& registrar, const char* name) {
  registrar.add<Estimator>(name, {}, [](const Options&, Registry& registry) {
    return std::make_unique<Wrong>(registry.make<Estimator>("batch"));
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add<StaleCovariances>(registrar, "stale_covariances");
  add<HalfRefuses>(registrar, "half_refuses");
  add<KeepsHalves>(registrar, "keeps_halves");
  add<SharesCopies>(registrar, "shares_copies");
  add<Keeps>(registrar, "keeps_what_leaves");
  add<RemovesNoFactor>(registrar, "removes_no_factor");
  add<SolvesSeldom>(registrar, "solves_seldom");
}
