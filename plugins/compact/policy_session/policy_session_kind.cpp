// SPDX-License-Identifier: BSD-3-Clause
#include <memory>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "cairn/online/line_session.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/policy/policy_session.hpp"
#include "cairn/policy/pose_policy.hpp"
#include "cairn/policy/saved_thresholds.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"

namespace {

using namespace cairn;

/// The policy with the options that were given by themselves, and those of a file.
ComponentSpec complete(const LineSessionRequest& request, Registry& registry) {
  ComponentSpec spec = request.component;
  for (const auto& [name, value] : request.given) {
    const auto [given, is_new] = spec.values.emplace(name, value);
    if (is_new) continue;
    throw Error(ErrorCode::usage,
                fmt::format("--{}, and {}={} among the policy's options: give one", name, name,
                            given->second));
  }
  if (const auto given = spec.values.find("sparsifier"); given != spec.values.end())
    expect_savable(parse_component(given->second), registry);
  if (!spec.values.contains("keep")) {
    for (const char* name : {"select", "sparsifier"}) {
      if (!spec.values.contains(name)) continue;
      throw Error(ErrorCode::usage,
                  fmt::format("--{} is of poses that leave, and with a policy none do without a "
                              "number of poses: give --keep N, too",
                              name));
    }
  }
  if (!request.thresholds.empty()) {
    for (const auto& [name, value] : read_thresholds(request.thresholds, spec.name).options)
      spec.values.emplace(name, value);
  }
  return spec;
}

class PolicySessions final : public LineSessionKind {
 public:
  Opened open(const LineSessionRequest& request, StreamFormat& format,
              Registry& registry) const override {
    const ComponentSpec spec = complete(request, registry);
    auto policy = registry.make<PosePolicy>(spec);
    policy->estimator().set_loss(request.loss, request.loss_on);
    auto lines = std::make_unique<PolicySession>(
        *policy, format, registry,
        PolicySettings{request.read, request.output, request.marginals, request.trajectory});
    if (request.map) lines->load(*request.map);
    // What is written at the end of a pose is read before, which may cost the last bits their
    // place.
    std::string identity = fmt::format("policy {}, output {}, marginals {}", spec_text(spec),
                                       request.output, request.marginals);
    return {std::move(policy), std::move(lines), std::move(identity)};
  }
};

}  // namespace

void cairn_register(Registrar& registrar) {
  registrar.add<LineSessionKind>("pose_policy", {}, [](const Options&, Registry&) {
    return std::make_unique<PolicySessions>();
  });
}
