// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace cairn::formats {

/// How sure each format is of a text, 0 to 100, by its first lines that hold anything.
struct Likelihood {
  int g2o = 0, toro = 0, isam = 0, bal = 0, tum = 0, kitti = 0, table = 0;
};

/// Looks at tags and numbers, never at names of files. Lines vote, so that one bad line does not
/// send the file to the wrong reader. What is hard to tell:
///  - EDGE2 (and ODOMETRY) is TORO's or iSAM's. iSAM text has no vertices; without any, the six
///  numbers at
///    the end of each edge decide, since what is an information matrix in TORO's order has a zero
///    on the diagonal when it is taken for iSAM's square root, or the other way round;
///  - a BAL file begins with three counts, and then has lines of four numbers (as many tables do)
///    and of one; the counts say how many of which.
///  - LANDMARK has 7 numbers in iSAM, 11 in SLAM++'s flavour of TORO.
Likelihood look_at(std::string_view text);

}  // namespace cairn::formats
