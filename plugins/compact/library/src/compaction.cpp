// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/compaction.hpp"

#include <algorithm>
#include <utility>

#include <fmt/core.h>

#include "cairn/evaluation/plausibility.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/result_fields.hpp"
#include "cairn/runtime/timed.hpp"
#include "cairn/text/spelling.hpp"

namespace cairn {
namespace {

std::string strategy_of(const CompactionJob& job, const PolicySetting& setting) {
  const ComponentSpec& policy = job.job.policy;
  const OptionSpec* const own =
      setting.registry.options(PosePolicy::kKind, policy.name).find("strategy");
  if (const auto given = policy.values.find("strategy"); given != policy.values.end()) {
    if (!job.strategy.empty() && job.strategy != given->second) {
      throw Error(ErrorCode::usage,
                  "a strategy is given, and another among the policy's options: give one");
    }
    return given->second;
  }
  if (!job.strategy.empty()) {
    if (!own)
      throw Error(ErrorCode::usage, fmt::format("policy '{}' has no strategies", policy.name));
    std::vector<std::string> names = own->choices;
    names.emplace_back(kWholeStrategy);
    if (std::ranges::find(names, job.strategy) == names.end()) {
      throw Error(ErrorCode::usage, fmt::format("strategy cannot be '{}'{}", job.strategy,
                                                what_is_on_offer(job.strategy, names)));
    }
  }
  if (!own || (!job.strategy.empty() && job.strategy != kWholeStrategy)) return job.strategy;
  const std::string why_not =
      job.map ? "the trajectory continues a map" : why_no_whole_map(job.job, setting);
  if (why_not.empty()) return kWholeStrategy;
  if (job.strategy.empty()) return "fpfl";
  throw Error(ErrorCode::usage, fmt::format("strategy {}: {}", kWholeStrategy, why_not));
}

/// One compaction, step by step.
class Maker {
 public:
  Maker(const CompactionJob& job, PolicyData& data, const PolicySetting& setting,
        const CompactionWatch& watch)
      : job_(job), data_(data), setting_(setting), watch_(watch) {}

  Compaction make() {
    out_.job = job_.job;
    out_.strategy = strategy_of(job_, setting_);
    if (is_whole()) estimate_all();
    if (!choose_options()) {
      out_.result.interrupted = true;
      return std::move(out_);
    }
    select();
    if (is_whole()) take_whole();
    out_.check = out_.whole ? out_.whole->check : check_map(out_.job, out_.result, setting_);
    advise();
    return std::move(out_);
  }

 private:
  bool is_whole() const { return out_.strategy == kWholeStrategy; }
  void note(const std::string& sentence) const {
    if (watch_.note) watch_.note(sentence);
  }
  void fall_back(const std::string& why) {
    note(fmt::format("the map is that of strategy fpfl: {}", why));
    out_.strategy = "fpfl";
  }

  void estimate_all() {
    if (watch_.optimising) watch_.optimising(false);
    {
      Timed timed(out_.estimate_seconds);
      all_ = estimate_of_all(setting_);
    }
    if (watch_.optimising) watch_.optimising(true);
    if (!all_.why_not.empty()) {
      if (setting_.interrupted()) return;
      return fall_back(all_.why_not);
    }
    if (!all_.doubt.empty()) note(all_.doubt);
    const std::string words = left_out_in_words(all_, data_);
    if (words.empty()) return;
    note(words);
    out_.left_out = all_.left_out_on;
    out_.loops_left_out = all_.loops_left_out;
    data_ = without_contradictions(std::move(data_), all_);
  }

  bool finds() {
    if (job_.find) return *job_.find;
    if (gives_thresholds(out_.job.policy) || !finds_thresholds(out_.job.policy, setting_.registry))
      return false;
    if (data_.loops > 0 || data_.observations == 0) return true;
    note(
        "there are landmarks and no loop closures between poses, in which to find thresholds: "
        "those of the policy's defaults are used");
    return false;
  }

  /// False: interrupted.
  bool choose_options() {
    OptionValues& options = out_.job.policy.values;
    options.insert(job_.thresholds.begin(), job_.thresholds.end());
    if (setting_.interrupted()) return false;
    if (finds()) {
      out_.sample = threshold_sample(data_, job_.sample);
      if (out_.sample.count != out_.sample.asked) {
        note(fmt::format(
            "the first {} poses have too few loop closures to find thresholds: the sample is {} of "
            "{} poses",
            out_.sample.asked, out_.sample.count, data_.poses.size()));
      }
      // The error of a whole map does not depend on which loop closures the policy uses.
      out_.found = find_thresholds(out_.job, out_.sample.count, is_whole() ? 0.0 : job_.error_ratio,
                                   setting_);
      if (setting_.interrupted()) return false;
      options.insert(out_.found.options.begin(), out_.found.options.end());
    }
    // Not while thresholds are found, for which all measurements of the sample are used.
    if (job_.keep > 0 && !options.emplace("keep", fmt::format("{}", job_.keep)).second) {
      throw Error(ErrorCode::usage,
                  "the number of poses to keep is given, and among the policy's options: give one");
    }
    if (!out_.strategy.empty()) options.emplace("strategy", is_whole() ? "fpfl" : out_.strategy);
    // The policy's own map is not kept, so that relocation costs nothing.
    const bool relocates =
        setting_.registry.options(PosePolicy::kKind, out_.job.policy.name).find("reuse") != nullptr;
    if (is_whole() && relocates) options.emplace("reuse", "true");
    return true;
  }

