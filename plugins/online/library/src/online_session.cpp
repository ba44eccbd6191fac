// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/online_session.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/graph/packed.hpp"
#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/text/spelling.hpp"
#include "cairn/update/marginal_prior.hpp"
#include "cairn/update/rejected_factors.hpp"

namespace cairn {
OnlineSession::OnlineSession(Estimator& estimator, StreamFormat& format, Registry& registry,
                             OnlineSettings settings)
    : CommandSession(
          format, registry, {settings.output, settings.marginals},
          {command("NEW", &OnlineSession::declare), command("REMOVE", &OnlineSession::remove),
           command("CHANGE", &OnlineSession::change),
           command("MARGINALIZE", &OnlineSession::marginalize),
           command("SPARSIFY", &OnlineSession::sparsify), command("SOLVE", &OnlineSession::solve),
           command("FULL", &OnlineSession::solve_fully),
           command("COVARIANCE", &OnlineSession::report_covariance),
           command("ESTIMATE", &OnlineSession::report_estimate)}),
      estimator_(estimator),
      settings_(std::move(settings)) {}

// Data ------------------------------------------------------------------------------------------

void OnlineSession::take_data(std::string_view text, Reply& reply) {
  StreamLine said = format().read(text, kStreamName, line(), registry(), settings_.read);
  for (Variable& variable : said.variables) take_variable(std::move(variable));
  bool left_out = false;
  for (Factor& factor : said.factors) {
    if (std::string missing = leave_out(factor); !missing.empty()) {
      said.notes.push_back(std::move(missing));
      left_out = true;
    } else {
      take_factor(std::move(factor), reply);
    }
  }
  // Each is held or none: a line is taken in whole.
  for (const Id id : said.held) {
    if (!find_waiting(id)) {
      throw bad_line(
          fmt::format("FIX {}: only what no measurement and no SOLVE has taken in yet can be held; "
                      "expected FIX "
                      "right after the line of the variable",
                      id));
    }
  }
  for (const Id id : said.held) hold(id);
  reply.changes = !said.skipped && !left_out;
  put_notes(said.notes, reply);
}

/// Why a factor is left out: on request, where it leads to a variable that never came.
std::string OnlineSession::leave_out(const Factor& factor) {
  if (!settings_.read.skip_dangling) return {};
  for (const Id id : factor.variables) {
    if (estimator_.has(id) || find_waiting(id)) continue;
    ++left_out_;
    return fmt::format("{} {} is left out: there is no variable {} ({} so far)", factor.type->tag(),
                       fmt::join(factor.variables, " "), id,
                       left_out_ == 1 ? "1 factor" : fmt::format("{} factors", left_out_));
  }
  return {};
}

void OnlineSession::take_variable(Variable variable) {
  const auto there = std::ranges::find(waiting_, variable.id, &Variable::id);
  // One that was declared without a state, and whose first measurement does not determine it, gets
  // its state by a line of its own.
  const bool gets_state = there != waiting_.end() && there->state.empty() &&
                          !variable.state.empty() && there->type->tag() == variable.type->tag();
  if (estimator_.has(variable.id) || (there != waiting_.end() && !gets_state)) {
    throw bad_line(
        fmt::format("{} {}: the id is already in use", variable.type->tag(), variable.id));
  }
  if (!variable.state.empty()) {
    if (const std::string problem = variable.type->normalize(variable.state.data());
        !problem.empty())
      throw bad_line(fmt::format("{} {}: {}", variable.type->tag(), variable.id, problem));
  }
  if (gets_state) {
    there->state = std::move(variable.state);
  } else {
    waiting_.push_back(std::move(variable));
  }
}

const Variable* OnlineSession::find_waiting(Id id) const {
  const auto there = std::ranges::find(waiting_, id, &Variable::id);
  return there == waiting_.end() ? nullptr : &*there;
}

void OnlineSession::hold(Id id) {
  for (Variable& variable : waiting_) {
    if (variable.id == id) variable.fixed = true;
  }
}

void OnlineSession::take_factor(Factor factor, Reply& reply) {
  GraphUpdate with;
  for (const Variable& variable : waiting_) {
    if (std::ranges::count(factor.variables, variable.id) > 0) with.variables.push_back(variable);
  }
  with.factors.push_back(std::move(factor));
  const bool dangling = with.variables.size() < waiting_.size();
  const bool solve = settings_.automatic && !dangling;
  // Before a pose comes, all measurements of the one before it are there.
  PoseRemover::Removal removal;
  if (solve && !with.variables.empty()) removal = make_room(with);
  update(std::move(with), solve, false, reply, removal);
}

// Updates ---------------------------------------------------------------------------------------

UpdateReport OnlineSession::update(GraphUpdate update, bool solve, bool full, Reply& reply,
                                   const PoseRemover::Removal& removal) {
  removal.add_to(update);
  UpdateReport report = hand_over(update, solve, full, reply);
  write_removal(removal, report.first_factor, reply);
  if (solve && !silent()) write_results(report, reply);
  return report;
}

UpdateReport OnlineSession::hand_over(const GraphUpdate& update, bool solve, bool full,
                                      Reply& reply) {
  const UpdateOptions how{.defer = !solve, .full = full, .max_seconds = settings_.budget};
  UpdateReport report = estimator_.update(update, how);
  follow(update);
  reply.changes = true;
  reply.solved = solve;
  if (solve) reply.seconds += report.seconds.total;
  owed_ = report.owed;
  return report;
}

/// Where lines of data are not solved, poses leave here: at the minimum, and are then reported.
void OnlineSession::solve_now(const GraphUpdate& update, bool full, Reply& reply) {
  UpdateReport report = hand_over(update, true, full, reply);
  const PoseRemover::Removal removal = make_room({});
  if (!removal.empty()) {
    std::vector<std::string> notes = std::move(report.notes);
    report = hand_over(removal.update, true, full, reply);
    notes.insert(notes.end(), report.notes.begin(), report.notes.end());
    report.notes = std::move(notes);
  }
  write_removal(removal, report.first_factor, reply);
  if (!silent()) write_results(report, reply);
}

PoseRemover::Removal OnlineSession::make_room(const GraphUpdate& coming) {
  if (settings_.keep == 0 || !settings_.remover) return {};
  try {
    return settings_.remover->make_room(estimator_, settings_.keep, coming);
  } catch (const Error& error) {  // which must not cost the measurement that has come
    return {.update = {}, .kld = 0.0, .note = fmt::format("no pose was removed: {}", error.what())};
  }
}

/// What the estimator has taken waits no more.
void OnlineSession::follow(const GraphUpdate& update) {
  for (const Variable& variable : update.variables) {
    newest_ = variable.id;
    std::erase_if(waiting_, [&](const Variable& v) { return v.id == variable.id; });
  }
  for (const Id id : update.marginalized) forget_estimate(id);
  for (const Id id : update.removed_variables) forget_estimate(id);
  if (!newest_ || estimator_.has(*newest_)) return;
  const std::vector<Id> left = estimator_.variables();
  newest_ = left.empty() ? std::nullopt : std::optional(left.back());
}

void OnlineSession::write_removal(const PoseRemover::Removal& removal, FactorId first_factor,
                                  Reply& reply) {
  if (silent()) return;
  if (removal.note != noted_ && !removal.note.empty())
    reply.text += fmt::format("NOTE {}\n", removal.note);
  if (!removal.note.empty() || !removal.empty()) noted_ = removal.note;
  for (const std::string& note : removal.notes) reply.text += fmt::format("NOTE {}\n", note);
  if (removal.empty()) return;
  for (const Id id : removal.update.removed_variables)
    reply.text += fmt::format("REMOVED {}\n", id);
  for (std::size_t k = 0; k < removal.update.factors.size(); ++k) {
    reply.text += fmt::format("FACTOR {} {}\n", first_factor + static_cast<FactorId>(k),
                              fmt::join(removal.update.factors[k].variables, " "));
  }
  reply.text += fmt::format("KLD {}\n", removal.kld);
}

void OnlineSession::write_results(const UpdateReport& report, Reply& reply) {
  for (const std::string& note : report.notes) reply.text += fmt::format("NOTE {}\n", note);
  if (newest_) {
    reply.text += wanted_estimates(
        *newest_, [this] { return estimator_.variables(); },
        [this](Id id, const Estimate& take) { take(type_of(id), estimator_.state(id)); });
  }
  for (const Id id : wanted_covariances(newest_, [this] { return estimator_.variables(); })) {
    // A map that is singular has none; the answer's last line says that.
    reply.text += report.ok ? covariance_or_note(estimator_, id, type_of(id))
                            : covariance_line(estimator_, id, type_of(id), id, type_of(id));
  }
  acknowledge(reply, owed_, !report.ok ? "SINGULAR" : !report.converged ? "UNCONVERGED" : "OK");
}

std::string OnlineSession::waiting() const {
  if (waiting_.empty()) return {};
  const std::string first = fmt::format("{} {}", waiting_.front().type->tag(), waiting_.front().id);
  if (waiting_.size() == 1) return first + " waits for a measurement";
  return fmt::format("{} variables wait for a measurement, the first of them {}", waiting_.size(),
                     first);
}

std::string OnlineSession::caveats() const {
  if (waiting_.empty() || silent()) return {};
  std::string note = fmt::format("NOTE {}: not in the estimate", waiting());
  if (settings_.automatic) {
    note += fmt::format(
        "; until {} one or is removed (REMOVE VARIABLE), lines of data are not solved but by SOLVE "
        "and FULL",
        waiting_.size() == 1 ? "it has" : "each has");
  }
  return note + '\n';
}

// Commands --------------------------------------------------------------------------------------

void OnlineSession::declare(const Words& words, Reply& reply) {
  take_variable(declared_variable(words));
  reply.changes = true;
}

void OnlineSession::remove(const Words& words, Reply& reply) {
  static const std::vector<std::string> kWhat{"FACTOR", "VARIABLE"};
  const bool factors = words.size() > 1 && words[1] == kWhat[0];
  if (words.size() < 3 || (!factors && words[1] != kWhat[1])) {
    const std::string near = words.size() > 1 ? nearest_spelling(words[1], kWhat) : "";
    throw bad_line(fmt::format(
        "expected 'REMOVE FACTOR k …' or 'REMOVE VARIABLE id …'{}",
        near.empty() || near == words[1] ? "" : fmt::format("; did you mean '{}'?", near)));
  }
  const auto ids = parse_ids(std::span(words).subspan(2), factors ? "number of a factor" : "id");
  GraphUpdate leaving;
  (factors ? leaving.removed_factors : leaving.removed_variables) = ids;
  // What only waits has not reached the estimator.
  const auto waits = [&](Id id) { return find_waiting(id) != nullptr; };
  if (!factors) std::erase_if(leaving.removed_variables, waits);
  update(std::move(leaving), settings_.automatic, false, reply);
  if (!factors) {
    std::erase_if(waiting_, [&](const Variable& v) { return std::ranges::count(ids, v.id) > 0; });
  }
  if (!reply.solved) acknowledge(reply, owed_);
}

void OnlineSession::change(const Words& words, Reply& reply) {
  if (words.size() < 3) throw bad_line("expected 'CHANGE k measurement… [information…]'");
  ChangedFactor changed{parse_whole(words[1], "number of a factor"), {}, {}};
  const std::shared_ptr<const FactorType> type =
      estimator_.has_factor(changed.factor) ? estimator_.factor(changed.factor).type : nullptr;
  if (!type || type->tag() == MarginalPrior::kTag)
    throw bad_line(fmt::format("there is no factor {} that can be changed", words[1]));
  const std::size_t size = static_cast<std::size_t>(type->measurement_size()),
                    packed = packed_size(type->residual_size());
  const std::span<const std::string_view> numbers = std::span(words).subspan(2);
  if (numbers.size() != size && numbers.size() != size + packed) {
    throw bad_line(fmt::format(
        "CHANGE {} with {} numbers; factor {} is a {}: expected its measurement of {}, and its "
        "information of {} if that changes too",
        words[1], numbers.size(), words[1], type->tag(), size, packed));
  }
  for (std::size_t k = 0; k < numbers.size(); ++k)
    (k < size ? changed.measurement : changed.information)
        .push_back(parse_real(numbers[k], "number"));
  GraphUpdate changing;
  changing.changed.push_back(std::move(changed));
  update(std::move(changing), settings_.automatic, false, reply);
  if (!reply.solved) acknowledge(reply, owed_);
}

void OnlineSession::marginalize(const Words& words, Reply& reply) {
  GraphUpdate leaving;
  leaving.marginalized = parse_ids(std::span(words).subspan(1), "id");
  const UpdateReport report = update(std::move(leaving), settings_.automatic, false, reply);
  if (silent()) return;
  std::string priors;
  if (!report.priors.empty() && !std::exchange(noted_unwritable_, true)) {
    priors += fmt::format(
        "NOTE what MARGINALIZE leaves is in no format of graphs: SAVE and -o write no graph while "
        "it is there, only the poses (SAVE poses.tum); SPARSIFY removes variables and leaves "
        "factors that are written, and REMOVE FACTOR {} takes out what this left, with its "
        "information\n",
        fmt::join(report.priors, " "));
  }
  for (const FactorId prior : report.priors) priors += fmt::format("PRIOR {}\n", prior);
  reply.text = priors + reply.text;
  if (!reply.solved) acknowledge(reply, owed_);
}

void OnlineSession::sparsify(const Words& words, Reply& reply) {
  if (!settings_.remover)
    throw bad_line("this session has no sparsifier; MARGINALIZE and REMOVE remove variables");
  if (words.size() < 2) throw bad_line("expected 'SPARSIFY id …' or 'SPARSIFY KEEP n'");
  if (words[1] == "KEEP") return keep(words, reply);
  const std::vector<Id> ids = parse_ids(std::span(words).subspan(1), "id");
  PoseRemover::Removal removal;
  try {
    removal = settings_.remover->remove(estimator_, ids);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::input) throw;
    throw bad_line(fmt::format("{}. Nothing has changed", error.what()));
  }
  update({}, settings_.automatic, false, reply, removal);
  if (!reply.solved) acknowledge(reply, owed_);
}

