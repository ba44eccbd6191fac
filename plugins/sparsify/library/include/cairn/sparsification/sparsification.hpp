// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/evaluation/graph_divergence.hpp"
#include "cairn/sparsification/blanket.hpp"
#include "cairn/sparsification/recovery.hpp"
#include "cairn/sparsification/redirection.hpp"
#include "cairn/sparsification/selection.hpp"
#include "cairn/sparsification/sparsifier.hpp"
#include "cairn/sparsification/topology.hpp"

// Sparsification: taking nodes out of a graph, and replacing the dense Gaussian that marginalising
// them leaves by a few factors, which can be relinearised. Chapter 4 of J. Vallvé, Information
// metrics for localization and mapping (thesis, UPC Barcelona 2018), whose equations and sections
// are cited as (T n). All matrices are column-major. This header has all of it.
