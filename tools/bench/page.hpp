// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace cairn::performance {

/// A part of a page that is written by a program.
struct Section {
  std::string name;
  std::string markdown;
};

/// Puts the section between its markers, which stand on lines of their own and stay:
///
///     <!-- table:NAME -->
///     <!-- /table -->
///
/// Throws `std::runtime_error` if the page has no such place.
void put(const Section& section, std::string& page);

/// Whether the page has the section's markers.
bool has_place(const Section& section, const std::string& page);

}  // namespace cairn::performance