void OnlineSession::keep(const Words& words, Reply& reply) {
  expect_words(words, 3, "SPARSIFY KEEP n' or 'SPARSIFY KEEP ALL");
  constexpr int kFewest = 2, kMost = 1000000000;
  int limit = 0;
  if (words[2] != "ALL") {
    const std::int64_t count = parse_whole(words[2], "number of poses");
    if (count < kFewest || count > kMost) {
      throw bad_line(
          fmt::format("SPARSIFY KEEP {}: expected a number of poses from {} to {}, or ALL", count,
                      kFewest, kMost));
    }
    limit = static_cast<int>(count);
  }
  const int before = std::exchange(settings_.keep, limit);
  reply.changes = true;
  if (!settings_.automatic) return acknowledge(reply, owed_);  // poses leave with SOLVE
  try {
    // Here an error is an answer: of a sparsifier that there is not.
    const PoseRemover::Removal removal =
        limit > 0 ? settings_.remover->make_room(estimator_, limit, {}) : PoseRemover::Removal();
    if (removal.empty()) {
      write_removal(removal, 0, reply);
    } else {
      update({}, true, false, reply, removal);
    }
  } catch (const Error&) {
    settings_.keep = before;
    reply.changes = false;
    throw;
  }
  if (!reply.solved) acknowledge(reply, owed_);
}

