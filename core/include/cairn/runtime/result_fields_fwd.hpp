// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace cairn {

/// What reports say of a struct: see cairn/runtime/result_fields.hpp. A header that only declares
/// `fields()` of its structs needs no more than this.
template <class Struct>
class ResultFields;

}  // namespace cairn
