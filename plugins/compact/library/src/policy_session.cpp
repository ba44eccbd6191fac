// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/policy_session.hpp"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cairn/geometry/pose.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"
#include "policy_answers.hpp"
#include "pose_intake.hpp"

namespace cairn {
namespace {

bool same(const LinkReport& a, const LinkReport& b) {
  return a.earlier == b.earlier && a.later == b.later && a.verdict == b.verdict;
}

}  // namespace

PolicySession::PolicySession(PosePolicy& policy, StreamFormat& format, Registry& registry,
                             PolicySettings settings)
    : CommandSession(
          format, registry, {settings.output, settings.marginals},
          {command("NEW", &PolicySession::declare), command("NEXT", &PolicySession::propose),
           command("NOMATCH", &PolicySession::note_unmatched),
           command("DONE", &PolicySession::finish_pose),
           command("REMOVE", &PolicySession::take_back),
           command("COVARIANCE", &PolicySession::report_covariance),
           command("ESTIMATE", &PolicySession::report_estimate),
           refused("SOLVE", &PolicySession::refuse), refused("FULL", &PolicySession::refuse),
           refused("CHANGE", &PolicySession::refuse),
           refused("MARGINALIZE", &PolicySession::refuse),
           refused("SPARSIFY", &PolicySession::refuse)}),
      policy_(policy),
      settings_(std::move(settings)),
      intake_(std::make_unique<PoseIntake>()),
      answers_(std::make_unique<PolicyAnswers>()) {
  policy_.keep_chains(settings_.trajectory);
}

PolicySession::~PolicySession() = default;

/// What has come since the last answer is neither handed over nor reported to who only asks: it is
/// for the sender of the poses.
void PolicySession::perform(std::string_view line, const Words& words, Reply& reply) {
  if (!asking()) return CommandSession::perform(line, words, reply);
  struct SetAside {
    PolicyAnswers& answers;
    std::string text = answers.take();
    ~SetAside() { answers.put_back(std::move(text)); }
  } const results{*answers_};
  CommandSession::perform(line, words, reply);
}

void PolicySession::load(const Graph& map) {
  policy_.load(map);
  intake_->load(map);
}

bool PolicySession::located() const { return !intake_->newest() || policy_.unlocated().empty(); }

std::int64_t PolicySession::variable_count() const {
  return pose_count() + std::ssize(policy_.landmarks());
}

std::int64_t PolicySession::pose_count() const { return std::ssize(policy_.kept()); }

std::int64_t PolicySession::factor_count() const { return policy_.factor_count(); }

Graph PolicySession::trajectory() { return recovered_trajectory(policy_, Recovery::likely); }

std::vector<std::pair<std::string_view, std::int64_t>> PolicySession::counts() const {
  return {{"poses.in", answers_->poses},
          {"poses.kept", pose_count()},
          {"loops.proposed", answers_->proposed},
          {"loops.registered", answers_->registered},
          {"loops.kept", answers_->linked},
          {"loops.revoked", answers_->revoked},
          {"priors.kept", answers_->priors},
          {"landmarks.kept", answers_->landmarks},
          {"landmarks.undetermined", undetermined()},
          {"observations.kept", answers_->observations}};
}

std::vector<std::string> PolicySession::unread_notes() const { return answers_->notes(); }

// Data --------------------------------------------------------------------------------------------

void PolicySession::take_data(std::string_view text, Reply& reply) {
  StreamLine said = format().read(text, kStreamName, line(), registry(), settings_.read);
  for (Variable& variable : said.variables) take_variable(std::move(variable), reply);
  for (Factor& factor : said.factors) take_factor(std::move(factor));
  if (!said.held.empty()) hold(said.held);
  reply.changes = !said.skipped;
  put_notes(said.notes, reply);
}

void PolicySession::take_variable(Variable variable, Reply& reply) {
  if (is_point(*variable.type)) return intake_->add_landmark(variable);
  intake_->check_pose(variable);
  if (intake_->current()) {
    intake_->expect_complete();
    close(reply);
  }
  intake_->arrive(std::move(variable));
}

/// Not answered. Nothing that the policy would refuse later.
void PolicySession::take_factor(Factor factor) {
  if (factor.variables.size() == 1) {
    intake_->check_prior(factor);
    begin_measured(factor);
    intake_->add_prior(std::move(factor));
  } else if (intake_->is_observation(factor)) {
    intake_->check_observation(factor);
    begin_measured(factor);
    intake_->add_observation(std::move(factor));
  } else {
    take_edge(std::move(factor));
  }
}

/// Odometry of the pose that arrives, or a link of the newest.
void PolicySession::take_edge(Factor factor) {
  const Id other = intake_->other_end(factor.variables);
  if (intake_->take_odometry(factor, other)) return;
  intake_->expect_kept(other);
  intake_->expect_complete();
  begin();
  if (intake_->measured() && intake_->measured()->other != other) offer();
  intake_->add_measured(other, std::move(factor));
}

/// For each measurement of the open pose but its links: brings it into canonical form, and hands
/// the pose over.
void PolicySession::begin_measured(Factor& measured) {
  std::string name(measured.type->tag());
  for (const Id id : measured.variables) name += fmt::format(" {}", id);
  if (const std::string problem = measured.type->normalize(measured.measurement.data());
      !problem.empty())
    throw bad_line(fmt::format("{}: {}", name, problem));
  intake_->expect_complete();
  if (!policy_.unlocated().empty()) {
    throw bad_line(
        name +
        ": it is not known where the robot is on the map; expected a match with it (LOCATE) first");
  }
  begin();
}

void PolicySession::hold(std::span<const Id> ids) {
  intake_->expect_arriving(ids);
  if (!policy_.unlocated().empty()) {
    throw bad_line(fmt::format(
        "FIX {}: it is not known where the pose is on the map, whose poses determine where it is",
        *intake_->current()));
  }
  intake_->hold();
}

// From the arrival of a pose to its end -----------------------------------------------------------

void PolicySession::begin() {
  if (!intake_->arriving()) return;
  Variable pose = intake_->arriving()->pose;
  const bool first = !intake_->newest();
  if (!first && !pose.fixed) pose.state.clear();  // where its odometry puts it
  try {
    policy_.add_pose(pose, intake_->arriving()->odometry);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::usage) throw;  // what it refuses is not this pose
    throw Error(error.code(), fmt::format("pose {} is not taken: {}; expected 'REMOVE VARIABLE "
                                          "{}', and other odometry",
                                          pose.id, error.what(), pose.id));
  }
  intake_->begun();
  if (first && !located()) {
    answers_->note(
        "until a pose is matched with one of the map, the estimates of the new poses are in a "
        "frame of their own");
  }
  asked_.clear();
  asked_place_ = false;
  reported_.clear();
  ++answers_->poses;
}

