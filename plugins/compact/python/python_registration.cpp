// SPDX-License-Identifier: BSD-3-Clause
#include "python_registration.hpp"

#include <cstddef>
#include <utility>

#include <pybind11/stl.h>

#include "arrays.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/typed/symbol.hpp"
#include "factors.hpp"
#include "types_of.hpp"

namespace cairn::python {

BoundProposal proposal_of(const MatchProposal& proposal, const VariableType& type) {
  BoundProposal bound{proposal.earlier, proposal.later, proposal.gain, py::none(), py::none()};
  if (proposal.expected.mean.empty()) return bound;
  const auto d = static_cast<std::size_t>(type.tangent_size());
  bound.expected = value_of(type, proposal.expected.mean);
  bound.covariance = blocks_of(proposal.expected.covariance, d, d)[py::int_(0)];
  return bound;
}

PythonRegistration::PythonRegistration(const py::object& matcher)
    : PythonComponent("registration"),
      match_(method_of(matcher, "match")),
      begin_(method_of(matcher, "begin")),
      recognise_(method_of(matcher, "recognise")),
      pose_ended_(method_of(matcher, "pose_ended")) {
  if (match_.is_none()) match_ = matcher;
  if (PyCallable_Check(match_.ptr()) == 0) {
    throw Error(ErrorCode::usage,
                "registration: expected the name of one, a function match(proposal) that returns "
                "factors or None, or an object with such a method");
  }
}

void PythonRegistration::begin(const RegistrationData& data) {
  recording_ = data.recording;
  if (!begin_.is_none()) call([&] { return begin_(), true; }, true);
}

std::vector<Factor> PythonRegistration::match(Id earlier, Id later) {
  return match_proposed({.earlier = earlier, .later = later, .gain = 0.0, .expected = {}});
}

std::vector<Factor> PythonRegistration::match_proposed(const MatchProposal& proposal) {
  const auto work = [&] {
    const auto at = recording_->find(proposal.later);
    if (!at)
      throw Error(ErrorCode::plugin,
                  "there is no pose " + id_text(proposal.later) + " in the recording");
    return factors_of(match_(proposal_of(proposal, recording_->type(*at))),
                      "what the registration returned");
  };
  return call(work, std::vector<Factor>());
}

std::optional<RecognisedPlace> PythonRegistration::recognise(std::span<const Id> places, Id pose) {
  if (recognise_.is_none()) return Registration::recognise(places, pose);
  const auto work = [&]() -> std::optional<RecognisedPlace> {
    const py::object found = recognise_(array_of_ids(places), pose);
    if (found.is_none()) return std::nullopt;
    if (!py::isinstance<py::tuple>(found) || py::len(found) != 2) {
      throw Error(ErrorCode::usage,
                  "what recognise returned: expected None, or the id of a place and the factors "
                  "measured between it and the pose");
    }
    return RecognisedPlace{found[py::int_(0)].cast<Id>(),
                           factors_of(found[py::int_(1)], "the second of what recognise returned")};
  };
  return call(work, std::optional<RecognisedPlace>());
}

void PythonRegistration::pose_ended(Id pose, bool kept) {
  if (pose_ended_.is_none()) return;
  call([&] { return pose_ended_(pose, kept), true; }, true);
}

}  // namespace cairn::python
