// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace cairn::formats {

/// The confidence of each format in a text, 0 to 100, by its first lines that are not empty.
struct Likelihood {
  int g2o = 0, toro = 0, isam = 0, bal = 0, pyfg = 0, tum = 0, euroc = 0, kitti = 0, table = 0;
};

/// Considers tags and numbers, never names of files. Lines vote, so that one bad line does not
/// select the wrong reader. Formats that are hard to distinguish:
///  - EDGE2 and EDGE3 (and ODOMETRY) are TORO's or iSAM's. iSAM text has no vertices; without any,
///  the six numbers at
///    the end of each edge decide, since what is an information matrix in TORO's order has a zero
///    on the diagonal when it is taken for iSAM's square root, or vice versa;
///  - a BAL file begins with three counts, and then has lines of four numbers (as many tables do)
///    and of one; the counts say how many of which.
///  - eight numbers are TUM's or EuRoC's, which has w of the quaternion first: the names of the
///    columns decide, else commas with nanoseconds are EuRoC's.
///  - PyFactorGraph has g2o's tags, and names (A0) where g2o has ids;
///  - LANDMARK has 7 numbers in iSAM, 11 in SLAM++'s flavour of TORO.
Likelihood look_at(std::string_view text);

}  // namespace cairn::formats