/// Offers what was measured between the newest pose and one other.
void PolicySession::offer() {
  const std::optional<PoseIntake::Measured> measured = intake_->take_measured();
  if (!measured) return;
  asked_.clear();
  ++answers_->registered;
  try {
    const LinkReport link = policy_.offer(measured->other, measured->factors);
    reported_.push_back(link);
    answers_->link(link);
  } catch (const Error& error) {
    // The lines were taken, and what follows them is not to blame.
    answers_->note(fmt::format("the link from {} to {} was not taken: {}", measured->other,
                               *intake_->newest(), error.what()));
  }
}

void PolicySession::offer_priors() {
  for (const Factor& prior : intake_->take_priors()) {
    try {
      (void)policy_.offer_prior(prior);  // its report is in that of the pose
    } catch (const Error& error) {
      answers_->note(fmt::format("{} {} was not taken: {}", prior.type->tag(),
                                 prior.variables.front(), error.what()));
    }
  }
}

void PolicySession::offer_landmarks() {
  for (const LandmarkObservation& observation : intake_->take_observations()) {
    try {
      policy_.offer_landmark(observation);  // its report is in that of the pose
    } catch (const Error& error) {
      answers_->note(fmt::format("what was measured of landmark {} was not taken: {}",
                                 observation.landmark.id, error.what()));
    }
  }
}

