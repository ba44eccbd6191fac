// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/update/pose_remover.hpp"

#include <utility>

namespace cairn {
namespace {

class MadeWhenUsed final : public PoseRemover {
 public:
  MadeWhenUsed(ComponentSpec spec, Registry& registry)
      : spec_(std::move(spec)), registry_(registry) {}
  Removal remove(Estimator& estimator, std::span<const Id> poses) override {
    return made().remove(estimator, poses);
  }
  Removal make_room(Estimator& estimator, int limit, const GraphUpdate& coming) override {
    return made().make_room(estimator, limit, coming);
  }

 private:
  PoseRemover& made() {
    if (!remover_) remover_ = registry_.make<PoseRemover>(spec_);
    return *remover_;
  }

  ComponentSpec spec_;
  Registry& registry_;
  std::unique_ptr<PoseRemover> remover_;
};

}  // namespace

std::unique_ptr<PoseRemover> made_when_used(ComponentSpec spec, Registry& registry) {
  return std::make_unique<MadeWhenUsed>(std::move(spec), registry);
}

PoseRemover::~PoseRemover() = default;

void PoseRemover::Removal::add_to(GraphUpdate& other) const {
  const auto insert = [](auto& into, const auto& what) {
    into.insert(into.begin(), what.begin(), what.end());
  };
  insert(other.factors, update.factors);
  insert(other.removed_factors, update.removed_factors);
  insert(other.removed_variables, update.removed_variables);
}

}  // namespace cairn
