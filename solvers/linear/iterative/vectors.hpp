// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>

namespace cairn::iterative {

/// Sum over [0, size) of body(begin, end), which is called for ranges of a fixed length, in
/// parallel; the partial sums are added in order. So the result does not depend on the number of
/// threads.
double sum_over_ranges(std::size_t size,
                       const std::function<double(std::size_t, std::size_t)>& body);

/// aᵀ b.
double dot(std::span<const double> a, std::span<const double> b);

}  // namespace cairn::iterative
