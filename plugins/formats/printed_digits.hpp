// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>

namespace cairn::formats {

// Matrices of rank less than full that were printed with a few digits are indefinite by these
// digits: a scan matcher's information along a corridor, 3 × 3 of rank two, has a smallest
// eigenvalue of about minus the last digit of the largest entry.

/// What printing may have changed of each number: half a unit of its last digit.
///
/// Numbers that all have the same count of decimals and no exponent were printed with these
/// decimals (%f), whole numbers if one has more than four digits. Others have significant digits
/// (%g, %e, the shortest text of a double), as many as the longest of them shows, since trailing
/// zeros are left out, and 4 at least: what has less was written by hand, and means what it says. A
/// zero is then exact.
void printed_rounding(std::span<const std::string_view> fields, std::span<double> rounding);

/// Whether each number may be the text of a float, whatever digits it has: the float nearest to it
/// is within half a unit of its own last digit.
bool are_texts_of_floats(std::span<const std::string_view> fields);

}  // namespace cairn::formats
