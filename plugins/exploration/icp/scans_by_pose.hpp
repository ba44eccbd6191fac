// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <utility>

#include "cairn/graph/graph.hpp"

namespace cairn::icp {

/// The scans of poses, as `ScanRegistration` is given them and `Registration::pose_ended` says
/// which are no longer needed.
template <class Scan>
class ScansByPose {
 public:
  void take(Id pose, Scan scan) {
    scans_.insert_or_assign(pose, std::move(scan));
    newest_ = pose;
  }
  void pose_ended(Id pose, bool kept) {
    if (dropped_ && *dropped_ != pose) scans_.erase(*dropped_);
    dropped_.reset();
    if (!kept && pose != newest_) scans_.erase(pose);
    if (!kept && pose == newest_) dropped_ = pose;  // the next may be matched with it
    newest_.reset();
  }
  /// Null where there is no scan of a pose, as of one that was not kept or of an earlier session.
  const Scan* find(Id pose) const {
    const auto at = scans_.find(pose);
    return at == scans_.end() ? nullptr : &at->second;
  }

 private:
  std::map<Id, Scan> scans_;
  std::optional<Id> newest_, dropped_;
};

}  // namespace cairn::icp
