// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/policy_session.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Core>

#include "cairn/geometry/pose.hpp"
#include "cairn/graph/packed.hpp"
#include "cairn/io/format.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn {
namespace {

std::string_view word_of(LinkVerdict verdict) {
  switch (verdict) {
    case LinkVerdict::linked:
      return "LINKED";
    case LinkVerdict::unmatched:
      return "UNMATCHED";
    case LinkVerdict::uninformative:
      return "UNINFORMATIVE";
    case LinkVerdict::inconsistent:
      return "INCONSISTENT";
    case LinkVerdict::waiting:
      return "WAITING";
    case LinkVerdict::nonlinear:
      return "NONLINEAR";
  }
  return "";
}

/// "MATCH i n gain", the expected motion, and the upper triangle of its covariance by rows.
std::string match_line(const MatchProposal& match, int tangent) {
  std::string text = fmt::format("MATCH {} {} {}", match.earlier, match.later, match.gain);
  for (const double number : match.expected.mean) text += fmt::format(" {}", number);
  if (!match.expected.covariance.empty()) {
    const Eigen::Map<const Eigen::MatrixXd> S(match.expected.covariance.data(), tangent, tangent);
    for (const double number : pack(S)) text += fmt::format(" {}", number);
  }
  return text + '\n';
}

bool same(const LinkReport& a, const LinkReport& b) {
  return a.earlier == b.earlier && a.later == b.later && a.verdict == b.verdict;
}

}  // namespace

PolicySession::PolicySession(PosePolicy& policy, StreamFormat& format, Registry& registry,
                             PolicySettings settings)
    : policy_(policy), format_(format), registry_(registry), settings_(std::move(settings)) {
  policy_.keep_chains(settings_.trajectory);
  std::vector<std::string> words;
  for (const auto& [name, command] : commands()) {
    if (command != &PolicySession::refuse) words.emplace_back(name);
  }
  format_.add_other_words(words);
}

std::span<const PolicySession::NamedCommand> PolicySession::commands() {
  static constexpr NamedCommand kCommands[] = {
      {"NEW", &PolicySession::declare},
      {"NEXT", &PolicySession::propose},
      {"NOMATCH", &PolicySession::note_unmatched},
      {"DONE", &PolicySession::finish_pose},
      {"REMOVE", &PolicySession::take_back},
      {"COVARIANCE", &PolicySession::report_covariance},
      {"ESTIMATE", &PolicySession::report_estimate},
      {"CHI2", &PolicySession::report_chi2},
      {"SAVE", &PolicySession::save},
      {"HELP", &PolicySession::help},
      {"QUIT", &PolicySession::quit},
      {"SOLVE", &PolicySession::refuse},
      {"FULL", &PolicySession::refuse},
      {"CHANGE", &PolicySession::refuse},
      {"MARGINALIZE", &PolicySession::refuse},
      {"SPARSIFY", &PolicySession::refuse},
  };
  return kCommands;
}

PolicySession::Command PolicySession::find_command(std::string_view word) {
  for (const auto& [name, command] : commands()) {
    if (name == word) return command;
  }
  return nullptr;
}

void PolicySession::perform(std::string_view line, const Words& words, Reply& reply) {
  if (asking()) return perform_question(words, reply);
  if (const Command command = find_command(words[0])) {
    (this->*command)(words, reply);
  } else {
    take_data(line, reply);
  }
}

/// What has come since the last answer is neither handed over nor reported here: it is for the
/// sender of the poses.
void PolicySession::perform_question(const Words& words, Reply& reply) {
  struct SetAside {
    std::string& place;
    std::string text = std::exchange(place, {});
    ~SetAside() { place = std::move(text); }
  } const results{answer_};
  (this->*find_command(words[0]))(words, reply);
}

void PolicySession::load(const Graph& map) {
  policy_.load(map);
  for (int v = 0; v < map.variable_count(); ++v) {
    if (is_point(map.type(v))) {
      landmarks_.emplace(map.id(v), map.variable(v).type);
      continue;
    }
    arrived_.insert(map.id(v));
    kept_.insert(map.id(v));
    if (!motions_) motions_.emplace(map.variable(v).type);
  }
}

