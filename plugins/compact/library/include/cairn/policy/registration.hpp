// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/geometry/motion.hpp"
#include "cairn/graph/graph.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn {

/// The data that a registration may use. They must outlive it.
struct RegistrationData {
  const Graph* recording = nullptr;  ///< poses with all measurements that were made
  const Graph* truth = nullptr;      ///< the true states of the same poses; null: unknown
};

/// Two poses whose sensor data are worth matching.
struct MatchProposal {
  Id earlier = 0, later = 0;
  double gain = 0.0;  ///< expected information gain of a link [nats]
  Motion expected;    ///< from `earlier` to `later`, by the estimate
};

/// A place that was recognised: a pose of a map, and the measured relative poses to it.
struct RecognisedPlace {
  Id place = 0;
  std::vector<Factor> factors;
};

/// Measures the relative pose of two poses from their sensor data: a matcher of scans or images, a
/// recording of one, or a simulation. It is called for the pairs that a policy proposes.
class CAIRN_API Registration : public Component {
 public:
  static constexpr std::string_view kKind = "registration";
  ~Registration() override;

  /// Called once, before the first match. Throws `Error` (usage) if something is missing that it
  /// needs, such as the ground truth.
  virtual void begin(const RegistrationData& data) = 0;
  /// The measured relative poses of two poses: relative factors on them, in either order. None if
  /// the two do not match.
  virtual std::vector<Factor> match(Id earlier, Id later) = 0;
  /// The same for a pair that a policy has proposed, with where it expects the later pose: for
  /// matchers that need an initial estimate. Unless overridden, `match` is called.
  virtual std::vector<Factor> match_proposed(const MatchProposal& proposal);
  /// A match of a pose with any of these, while it is unknown which of them are near: place
  /// recognition. Unless overridden, `match` is called for one after the other.
  virtual std::optional<RecognisedPlace> recognise(std::span<const Id> places, Id pose);
  /// Called after each pose of a run: whether the policy keeps it; and again with false for a pose
  /// that was kept when it leaves. Does nothing unless overridden.
  virtual void pose_ended(Id pose, bool kept);
  /// Whether, while every pose is kept, only pairs match of which the recording has a measurement:
  /// a policy that has to find all of them need not ask for others. False unless overridden.
  virtual bool matches_recorded_only() const;
};

/// The name of the ability of registrations that match laser scans, `ScanRegistration`: a graph has
/// none.
inline constexpr std::string_view kScanRegistration = "scan_registration";

/// Ability of a registration that knows which of its answers are false: for experiments, which
/// count their outcomes.
class CAIRN_API FalseMatches {
 public:
  static constexpr std::string_view kAbility = "false_matches";
  virtual ~FalseMatches();
  /// Whether the result of `match` for these two poses, in either order, is a false match, not a
  /// measurement. False where there is no result.
  virtual bool was_false(Id earlier, Id later) const = 0;
};

/// A function as a registration, for front ends in C++.
class CAIRN_API FunctionRegistration final : public Registration {
 public:
  using Function = std::function<std::vector<Factor>(Id earlier, Id later)>;
  explicit FunctionRegistration(Function match) : match_(std::move(match)) {}
  void begin(const RegistrationData&) override {}
  std::vector<Factor> match(Id earlier, Id later) override { return match_(earlier, later); }

 private:
  Function match_;
};

}  // namespace cairn
