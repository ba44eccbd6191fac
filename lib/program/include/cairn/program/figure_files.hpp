// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/program/figures.hpp"
#include "cairn/program/results.hpp"
#include "cairn/program/session.hpp"

namespace cairn::app {

/// Where a command writes the figures of its result for spreadsheets and papers: a part of its
/// options.
struct FigureFiles {
  std::string csv, latex;  ///< "-" is standard output; empty: not wanted

  static OptionFields<FigureFiles> fields();
  /// Before the work: throws `Error` where one cannot be written.
  void check(Session& session) const;
  void write(const Figures& figures, Results& results) const;
};

}  // namespace cairn::app