/// Hands over to the policy what has come.
void PolicySession::settle(Reply& reply) {
  if (asking() || !intake_->complete()) return;
  const bool coming = intake_->arriving() || intake_->measured();
  begin();  // or nothing has changed
  offer();
  reply.changes = reply.changes || coming;
}

/// Ends the pose of now.
PoseReport PolicySession::end(Reply& reply) {
  settle(reply);
  offer_priors();
  offer_landmarks();
  PoseReport report = policy_.end_pose();
  selection_.add(report);
  intake_->ended(report.id, report.kept);
  note_decisions(report);
  return report;
}

/// Ends the pose, and answers.
void PolicySession::close(Reply& reply) {
  const PoseReport report = end(reply);
  reply.changes = reply.solved = true;
  reply.seconds = report.seconds.total;
  answers_->add(fmt::format("{} {}\n", report.kept ? "KEPT" : "DROPPED", report.id));
  note_removed();
  write_results(report.kept);
  answer(reply, {});
}

/// The newest pose is kept in any case, and everything solved.
void PolicySession::finish() {
  if (finished_) return;
  if (!intake_->complete()) {
    const Id id = *intake_->current();
    answers_->note(
        fmt::format("pose {} is left out: no relative pose between {} and {} was measured", id,
                    *intake_->newest(), id));
    intake_->withdraw();
  }
  try {
    Reply unread;
    if (intake_->current()) {
      end(unread);
      note_removed();
    }
  } catch (const Error& error) {
    if (!intake_->arriving() || error.code() == ErrorCode::usage) throw;
    answers_->note(error.what());
    intake_->withdraw();
  }
  converged_ = policy_.finish();
  note_end();
  finished_ = true;
  const std::optional<Id> newest = intake_->newest();
  if (!newest) return;
  intake_->note_kept(*newest);
  answers_->add(fmt::format("KEPT {}\n", *newest));
  note_removed();
  write_results(true);
}

// Commands ----------------------------------------------------------------------------------------

void PolicySession::declare(const Words& words, Reply& reply) {
  take_variable(declared_variable(words), reply);
  reply.changes = true;
}

/// Asked again before an answer came, it says the same.
void PolicySession::propose(const Words& words, Reply& reply) {
  expect_words(words, 1, "NEXT");
  intake_->expect_complete();
  settle(reply);
  if (asked_.empty()) {
    const std::optional<MatchProposal> match = policy_.next_match();
    reply.changes = true;
    answers_->proposed += match.has_value();
    if (!match && !asked_place_ && !located()) {
      asked_place_ = true;  // once: who recognises no place goes on with NEXT
      return answer(reply, fmt::format("LOCATE {}\n", *intake_->newest()));
    }
    asked_ = match ? PolicyAnswers::match_line(*match, intake_->motions()->tangent_size())
                   : "MATCH NONE\n";
  }
  answer(reply, asked_);
}

/// Data, as an edge is: not answered.
void PolicySession::note_unmatched(const Words& words, Reply& reply) {
  expect_words(words, 3, "NOMATCH id id");
  const Id ends[] = {parse_whole(words[1], "id"), parse_whole(words[2], "id")};
  const Id other = intake_->other_end(ends);
  intake_->expect_kept(other);
  intake_->expect_complete();
  settle(reply);
  asked_.clear();
  reported_.push_back(policy_.offer(other, {}));
  reply.changes = true;
}

void PolicySession::finish_pose(const Words& words, Reply& reply) {
  expect_words(words, 1, "DONE");
  intake_->expect_complete();
  close(reply);
}

