// SPDX-License-Identifier: BSD-3-Clause
// cairn study NAME: what the tables of the papers need and a robot does not. Each belongs to its
// subject.
#include "cairn/program/command.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn::app {
namespace {

struct StudyOptions {
  static auto fields() { return OptionFields<StudyOptions>(); }
};

int run(const StudyOptions&, Session&) {
  throw Error(ErrorCode::usage, "cairn study: which one? see cairn study --help");
}

}  // namespace

void add_study(Registrar& registrar) {
  add_command<StudyOptions>(
      registrar, "study",
      "Example:\n"
      "  cairn study sparsify @manhattan --keep-every 5 --record problems.json\n"
      "  cairn study problems problems.json --recovery ncfd --recovery ip",
      run);
}

}  // namespace cairn::app
