// SPDX-License-Identifier: BSD-3-Clause
// What a policy's session answers of estimates and covariances.
#include <algorithm>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "cairn/policy/policy_session.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

void PolicySession::report_covariance(const Words& words, Reply& reply) {
  expect_words(words, 3, "COVARIANCE id id");
  const Id a = parse_whole(words[1], "id"), b = parse_whole(words[2], "id");
  for (const Id id : {a, b}) {
    if (in_graph(id)) continue;
    throw bad_line(fmt::format("there is no pose or landmark {} in the compact graph", id));
  }
  settle(reply);
  if (!located() && !(on_map(a) && on_map(b))) {
    throw Error(ErrorCode::numerical,
                "there is no covariance: no pose was matched with one of the map yet");
  }
  Estimator& estimator = policy_.estimator();
  const std::string text = covariance_line(estimator, a, *estimator.type(a), b, *estimator.type(b));
  if (text.empty()) {
    throw Error(ErrorCode::numerical, fmt::format("there is no covariance: {}", kNoCovariance));
  }
  answer_ += text;
  answer(reply);
}

void PolicySession::report_estimate(const Words& words, Reply& reply) {
  expect_words(words, 2, "ESTIMATE id' or 'ESTIMATE ALL");
  if (words[1] == "ALL") {
    settle(reply);
    if (newest_) {
      for (const Id id : policy_.kept()) write_estimate(id, answer_);
      if (!in_graph(*newest_)) write_estimate(*newest_, answer_);
      for (const Id id : policy_.landmarks()) write_estimate(id, answer_);
    }
    return answer(reply);
  }
  const Id id = parse_whole(words[1], "id");
  const std::optional<Id> newest = !asking() && arriving_ && complete() ? current() : newest_;
  const bool left_out = newest != id && !in_graph(id);
  if (left_out && !(settings_.trajectory && arrived_.contains(id))) {
    throw bad_line(
        fmt::format("there is no estimate of {}; expected a pose that was kept{}, a landmark "
                    "that was added, or the newest pose once its odometry is there",
                    id, settings_.trajectory ? "" : " (with --trajectory also one that was not)"));
  }
  if (left_out) {
    const auto recovered = [&] {
      return recovered_state(policy_, motions_->type(), id, Recovery::likely);
    };
    if (!recovered()) {
      throw bad_line(fmt::format(
          "pose {} was not kept, and is estimated from the next pose that is: ask again then", id));
    }
    settle(reply);
    answer_ += estimate_line(motions_->type(), id, *recovered());
    return answer(reply);
  }
  settle(reply);
  write_estimate(id, answer_);
  answer(reply);
}

void PolicySession::report_chi2(const Words& words, Reply& reply) {
  expect_words(words, 1, "CHI2");
  settle(reply);
  answer_ += chi2_line(policy_.estimator());
  answer(reply);
}

/// What --output and --marginals ask for at the end of a pose.
void PolicySession::write_results(bool kept) {
  const bool all = settings_.output == "all", changed = settings_.output == "changed";
  if (all || changed) {
    std::vector<Id> poses = policy_.kept();
    if (!kept) poses.push_back(*newest_);
    std::ranges::copy(policy_.landmarks(), std::back_inserter(poses));
    for (const Id id : poses) {
      std::string text;
      write_estimate(id, text);
      std::string& reported = reported_states_[id];
      if (changed && reported == text) continue;
      answer_ += text;
      reported = std::move(text);
    }
    if (!kept) reported_states_.erase(*newest_);  // its state is never written again
  }
  if (settings_.output == "last") write_estimate(*newest_, answer_);
  // Where the pose is not kept they are the same as before.
  if (!kept || !located() || settings_.marginals == "none") return;
  Estimator& estimator = policy_.estimator();
  std::vector<Id> ids{*newest_};
  if (settings_.marginals != "last") {
    ids = policy_.kept();
    std::ranges::copy(policy_.landmarks(), std::back_inserter(ids));
  }
  for (const Id id : ids) {
    answer_ += covariance_or_note(estimator, id, *estimator.type(id));
  }
}

bool PolicySession::in_graph(Id id) const {
  if (kept_.contains(id)) return true;
  if (landmarks_.contains(id)) return policy_.estimator().has(id);
  if (newest_ != id) return false;
  const std::vector<Id> kept = policy_.kept();
  return !kept.empty() && kept.back() == id;
}

/// While the robot's place on the map is unknown.
bool PolicySession::on_map(Id id) const {
  const std::vector<Id> map = policy_.unlocated();
  return std::ranges::find(map, id) != map.end();
}

/// Of a landmark or a kept pose, for which the estimator must have been read, or of the newest.
void PolicySession::write_estimate(Id id, std::string& text) const {
  if (id == newest_) {
    text += estimate_line(motions_->type(), id, policy_.newest_state());
  } else {
    Estimator& estimator = policy_.estimator();
    text += estimate_line(*estimator.type(id), id, estimator.state(id));
  }
}

}  // namespace cairn