void PolicySession::take_back(const Words& words, Reply& reply) {
  static const std::vector<std::string> kWhat{"LINK", "VARIABLE"};
  const std::string_view what = words.size() > 1 ? words[1] : "";
  if (what == kWhat[0]) return revoke(words, reply);
  if (const std::string near = nearest_spelling(what, kWhat); !near.empty() && near != what)
    throw bad_line(fmt::format("REMOVE {}; did you mean 'REMOVE {}'?", what, near));
  if (words.size() != 3 || words[1] != "VARIABLE" || !intake_->arriving() ||
      parse_whole(words[2], "id") != intake_->arriving()->pose.id) {
    throw bad_line(
        "the policy decides what stays: only links can be removed, and a pose that has just come, "
        "and has no lines but its odometry, and no question; expected 'REMOVE LINK id id', or "
        "'REMOVE VARIABLE id' "
        "with its id");
  }
  intake_->withdraw();
  reply.changes = true;
  answer(reply, {});
}

/// Links that are in the graph, or wait.
void PolicySession::revoke(const Words& words, Reply& reply) {
  expect_words(words, 4, "REMOVE LINK id id");
  const Id a = parse_whole(words[2], "id"), b = parse_whole(words[3], "id");
  for (const Id id : {a, b}) {
    if (!intake_->has_ended(id) && intake_->current() != id)
      throw bad_line(fmt::format("there is no pose {}", id));
  }
  settle(reply);
  bool there = false;
  try {
    there = policy_.revoke(a, b);
  } catch (const Error&) {
    reply.changes = true;  // odometry that waited for the next link may have reached the estimator
    throw;
  }
  if (!there) throw bad_line(fmt::format("there is no link of poses {} and {}", a, b));
  reply.changes = true;
  asked_.clear();
  ++answers_->revoked;
  answer(reply, fmt::format("UNLINKED {} {}\n", a, b));
}

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
  answer(reply, wanted_covariance(estimator, a, *estimator.type(a), b, *estimator.type(b)));
}

void PolicySession::report_estimate(const Words& words, Reply& reply) {
  expect_words(words, 2, "ESTIMATE id' or 'ESTIMATE ALL");
  if (words[1] == "ALL") {
    settle(reply);
    std::string all;
    if (const std::optional<Id> newest = intake_->newest()) {
      for (const Id id : policy_.kept()) all += estimate_of(id);
      if (!in_graph(*newest)) all += estimate_of(*newest);
      for (const Id id : policy_.landmarks()) all += estimate_of(id);
    }
    return answer(reply, std::move(all));
  }
  const Id id = parse_whole(words[1], "id");
  const bool will_begin = !asking() && intake_->arriving() && intake_->complete();
  const std::optional<Id> newest = will_begin ? intake_->current() : intake_->newest();
  const bool left_out = newest != id && !in_graph(id);
  if (left_out && !(settings_.trajectory && intake_->has_ended(id))) {
    throw bad_line(
        fmt::format("there is no estimate of {}; expected a pose that was kept{}, a landmark "
                    "that was added, or the newest pose once its odometry is there",
                    id, settings_.trajectory ? "" : " (with --trajectory also one that was not)"));
  }
  if (!left_out) {
    settle(reply);
    return answer(reply, estimate_of(id));
  }
  const VariableType& type = intake_->motions()->type();
  const auto recovered = [&] { return recovered_state(policy_, type, id, Recovery::likely); };
  if (!recovered()) {
    throw bad_line(fmt::format(
        "pose {} was not kept, and is estimated from the next pose that is: ask again then", id));
  }
  settle(reply);
  answer(reply, estimate_line(type, id, *recovered()));
}

void PolicySession::refuse(const Words& words, Reply& /*reply*/) {
  const bool solving = words[0] == "SOLVE" || words[0] == "FULL";
  throw bad_line(fmt::format(
      "{} is not for a run with a policy, which {}", words[0],
      solving ? "solves by itself when a loop closes, and everything at the end"
              : "goes on deciding from what it has taken, and could not take that into account"));
}

