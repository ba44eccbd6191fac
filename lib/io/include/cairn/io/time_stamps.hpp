// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// What the time stamps of a file count.
struct StampUnit {
  std::string_view name = "seconds";
  int exponent = 0;  ///< 10^exponent s: -9 for nanoseconds
};

/// The unit of stamps that are times since 1970, as clocks of sensors write them: what would be
/// years from 2001 to 2041 as milliseconds, microseconds or nanoseconds is that; all else, and what
/// does not agree on one of them, is seconds. Ids that `symbol` made lie above.
CAIRN_API StampUnit stamp_unit(std::span<const double> stamps);

/// The time [s] that `text` gives, a decimal number in `unit`, possibly with an exponent: rounded
/// once, so that 1403715524907143168 ns is the same double as 1403715524.907143168 s. The text must
/// be a finite number.
CAIRN_API double seconds_of(std::string_view text, const StampUnit& unit);

}  // namespace cairn
