// SPDX-License-Identifier: BSD-3-Clause
#include "compact_run.hpp"

#include <array>
#include <chrono>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "cairn/linear/linear_solver.hpp"
#include "cairn/linear/linearizer.hpp"
#include "cairn/linear/normal_equations.hpp"
#include "progress.hpp"
#include "table.hpp"

namespace cairn::app {
namespace {

using Clock = std::chrono::steady_clock;

/// Counts and times what goes through it.
class WatchedRegistration final : public Registration {
 public:
  WatchedRegistration(Registration& inner, CompactResult& result)
      : inner_(inner), result_(result), false_(query<FalseMatches>(inner)) {}
  void begin(const RegistrationData& data) override { inner_.begin(data); }
  std::vector<Factor> match(Id earlier, Id later) override {
    const auto begin = Clock::now();
    std::vector<Factor> factors = inner_.match(earlier, later);
    result_.registration_seconds += std::chrono::duration<double>(Clock::now() - begin).count();
    ++result_.proposed;
    result_.registered += !factors.empty();
    if (!factors.empty() && was_false(earlier, later)) ++result_.false_registered;
    return factors;
  }
  bool was_false(Id earlier, Id later) const { return false_ && false_->was_false(earlier, later); }

 private:
  Registration& inner_;
  CompactResult& result_;
  FalseMatches* false_;
};

/// Shows how far a run is.
class Progress {
 public:
  Progress(std::string title, std::size_t count, bool quiet)
      : title_(std::move(title)), count_(count), line_(quiet) {}
  void step(const CompactResult& result) {
    kept_ += result.poses.back().kept;
    const auto interval = std::chrono::milliseconds(line_.on_terminal() ? 50 : 5000);
    if (Clock::now() - shown_ < interval) return;
    shown_ = Clock::now();
    const std::size_t at = result.poses.size();
    line_.show(fmt::format("{} {} pose {} of {}: {} kept, {}, {}", title_,
                           bar(static_cast<double>(at) / static_cast<double>(count_), 20), at,
                           count_, kept_, plural(result.kept_loops, "loop closure"),
                           seconds_text(result.seconds.total)));
  }

 private:
  std::string title_;
  std::size_t count_;
  int kept_ = 0;
  StatusLine line_;
  Clock::time_point shown_ = Clock::now();
};

void count_nonzeros(CompactResult& result, Registry& registry) {
  const auto solver = registry.make<LinearSolver>(kDefaultLinearSolver);
  const NormalEquations equations(result.compact, *solver);
  if (equations.size() == 0) return;
  // H keeps its lower triangle, with whole blocks on the diagonal.
  const std::int64_t block = result.compact.type(0).tangent_size();
  result.information_nonzeros =
      2 * static_cast<std::int64_t>(equations.H().values().size()) - block * equations.size();
  result.factor_nonzeros = solver->stats().factor_nonzeros;
}

void evaluate(PosePolicy& policy, const Recording& recording, CompactResult& result) {
  if (!recording.truth) return;
  for (const auto& [how, name] : enum_names(Recovery{}))
    result.errors[std::string(name)] =
        compare(trajectory(recovered_way(policy, how)), *recording.truth);
  if (recording.truth_graph)
    result.normalized = normalized_error(result.compact, *recording.truth_graph);
}

}  // namespace

std::string spec_text(const ComponentSpec& spec) {
  std::string text = spec.name;
  for (const auto& [name, value] : spec.values)
    text += fmt::format("{}{}={}", text.size() == spec.name.size() ? ":" : ",", name, value);
  return text;
}

CompactRun::CompactRun(const CompactJob& job, const CompactSetting& setting)
    : setting_(setting),
      policy_(setting.session.registry().make<PosePolicy>(job.policy)),
      registration_(setting.session.registry().make<Registration>(job.registration)) {
  const Recording& recording = setting.recording;
  policy_->estimator().set_loss(setting.setup.loss(), setting.setup.loss_scope());
  registration_->begin({.recording = &recording.graph(),
                        .truth = recording.truth_graph ? &*recording.truth_graph : nullptr});
  result_.policy = spec_text(job.policy);
}

void CompactRun::run(std::size_t count, const std::string& title,
                     const std::function<void(std::size_t)>& after) {
  WatchedRegistration watched(*registration_, result_);
  Progress progress(title, count, setting_.session.common.quiet);
  run_policy(setting_.recording.graph(), std::span(setting_.recording.poses).first(count), *policy_,
             watched, [&](const PoseReport& pose) {
               result_.poses.push_back(pose);
               result_.seconds += pose.seconds;
               for (const LinkReport& link : pose.links) {
                 ++result_.verdicts[std::string(to_string(link.verdict))];
                 if (link.verdict != LinkVerdict::linked) continue;
                 ++result_.kept_loops;
                 result_.false_kept += watched.was_false(link.earlier, link.later);
               }
               progress.step(result_);
               if (after) after(result_.poses.size() - 1);
               return !setting_.guard.interrupted();
             });
  result_.interrupted = setting_.guard.interrupted();
}

CompactResult CompactRun::finish(Recovery recovery) {
  result_.compact = policy_->estimator().graph();
  result_.chi2 = policy_->estimator().chi2();
  result_.way = recovered_way(*policy_, recovery);
  count_nonzeros(result_, setting_.session.registry());
  evaluate(*policy_, setting_.recording, result_);
  return std::move(result_);
}

}  // namespace cairn::app
