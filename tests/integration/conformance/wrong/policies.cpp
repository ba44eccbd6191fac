// SPDX-License-Identifier: BSD-3-Clause
// A pose policy of cairn's own, with one thing wrong each.
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "cairn/plugin/registry.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/runtime/error.hpp"

namespace {

using namespace cairn;

class Wrapped : public PosePolicy {
 public:
  explicit Wrapped(std::unique_ptr<PosePolicy> right) : right_(std::move(right)) {}
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override {
    right_->add_pose(pose, odometry);
  }
  std::optional<MatchProposal> next_match() override { return right_->next_match(); }
  LinkReport offer(Id other, std::span<const Factor> measured) override {
    return right_->offer(other, measured);
  }
  PoseReport end_pose() override { return right_->end_pose(); }
  bool finish() override { return right_->finish(); }
  Estimator& estimator() override { return right_->estimator(); }
  std::vector<Id> kept() const override { return right_->kept(); }
  int factor_count() const override { return right_->factor_count(); }
  std::vector<double> newest_state() const override { return right_->newest_state(); }
  const std::vector<OdometryChain>& chains() const override { return right_->chains(); }

 private:
  std::unique_ptr<PosePolicy> right_;
};

/// The same pair again and again.
struct NeverSatisfied final : Wrapped {
  using Wrapped::Wrapped;
  std::optional<MatchProposal> next_match() override {
    if (const auto next = Wrapped::next_match()) last_ = next;
    return last_;
  }
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override {
    last_.reset();
    Wrapped::add_pose(pose, odometry);
  }

 private:
  std::optional<MatchProposal> last_;
};

/// Says of every pose that it is kept.
struct Boasts final : Wrapped {
  using Wrapped::Wrapped;
  PoseReport end_pose() override {
    PoseReport report = Wrapped::end_pose();
    report.kept = true;
    return report;
  }
};

/// The chains lack what was driven before the last step.
struct ForgetsSteps final : Wrapped {
  using Wrapped::Wrapped;
  const std::vector<OdometryChain>& chains() const override {
    chains_ = Wrapped::chains();
    for (OdometryChain& chain : chains_)
      chain.steps.erase(chain.steps.begin(), chain.steps.end() - 1);
    return chains_;
  }

 private:
  mutable std::vector<OdometryChain> chains_;
};

/// What cannot be a link is none, and no error.
struct AcceptsAnyOffer final : Wrapped {
  using Wrapped::Wrapped;
  LinkReport offer(Id other, std::span<const Factor> measured) override {
    try {
      return Wrapped::offer(other, measured);
    } catch (const Error&) {
      return {.earlier = other, .later = other};
    }
  }
};

/// Says so of all poses that ever were, too.
struct BoastsTwice final : Wrapped {
  using Wrapped::Wrapped;
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override {
    Wrapped::add_pose(pose, odometry);
    all_.push_back(pose.id);
  }
  PoseReport end_pose() override {
    PoseReport report = Wrapped::end_pose();
    report.kept = true;
    return report;
  }
  std::vector<Id> kept() const override { return all_; }

 private:
  std::vector<Id> all_;
};

/// Leaves the end as it is.
struct NeverFinishes final : Wrapped {
  using Wrapped::Wrapped;
  bool finish() override { return true; }
};

/// After a refused call the next pose is where the refused one would have been.
struct RemembersWhatItRefuses final : Wrapped {
  using Wrapped::Wrapped;
  void add_pose(const Variable& pose, std::span<const Factor> odometry) override {
    std::vector<Factor> moved(odometry.begin(), odometry.end());
    if (refused_ && !moved.empty()) moved.front().measurement.front() += 0.01;
    refused_ = false;
    try {
      Wrapped::add_pose(pose, moved);
    } catch (const Error&) {
      refused_ = true;
      throw;
    }
  }

 private:
  bool refused_ = false;
};

template <class Wrong>
void add(Registrar& registrar, const char* name) {
  registrar.add<PosePolicy>(name, {}, [](const Options&, Registry& registry) {
    return std::make_unique<Wrong>(registry.make<PosePolicy>("compact_pose:pose_gain=3"));
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add<NeverSatisfied>(registrar, "never_satisfied");
  add<Boasts>(registrar, "boasts");
  add<ForgetsSteps>(registrar, "forgets_steps");
  add<AcceptsAnyOffer>(registrar, "accepts_any_offer");
  add<BoastsTwice>(registrar, "boasts_twice");
  add<NeverFinishes>(registrar, "never_finishes");
  add<RemembersWhatItRefuses>(registrar, "remembers_what_it_refuses");
}
