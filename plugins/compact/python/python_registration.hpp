// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <pybind11/pybind11.h>

#include "cairn/policy/registration.hpp"
#include "python_component.hpp"

namespace cairn::python {

/// A pair that a policy proposes, as Python sees it.
struct BoundProposal {
  Id earlier = 0, later = 0;
  double gain = 0.0;
  py::object expected;    ///< Pose2 or Pose3 from `earlier` to `later`; None: not known
  py::object covariance;  ///< (d, d), or None
};
BoundProposal proposal_of(const MatchProposal& proposal, const VariableType& type);

/// A registration written in Python: a function match(proposal), or an object with a method `match`
/// and, if it has them, `begin()`, `recognise(places, pose)` and `pose_ended(pose, kept)`.
class PythonRegistration final : public Registration, public PythonComponent {
 public:
  explicit PythonRegistration(const py::object& matcher);

  /// Before each run: those that find thresholds, and the one that selects.
  void begin(const RegistrationData& data) override;
  std::vector<Factor> match(Id earlier, Id later) override;
  std::vector<Factor> match_proposed(const MatchProposal& proposal) override;
  std::optional<RecognisedPlace> recognise(std::span<const Id> places, Id pose) override;
  void pose_ended(Id pose, bool kept) override;

 private:
  py::object match_, begin_, recognise_, pose_ended_;  ///< None: it has no such method
  const Graph* recording_ = nullptr;
};

}  // namespace cairn::python
