// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <limits>
#include <string_view>

namespace cairn::performance {

/// What was not measured.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// A row of the paper's Table 4: [m] and degrees, of ATE, RPE and RPE all to all.
using PublishedErrors = std::array<double, 6>;
inline constexpr PublishedErrors kNoErrors{kNone, kNone, kNone, kNone, kNone, kNone};

/// Tables 2, 3 and 4 of Ila, Polok, Solony and Svoboda, IJRR 2017.
struct Published {
  std::string_view name;
  double range, angle, probability;  // [m, rad]; the text's "0.36°" is 0.36 rad
  double pose_gain, loop_gain;
  double apal_seconds, fpfl_seconds;
  double loops, poses;  // kept, of all
  PublishedErrors apal, fpfl, random = kNoErrors;
};

inline constexpr std::array kPublished{Published{"ellipse3d",
                                                 2.5,
                                                 0.4,
                                                 0.125,
                                                 5.74,
                                                 5.50,
                                                 0.502,
                                                 0.066,
                                                 0.0291,
                                                 0.2352,
                                                 {0.173, 3.666, 0.061, 1.643, 0.521, 3.121},
                                                 {0.338, 5.815, 0.100, 3.156, 0.839, 5.778}},
                                       Published{"ellipse_n",
                                                 1.1,
                                                 0.3,
                                                 0.1,
                                                 5.70,
                                                 5.11,
                                                 146.954,
                                                 5.387,
                                                 0.0320,
                                                 0.3100,
                                                 {0.138, 1.599, 0.039, 1.102, 0.338, 1.535},
                                                 {0.235, 4.820, 0.095, 2.737, 0.841, 4.033}},
                                       Published{"kitti_00",
                                                 25.5,
                                                 1.1,
                                                 0.1,
                                                 8.51,
                                                 5.13,
                                                 203.045,
                                                 6.163,
                                                 0.0163,
                                                 0.0781,
                                                 {3.046, 2.251, 0.037, 0.143, 7.007, 2.188},
                                                 {3.093, 2.250, 0.029, 0.119, 7.297, 2.223},
                                                 {12.017, 3.702, 0.028, 0.118, 17.448, 3.623}},
                                       Published{"sphere2500",
                                                 2.9,
                                                 0.1,
                                                 0.1,
                                                 4.33,
                                                 9.14,
                                                 655.016,
                                                 19.558,
                                                 0.1632,
                                                 0.3836,
                                                 {0.203, 1.397, 0.166, 1.582, 0.905, 1.391},
                                                 {0.457, 2.440, 0.244, 2.179, 1.580, 2.397}},
                                       Published{"parking-garage",
                                                 95.0,
                                                 1.1,
                                                 0.1,
                                                 5.77,
                                                 2.45,
                                                 102.989,
                                                 30.602,
                                                 0.2086,
                                                 0.6429,
                                                 {0.193, 0.787, 0.016, 0.270, 2.563, 0.777},
                                                 {0.661, 0.757, 0.012, 0.109, 1.167, 0.647},
                                                 {6.197, 9.761, 0.247, 1.688, 9.910, 7.264}},
                                       Published{"10kHog-man",
                                                 8.9,
                                                 6.3,
                                                 0.1,
                                                 2.36,
                                                 1.94,
                                                 3102.154,
                                                 401.587,
                                                 0.0711,
                                                 0.4676,
                                                 {0.917, 3.325, 0.081, 1.612, 3.707, 3.318},
                                                 {1.479, 4.902, 0.139, 2.583, 5.754, 4.896}}};

}  // namespace cairn::performance