void PolicySession::finish() {
  if (finished_) return;
  finish_trajectory();
}

std::int64_t PolicySession::variable_count() const {
  return pose_count() + std::ssize(policy_.landmarks());
}

std::int64_t PolicySession::pose_count() const { return std::ssize(policy_.kept()); }

std::int64_t PolicySession::factor_count() const { return policy_.factor_count(); }

Graph PolicySession::trajectory() { return recovered_trajectory(policy_, Recovery::likely); }

std::vector<std::pair<std::string_view, std::int64_t>> PolicySession::counts() const {
  return {{"poses.in", counts_.poses},
          {"poses.kept", pose_count()},
          {"loops.proposed", counts_.proposed},
          {"loops.registered", counts_.registered},
          {"loops.kept", counts_.linked},
          {"loops.revoked", counts_.revoked},
          {"priors.kept", counts_.priors},
          {"landmarks.kept", counts_.landmarks},
          {"landmarks.undetermined", undetermined()},
          {"observations.kept", counts_.observations}};
}

// Data --------------------------------------------------------------------------------------------

void PolicySession::take_data(std::string_view text, Reply& reply) {
  StreamLine said = format_.read(text, kStreamName, line(), registry_, settings_.read);
  for (Variable& variable : said.variables) take_variable(std::move(variable), reply);
  for (Factor& factor : said.factors) {
    if (factor.variables.size() == 1) {
      take_prior(std::move(factor));
    } else if (is_observation(factor)) {
      take_observation(std::move(factor));
    } else {
      take_edge(std::move(factor));
    }
  }
  if (!said.held.empty()) hold(said.held);
  reply.changes = !said.skipped;
  put_notes(said.notes, reply);
}

void PolicySession::take_variable(Variable variable, Reply& reply) {
  is_point(*variable.type) ? take_landmark(variable) : take_pose(std::move(variable), reply);
}

void PolicySession::take_pose(Variable pose, Reply& reply) {
  const std::string name = fmt::format("{} {}", pose.type->tag(), pose.id);
  if (!is_pose(*pose.type)) {
    throw bad_line(name +
                   " is neither a pose nor a landmark; with a policy a robot's poses and the "
                   "landmarks that it sees can come");
  }
  if (motions_ && motions_->type().tag() != pose.type->tag()) {
    throw bad_line(fmt::format("{}: the poses before it are {}; expected another", name,
                               motions_->type().tag()));
  }
  if (arrived_.contains(pose.id) || current() == pose.id || landmarks_.contains(pose.id))
    throw bad_line(name + ": the id is already in use");
  if (!pose.state.empty()) {
    if (const std::string problem = pose.type->normalize(pose.state.data()); !problem.empty())
      throw bad_line(fmt::format("{}: {}", name, problem));
  }
  if (current()) {
    expect_complete();
    close(reply);
  }
  if (!motions_) motions_.emplace(pose.type);
  arriving_ = ArrivingPose{std::move(pose), {}};
}

void PolicySession::hold(std::span<const Id> ids) {
  for (const Id id : ids) {
    if (!arriving_ || arriving_->pose.id != id) {
      throw bad_line(fmt::format(
          "FIX {}: only a pose that has just come can be held; expected FIX right after the line "
          "of the pose",
          id));
    }
  }
  if (!policy_.unlocated().empty()) {
    throw bad_line(fmt::format(
        "FIX {}: it is not known where the pose is on the map, whose poses determine where it is",
        arriving_->pose.id));
  }
  arriving_->pose.fixed = true;
}

/// Odometry of the pose that arrives, or a link of the newest.
void PolicySession::take_edge(Factor factor) {
  const Id other = other_end(factor.variables);
  check_motion(factor, other);
  if (other == (arriving_ ? newest_ : before_)) {
    if (!arriving_) {
      throw bad_line(
          fmt::format("odometry from pose {} to {} after other lines of pose {}; "
                      "expected it right after the line that brings the pose",
                      other, *newest_, *newest_));
    }
    arriving_->odometry.push_back(std::move(factor));
    return;
  }
  check_kept(other);
  expect_complete();
  begin();
  if (measured_ && measured_->other != other) offer();
  if (!measured_) measured_ = Measured{other, {}};
  measured_->factors.push_back(std::move(factor));
}

