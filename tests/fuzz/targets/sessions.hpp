// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/online/online_session.hpp"
#include "cairn/sparsification/map_sparsifier.hpp"

namespace cairn::fuzz {

/// How a session of `cairn online` is set up.
struct SessionSettings {
  std::string estimator = "incremental_cholesky";
  OnlineSettings online;
};

/// Any of the settings, by the bits of a byte.
SessionSettings session_settings(std::uint8_t choice);

/// A session with all that it refers to.
class OwnedSession {
 public:
  explicit OwnedSession(const SessionSettings& settings);

  OnlineSession& lines() { return *lines_; }
  Estimator& estimator() { return *estimator_; }

 private:
  MapSparsifier remover_;
  std::unique_ptr<StreamFormat> format_;
  std::unique_ptr<Estimator> estimator_;
  std::unique_ptr<OnlineSession> lines_;
};

/// Where two estimators differ: variables, factors, or a bit of an estimate. Empty if nowhere.
std::string difference(Estimator& a, Estimator& b);

/// Whether a line is a SAVE: the one command that touches files, which no target may.
bool writes_a_file(std::string_view line);

/// Conversations of `cairn online`, without the settings.
std::vector<std::string> conversations();
/// Commands and tags of such lines.
std::vector<std::string> protocol_words();

}  // namespace cairn::fuzz
