// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/stream_format.hpp"

namespace cairn {

StreamFormat::~StreamFormat() = default;

}  // namespace cairn