  void select() {
    if (watch_.selecting) watch_.selecting();
    PolicyRun run(out_.job, setting_);
    if (job_.map) run.load(*job_.map);
    run.run(data_.poses.size(), out_.job.policy.name, [&](std::size_t pose) {
      if (watch_.pose) watch_.pose(pose, run.policy());
    });
    out_.result = run.finish(job_.recovery);
  }

  void take_whole() {
    WholeMap whole = take_whole_map(out_.job, setting_, all_, out_.result, watch_.removing);
    if (!whole.why_not.empty()) return fall_back(whole.why_not);
    // Files have no losses: what they have removed is seen here alone.
    if (all_.graph.has_losses()) {
      for (const std::string& doubt : notes_on_estimate(all_.graph, all_.chi2).notes) note(doubt);
    }
    out_.whole = std::move(whole);
  }

  void advise() {
    const PolicyResult& result = out_.result;
    if (out_.whole && out_.whole->advice) out_.advice.push_back(*out_.whole->advice);
    if (out_.whole) {
      for (const std::string& sentence : out_.whole->notes) note(sentence);
    }
    const bool few = out_.strategy == kWholeStrategy || out_.strategy == "fpfl";
    if (!few || result.interrupted || !result.located ||
        !finds_thresholds(out_.job.policy, setting_.registry))
      return;
    SelectionCheck check;
    for (const PoseReport& pose : result.poses) check.add(pose);
    // A whole map has all loop closures, whichever the policy uses.
    for (SelectionCheck::Advice& advice : check.advice(
             out_.found.seconds > 0.0 ? &out_.found : nullptr, out_.whole ? 0 : data_.loops))
      out_.advice.push_back(std::move(advice));
  }

  const CompactionJob& job_;
  PolicyData& data_;
  const PolicySetting& setting_;
  const CompactionWatch& watch_;
  EstimateOfAll all_;  ///< for the strategy `whole`
  Compaction out_;
};

}  // namespace

Compaction compact_recording(const CompactionJob& job, PolicyData& data,
                             const PolicySetting& setting, const CompactionWatch& watch) {
  return Maker(job, data, setting, watch).make();
}

ResultFields<Compaction> Compaction::fields() {
  using C = Compaction;
  return ResultFields<C>()
      .figure(
          "strategy",
          [](const C& c) { return c.strategy.empty() ? std::nullopt : std::optional(c.strategy); },
          "whole, or that of the policy")
      .figure(
          "status",
          [](const C& c) {
            return c.result.interrupted ? "interrupted"
                   : !c.result.located  ? "unlocated"
                   : c.result.converged ? "converged"
                                        : "max_iterations";
          },
          "converged, max_iterations, interrupted, or unlocated: no match with the map that was "
          "to be continued")
      .details()
      .part("thresholds", &C::found, "threshold_search")
      .at("thresholds.found")
      .attribute("thresholds")
      .part(&C::result)
      .without("loops.in")
      .figure(
          "loops.in", [](const C& c) { return c.result.loops + c.loops_left_out; },
          "loop closures of the recording")
      .before("loops.proposed")
      .detail()
      .attribute("counts.recorded_loops")
      .figure(
          "loops.used", [](const C& c) { return c.result.loops; },
          "those of them that do not contradict the others")
      .before("loops.proposed")
      .detail()
      .attribute("counts.loops")
      .figure("seconds.all", &C::estimate_seconds, "s",
              "of the estimate of all measurements, and of finding those that contradict it")
      .detail()
      .part("check", &C::check)
      .part("whole", &C::whole)
      .figure("left_out", &C::left_out,
              "measurements that contradict the others and are left out: the ids of the variables "
              "of each")
      .figure(
          "located", [](const C& c) { return c.result.located; },
          "whether the trajectory was matched with the map that was to be continued")
      .detail()
      .at("thresholds.seconds")
      .attribute("seconds.thresholds")
      .at("check.distance")
      .attribute("distance")
      .at("whole.kld")
      .attribute("kld");
}

}  // namespace cairn