/// The one of two ids that is not the pose of now.
Id PolicySession::other_end(std::span<const Id> ends) const {
  const std::optional<Id> pose = current();
  if (!pose) throw bad_line("there is no pose that is not done; expected the line of the next one");
  const bool between = ends.size() == 2 && (ends[0] == pose) != (ends[1] == pose);
  if (!between) {
    throw bad_line(fmt::format(
        "between {}; expected a relative pose between pose {}, which is the newest, and another",
        fmt::join(ends, " and "), *pose));
  }
  return ends[0] == pose ? ends[1] : ends[0];
}

/// Nothing that the policy would refuse later, when others wait for an answer.
void PolicySession::check_motion(const Factor& factor, Id from) const {
  const FactorType& type = *factor.type;
  if (!type.is_relative() || type.variable_tags().front() != motions_->type().tag()) {
    throw bad_line(fmt::format("{} is not a relative pose of {}, and a policy takes nothing else",
                               type.tag(), motions_->type().tag()));
  }
  (void)motions_->to_factor(factor.type, from, *current(), motions_->of_factor(factor, from));
}

void PolicySession::check_kept(Id id) const {
  if (!arrived_.contains(id)) throw bad_line(fmt::format("there is no pose {}", id));
  if (kept_.contains(id)) return;
  // Which of the two it was is not remembered: that would take memory for as long as it runs.
  throw bad_line(
      fmt::format("pose {} was not kept{}; expected a pose that is, such as NEXT proposes", id,
                  removes_ ? ", or has left since (DROPPED, REMOVED)" : ""));
}

// The way of a pose -------------------------------------------------------------------------------

/// The pose that arrives, or is open.
std::optional<Id> PolicySession::current() const {
  if (arriving_) return arriving_->pose.id;
  return open_ ? newest_ : std::nullopt;
}

/// Whether the pose that arrives can be handed over.
bool PolicySession::complete() const {
  return !arriving_ || !newest_ || !arriving_->odometry.empty();
}

void PolicySession::expect_complete() const {
  if (!current())
    throw bad_line("there is no pose that is not done; expected the line of the next one");
  if (!complete()) {
    throw bad_line(fmt::format(
        "pose {} has no odometry yet; expected a relative pose between poses {} and {} first",
        arriving_->pose.id, *newest_, arriving_->pose.id));
  }
}

void PolicySession::begin() {
  if (!arriving_) return;
  Variable pose = arriving_->pose;
  if (newest_ && !pose.fixed) pose.state.clear();  // where its odometry puts it
  try {
    policy_.add_pose(pose, arriving_->odometry);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::usage) throw;  // what it refuses is not this pose
    throw Error(error.code(), fmt::format("pose {} is not taken: {}; expected 'REMOVE VARIABLE "
                                          "{}', and other odometry",
                                          pose.id, error.what(), pose.id));
  }
  before_ = std::exchange(newest_, pose.id);
  if (!first_ && !located()) {
    answer_ +=
        "NOTE until a pose is matched with one of the map, the estimates of the new poses are in a "
        "frame of their own\n";
  }
  if (!first_) first_ = pose.id;
  arriving_.reset();
  open_ = true;
  asked_.clear();
  asked_place_ = false;
  reported_.clear();
  ++counts_.poses;
}

/// Offers what was measured between the newest pose and one other.
void PolicySession::offer() {
  if (!measured_) return;
  const Measured measured = *std::exchange(measured_, std::nullopt);
  asked_.clear();
  ++counts_.registered;
  try {
    const LinkReport link = policy_.offer(measured.other, measured.factors);
    reported_.push_back(link);
    note_link(link);
  } catch (const Error& error) {
    // The lines were taken, and what follows them is not to blame.
    answer_ += fmt::format("NOTE the link from {} to {} was not taken: {}\n", measured.other,
                           *newest_, error.what());
  }
}

