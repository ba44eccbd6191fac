// SPDX-License-Identifier: BSD-3-Clause
/// Everything that a program needs to build, read, optimise and follow graphs. Smaller headers are
/// in the folders beside this one; what is built on the core (policies, sparsification, evaluation)
/// has headers of its own.
#pragma once

#include "cairn/graph/graph.hpp"
#include "cairn/graph/information.hpp"
#include "cairn/graph/update.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/linear/graph_marginals.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/threads.hpp"
#include "cairn/runtime/version.hpp"
#include "cairn/solve/estimator.hpp"
#include "cairn/solve/initial_guess.hpp"
#include "cairn/solve/optimizer.hpp"
#include "cairn/typed/build.hpp"
#include "cairn/typed/covariance.hpp"
#include "cairn/typed/measurements.hpp"
#include "cairn/typed/point.hpp"
#include "cairn/typed/pose2.hpp"
#include "cairn/typed/pose3.hpp"
#include "cairn/typed/print.hpp"
#include "cairn/typed/rot2.hpp"
#include "cairn/typed/rot3.hpp"
#include "cairn/typed/run.hpp"
#include "cairn/typed/symbol.hpp"
#include "cairn/types/check_factor.hpp"
#include "cairn/types/define_factor.hpp"
#include "cairn/types/define_variable.hpp"
#include "cairn/types/loss.hpp"