void OnlineSession::solve(const Words& words, Reply& reply) {
  expect_words(words, 1, "SOLVE");
  GraphUpdate rest;  // what has a place, though no measurement
  for (const Variable& variable : waiting_) {
    if (!variable.state.empty()) rest.variables.push_back(variable);
  }
  solve_now(rest, false, reply);
}

void OnlineSession::solve_fully(const Words& words, Reply& reply) {
  expect_words(words, 1, "FULL");
  reply.text += caveats();
  solve_now({}, true, reply);
  if (silent()) return;
  const std::string rejected = in_words(rejected_factors(estimator_.graph()));
  if (!rejected.empty()) reply.text = fmt::format("NOTE {}\n", rejected) + reply.text;
}

void OnlineSession::report_covariance(const Words& words, Reply& reply) {
  expect_words(words, 3, "COVARIANCE id id");
  const Id a = parse_whole(words[1], "id"), b = parse_whole(words[2], "id");
  answer(reply, wanted_covariance(estimator_, a, type_of(a), b, type_of(b)));
}

void OnlineSession::report_estimate(const Words& words, Reply& reply) {
  expect_words(words, 2, "ESTIMATE id' or 'ESTIMATE ALL");
  if (words[1] != "ALL") return answer(reply, estimate_of(parse_whole(words[1], "id")));
  std::string all = caveats();
  for (const Id id : estimator_.variables()) all += estimate_of(id);
  answer(reply, std::move(all));
}

// Answers ---------------------------------------------------------------------------------------

const VariableType& OnlineSession::type_of(Id id) const {
  if (!estimator_.has(id))
    throw bad_line(fmt::format("there is no variable {} in the estimate{}", id,
                               find_waiting(id) ? ": it waits for a measurement" : ""));
  return *estimator_.type(id);
}

std::string OnlineSession::estimate_of(Id id) const {
  const VariableType& type = type_of(id);  // first: its message says more
  return estimate_line(type, id, estimator_.state(id));
}

void OnlineSession::answer(Reply& reply, std::string text) {
  reply.text += text;
  acknowledge(reply, owed_);
}

}  // namespace cairn
