// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/program/session.hpp"
#include "sparsify.hpp"

namespace cairn::app {

/// `cairn sparsify --edges`: loop closures leave and all poses stay. Returns the exit code.
int run_sparsify_edges(const SparsifyCommandOptions& options, Session& session);

}  // namespace cairn::app