/// Hands over to the policy what has come.
void PolicySession::settle(Reply& reply) {
  if (asking() || !complete()) return;
  const bool coming = arriving_ || measured_;
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
  open_ = false;
  arrived_.insert(report.id);
  if (report.kept) kept_.insert(report.id);
  // The policy lists all links of the pose; those that had been waiting are news.
  auto reported = reported_.begin();
  for (const LinkReport& link : report.links) {
    if (reported != reported_.end() && same(*reported, link)) {
      ++reported;
    } else {
      note_link(link);
    }
  }
  for (const PriorReport& prior : report.priors) note_prior(prior);
  for (const LandmarkReport& landmark : report.landmarks) note_landmark(landmark);
  for (const std::string& note : report.notes) answer_ += fmt::format("NOTE {}\n", note);
  return report;
}

/// Ends the pose, and answers.
void PolicySession::close(Reply& reply) {
  const PoseReport report = end(reply);
  reply.changes = reply.solved = true;
  reply.seconds = report.seconds.total;
  answer_ += fmt::format("{} {}\n", report.kept ? "KEPT" : "DROPPED", report.id);
  note_removed();
  write_results(report.kept);
  answer(reply);
}

/// The newest pose is kept in any case, and everything solved.
void PolicySession::finish_trajectory() {
  if (!complete()) {
    answer_ +=
        fmt::format("NOTE pose {} is left out: no relative pose between {} and {} was measured\n",
                    arriving_->pose.id, *newest_, arriving_->pose.id);
    arriving_.reset();
  }
  try {
    Reply unread;
    if (current()) {
      end(unread);
      note_removed();
    }
  } catch (const Error& error) {
    if (!arriving_ || error.code() == ErrorCode::usage) throw;
    answer_ += fmt::format("NOTE {}\n", error.what());
    arriving_.reset();
  }
  converged_ = policy_.finish();
  if (!converged_) answer_ += "NOTE the estimate has not converged\n";
  if (!located()) {
    answer_ +=
        "NOTE no pose was matched with one of the map: the two are not connected, and their "
        "relative position is unknown\n";
  }
  note_undetermined();
  note_selection();
  finished_ = true;
  if (!newest_) return;
  kept_.insert(*newest_);
  answer_ += fmt::format("KEPT {}\n", *newest_);
  note_removed();
  write_results(true);
}

/// Whether everything was kept, or nothing matched, and what would change it: of a policy that has
/// thresholds.
void PolicySession::note_selection() {
  if (!query<OptionFinder>(policy_) || !located()) return;
  for (const SelectionCheck::Advice& advice : selection_.advice())
    answer_ += fmt::format("NOTE {}\n", to_string(advice));
}

// Commands ----------------------------------------------------------------------------------------

void PolicySession::declare(const Words& words, Reply& reply) {
  take_variable(declared_variable(words, registry_), reply);
  reply.changes = true;
}

/// Asked again before an answer came, it says the same.
void PolicySession::propose(const Words& words, Reply& reply) {
  expect_words(words, 1, "NEXT");
  expect_complete();
  settle(reply);
  if (asked_.empty()) {
    const std::optional<MatchProposal> match = policy_.next_match();
    reply.changes = true;
    counts_.proposed += match.has_value();
    if (!match && !asked_place_ && !located()) {
      asked_place_ = true;  // once: who recognises no place goes on with NEXT
      answer_ += fmt::format("LOCATE {}\n", *newest_);
      return answer(reply);
    }
    asked_ = match ? match_line(*match, motions_->tangent_size()) : "MATCH NONE\n";
  }
  answer_ += asked_;
  answer(reply);
}

/// Data, as an edge is: not answered.
void PolicySession::note_unmatched(const Words& words, Reply& reply) {
  expect_words(words, 3, "NOMATCH id id");
  const Id ends[] = {parse_whole(words[1], "id"), parse_whole(words[2], "id")};
  const Id other = other_end(ends);
  check_kept(other);
  expect_complete();
  settle(reply);
  asked_.clear();
  reported_.push_back(policy_.offer(other, {}));
  reply.changes = true;
}

