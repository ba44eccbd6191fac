// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "experiment.hpp"

namespace cairn::faults {

/// How a run with a fault ended.
struct Verdict {
  enum class End { completed, error, killed, violation };
  End end = End::completed;
  std::string why;  ///< of a violation
};

/// What runs are compared with.
struct Reference {
  RunResult good;  ///< without a fault
  /// Of a trial with a journal: the maps that it may leave when it ends early, in the order of the
  /// lines taken.
  std::vector<std::string> maps;
};

/// Compares a run with that without a fault. Completed means exit code 0 and the same
/// files and standard output, byte by byte. An error means the right exit code (4 and "out of
/// memory" where memory or threads were refused, 3 where an output was), a message on standard
/// error, in every file the old content or the new one, no other file; where one call on an output
/// failed once, all other outputs written; and all that standard output acknowledged in the
/// journal. A session that memory ends in the midst of a line may leave a map in which a part of
/// that line is. Everything else is a violation: a crash, a process that does not end, half a file.
///
/// A process that is killed may leave what it was writing: a file `NAME.PID-N.part` beside an
/// output, and half a record at the end of the journal. An output is the old one or the new one,
/// and the new one where standard output says that it was saved.
Verdict judge(const Trial& trial, const Fault& fault, const Reference& reference,
              const RunResult& result);

/// Whether a process that was killed has left this file beside one of its outputs.
bool is_part(const Trial& trial, const std::string& name);

/// The last line of the answers that gives chi2; empty if there is none.
std::string last_chi2(const std::string& out);

/// The number of the last line that a journal has; 0 if there is none.
long last_record(const std::string& journal);

}  // namespace cairn::faults
