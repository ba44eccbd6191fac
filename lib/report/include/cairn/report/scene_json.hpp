// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/report/scene.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

/// Members "dimension", "origin", "variables" and "edges" of a GRAPH in docs/report.md, without
/// braces round them; recordings hold the same.
CAIRN_API std::string structure_json(const Scene& scene);

/// A RUN in docs/report.md: what `cairn optimize --json` says of it, and its name.
CAIRN_API std::string run_json(const SceneRun& run);

/// A run out of the report of `cairn optimize --json`, or out of `run_json`. What is not there is
/// left at its default. Throws `Error` (input), naming `where`, for text that is no such report.
CAIRN_API SceneRun read_run(std::string_view json, std::string_view where);

/// The inverse of `structure_json`: `json` is an object that has these members. Throws `Error`
/// (input), naming `where`, for what is missing or does not fit together.
CAIRN_API Scene read_structure(std::string_view json, std::string_view where);

}  // namespace cairn
