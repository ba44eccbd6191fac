// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/io/stream_format.hpp"
#include "cairn/online/conversation.hpp"
#include "cairn/online/journal.hpp"
#include "cairn/online/online_session.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/solve/estimator.hpp"
#include "calls.hpp"
#include "objects.hpp"

using namespace cairn::c;

namespace {

constexpr const char* kEstimator = "incremental_cholesky";
constexpr const char* kFormat = "g2o";

template <std::size_t N>
std::string one_of(const char* word, const std::array<const char*, N>& words, const char* otherwise,
                   const char* what) {
  const std::string chosen(name_or(word, otherwise));
  if (std::ranges::find(words, chosen) == words.end()) {
    throw cairn::Error(cairn::ErrorCode::usage, fmt::format("'{}' for {}; expected {}", chosen,
                                                            what, fmt::join(words, ", ")));
  }
  return chosen;
}

cairn::OnlineSettings settings_of(const cairn_session_settings& given_settings) {
  cairn::OnlineSettings settings;
  settings.output =
      one_of(given_settings.output, std::array{"none", "last", "changed", "all"}, "last", "output");
  settings.marginals =
      one_of(given_settings.marginals, std::array{"none", "last", "diagonal"}, "none", "marginals");
  settings.automatic = given_settings.explicit_solve == 0;
  settings.budget = given_settings.budget;
  if (!(std::isfinite(settings.budget) && settings.budget >= 0.0))
    throw cairn::Error(cairn::ErrorCode::usage, "budget: expected seconds, 0 or more");
  return settings;
}

}  // namespace

struct cairn_session {
  template <class Work>
  auto call(const Work& work) {
    return cairn::call_plugin([&] { return fmt::format("estimator '{}'", name); }, work);
  }

  cairn_session(std::shared_ptr<cairn::Registry> from, const std::string& estimator_name,
                cairn::OnlineSettings settings, const char* journal_file)
      : registry(std::move(from)),
        name(estimator_name),
        estimator(registry->make<cairn::Estimator>(name)),
        format(registry->make<cairn::StreamFormat>(kFormat)),
        remover(cairn::made_when_used({"sparsify", {}}, *registry)) {
    if (settings.marginals != "none") {
      estimator->keep_marginals(settings.marginals == "last" ? cairn::KeptMarginals::last
                                                             : cairn::KeptMarginals::diagonal);
    }
    settings.remover = remover.get();
    const bool automatic = settings.automatic;
    lines.emplace(*estimator, *format, *registry, std::move(settings));
    if (journal_file) {
      journal.emplace(journal_file,
                      fmt::format("lines in C, estimator {}, format {}, solve {}", name, kFormat,
                                  automatic ? "auto" : "explicit"),
                      cairn::Journal::Sync::batch);
      lines->protect(journal_file, "the journal");
    }
    conversation.emplace(*lines, journal ? &*journal : nullptr);
    answer = call([&] { return conversation->restore(); });
  }

  cairn_session(const cairn_session&) = delete;
  cairn_session& operator=(const cairn_session&) = delete;
  ~cairn_session() {
    // Lines that had no answer are in the journal as far as that can be.
    if (!failed) guarded([&] { conversation->finish(); });
  }

  std::shared_ptr<cairn::Registry> registry;
  std::string name;
  std::unique_ptr<cairn::Estimator> estimator;
  std::unique_ptr<cairn::StreamFormat> format;
  std::unique_ptr<cairn::PoseRemover> remover;
  std::optional<cairn::OnlineSession> lines;
  std::optional<cairn::Journal> journal;
  std::optional<cairn::Conversation> conversation;
  std::string answer;
  bool failed = false;
};

cairn_code cairn_session_new(cairn_registry* registry, const char* estimator,
                             const cairn_session_settings* settings, cairn_session** session) {
  return guarded([&] {
    given(session, "session");
    const auto& from = given(registry, "registry").registry;
    const cairn_session_settings none{};
    const cairn_session_settings& chosen = settings ? *settings : none;
    hand_out(session,
             std::make_unique<cairn_session>(from, std::string(name_or(estimator, kEstimator)),
                                             settings_of(chosen), chosen.journal));
  });
}

void cairn_session_free(cairn_session* session) { delete session; }

cairn_code cairn_session_take(cairn_session* session, const char* line, const char** answer) {
  return guarded([&] {
    cairn_session& of = given(session, "session");
    const std::string text(&given(line, "line"));
    if (text.find('\n') != std::string::npos)
      throw cairn::Error(cairn::ErrorCode::usage, "expected one line, without its end");
    if (of.failed) {
      throw cairn::Error(cairn::ErrorCode::usage,
                         "the session has failed before; begin another, with the same journal");
    }
    of.failed = true;  // until it has not
    of.answer = of.call([&] { return of.conversation->take(text).text; });
    of.failed = false;
    if (answer) *answer = of.answer.c_str();
  });
}

const char* cairn_session_answer(const cairn_session* session) {
  return session ? session->answer.c_str() : "";
}