void PolicySession::finish_pose(const Words& words, Reply& reply) {
  expect_words(words, 1, "DONE");
  expect_complete();
  close(reply);
}

void PolicySession::take_back(const Words& words, Reply& reply) {
  static const std::vector<std::string> kWhat{"LINK", "VARIABLE"};
  const std::string_view what = words.size() > 1 ? words[1] : "";
  if (what == kWhat[0]) return revoke(words, reply);
  if (const std::string near = nearest_spelling(what, kWhat); !near.empty() && near != what)
    throw bad_line(fmt::format("REMOVE {}; did you mean 'REMOVE {}'?", what, near));
  if (words.size() != 3 || words[1] != "VARIABLE" || !arriving_ ||
      parse_whole(words[2], "id") != arriving_->pose.id) {
    throw bad_line(
        "the policy decides what stays: only links can be removed, and a pose that has just come, "
        "and has no lines but its odometry, and no question; expected 'REMOVE LINK id id', or "
        "'REMOVE VARIABLE id' "
        "with its id");
  }
  arriving_.reset();
  if (!newest_) motions_.reset();
  reply.changes = true;
  answer(reply);
}

/// Links that are in the graph, or wait.
void PolicySession::revoke(const Words& words, Reply& reply) {
  expect_words(words, 4, "REMOVE LINK id id");
  const Id a = parse_whole(words[2], "id"), b = parse_whole(words[3], "id");
  for (const Id id : {a, b}) {
    if (!arrived_.contains(id) && current() != id)
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
  ++counts_.revoked;
  answer_ += fmt::format("UNLINKED {} {}\n", a, b);
  answer(reply);
}

void PolicySession::refuse(const Words& words, Reply& /*reply*/) {
  const bool solving = words[0] == "SOLVE" || words[0] == "FULL";
  throw bad_line(fmt::format(
      "{} is not for a run with a policy, which {}", words[0],
      solving ? "solves by itself when a loop closes, and everything at the end"
              : "goes on deciding from what it has taken, and could not take that into account"));
}

void PolicySession::save(const Words& words, Reply& reply) {
  const std::string file = file_to_save(words);
  settle(reply);
  Estimator& estimator = policy_.estimator();
  if (!silent()) write_graph(estimator.graph(), file, registry_);
  answer(reply);
}

/// Not a change: a journal goes on before it.
void PolicySession::help(const Words& words, Reply& reply) {
  expect_words(words, 1, "HELP");
  std::vector<std::string_view> names;
  for (const auto& [name, command] : commands()) {
    if (command != &PolicySession::refuse) names.push_back(name);
  }
  answer_ += help_line(names);
  answer(reply);
}

void PolicySession::quit(const Words& words, Reply& reply) {
  expect_words(words, 1, "QUIT");
  reply.quit = true;
  finish_trajectory();
  reply.changes = false;
  answer(reply);
}

// Answers -----------------------------------------------------------------------------------------

void PolicySession::answer(Reply& reply) {
  reply.text += std::exchange(answer_, {});
  acknowledge(reply);
}

/// Tells of a link, and counts it.
void PolicySession::note_link(const LinkReport& link) {
  answer_ += fmt::format("{} {} {} {} {}\n", word_of(link.verdict), link.earlier, link.later,
                         link.gain, link.innovation);
  counts_.linked += link.verdict == LinkVerdict::linked;
}

/// Poses that have left the graph with the newest one.
void PolicySession::note_removed() {
  for (const Id id : policy_.removed()) {
    removes_ = true;
    kept_.erase(id);
    reported_states_.erase(id);
    answer_ += fmt::format("REMOVED {}\n", id);
  }
}

std::vector<std::string> PolicySession::unread_notes() const {
  constexpr std::string_view kNote = "NOTE ";
  std::vector<std::string> notes;
  std::istringstream lines(answer_);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(kNote)) notes.push_back(line.substr(kNote.size()));
  }
  return notes;
}

}  // namespace cairn
