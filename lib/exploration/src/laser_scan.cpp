// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/exploration/laser_scan.hpp"

namespace cairn {

ScanRegistration::~ScanRegistration() = default;

}  // namespace cairn