// Answers -----------------------------------------------------------------------------------------

void PolicySession::answer(Reply& reply, std::string text) {
  reply.text += answers_->take() + text;
  acknowledge(reply);
}

/// The policy lists all links of the pose; those that had been waiting are news.
void PolicySession::note_decisions(const PoseReport& report) {
  auto reported = reported_.begin();
  for (const LinkReport& link : report.links) {
    if (reported != reported_.end() && same(*reported, link)) {
      ++reported;
    } else {
      answers_->link(link);
    }
  }
  for (const PriorReport& prior : report.priors) answers_->prior(prior);
  for (const LandmarkReport& landmark : report.landmarks) {
    answers_->landmark(landmark, [this] {
      return std::ranges::count_if(policy_.landmarks(),
                                   [this](Id id) { return intake_->is_landmark(id); });
    });
  }
  for (const std::string& note : report.notes) answers_->note(note);
}

/// Poses that have left the graph with the newest one.
void PolicySession::note_removed() {
  for (const Id id : policy_.removed()) {
    intake_->left(id);
    forget_estimate(id);
    answers_->add(fmt::format("REMOVED {}\n", id));
  }
}

/// What is to be known at the end, and whether everything was kept, or nothing matched, and what
/// would change it: of a policy that has thresholds.
void PolicySession::note_end() {
  if (!converged_) answers_->note("the estimate has not converged");
  if (!located()) {
    answers_->note(
        "no pose was matched with one of the map: the two are not connected, and their relative "
        "position is unknown");
  }
  if (const std::int64_t count = undetermined(); count > 0) {
    answers_->note(fmt::format(
        "{} of the landmarks that were seen are not in the graph: what was measured of them does "
        "not determine where they are (several poses together may, unless several_views=false)",
        count));
  }
  if (!query<OptionFinder>(policy_) || !located()) return;
  for (const SelectionCheck::Advice& advice : selection_.advice())
    answers_->note(to_string(advice));
}

/// What --output and --marginals ask for at the end of a pose.
void PolicySession::write_results(bool kept) {
  const Id newest = *intake_->newest();
  const auto all = [&](bool with_newest) {
    std::vector<Id> ids = policy_.kept();
    if (with_newest && !kept) ids.push_back(newest);
    std::ranges::copy(policy_.landmarks(), std::back_inserter(ids));
    return ids;
  };
  answers_->add(wanted_estimates(
      newest, [&] { return all(true); },
      [&](Id id, const Estimate& take) {
        if (id == newest) return take(intake_->motions()->type(), policy_.newest_state());
        Estimator& estimator = policy_.estimator();
        take(*estimator.type(id), estimator.state(id));
      }));
  if (!kept) forget_estimate(newest);  // its state is never written again
  // Where the pose is not kept they are the same as before.
  if (!kept || !located()) return;
  for (const Id id : wanted_covariances(newest, [&] { return all(false); })) {
    Estimator& estimator = policy_.estimator();
    answers_->add(covariance_or_note(estimator, id, *estimator.type(id)));
  }
}

bool PolicySession::in_graph(Id id) const {
  if (intake_->is_kept(id)) return true;
  if (intake_->is_landmark(id)) return policy_.estimator().has(id);
  if (intake_->newest() != id) return false;
  const std::vector<Id> kept = policy_.kept();
  return !kept.empty() && kept.back() == id;
}

/// While the robot's place on the map is unknown.
bool PolicySession::on_map(Id id) const {
  const std::vector<Id> map = policy_.unlocated();
  return std::ranges::find(map, id) != map.end();
}

/// Of a landmark or a kept pose, for which the estimator must have been read, or of the newest.
std::string PolicySession::estimate_of(Id id) const {
  if (id == intake_->newest())
    return estimate_line(intake_->motions()->type(), id, policy_.newest_state());
  Estimator& estimator = policy_.estimator();
  return estimate_line(*estimator.type(id), id, estimator.state(id));
}

}  // namespace cairn
