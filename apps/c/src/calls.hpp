// SPDX-License-Identifier: BSD-3-Clause
// What every function of cairn.h begins with: no exception leaves it, and its arguments are
// checked.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn.h"

namespace cairn::c {

/// The code of the exception that is being handled; its message is that of `cairn_error` from now
/// on. To be called in a handler.
cairn_code code_of_exception() noexcept;

/// `work()`, whose exceptions become codes.
template <class Work>
cairn_code guarded(const Work& work) noexcept {
  try {
    work();
    return CAIRN_OK;
  } catch (...) {
    return code_of_exception();
  }
}

[[noreturn]] void refuse_null(const char* what);

/// What a pointer leads to; throws `Error` (usage) for NULL.
template <class T>
T& given(T* pointer, const char* what) {
  if (!pointer) refuse_null(what);
  return *pointer;
}

[[noreturn]] void refuse_size(std::size_t size, const char* what);

/// An array; NULL is one without elements, and refused with any.
template <class T>
std::span<T> array(T* first, std::size_t size, const char* what) {
  if (size > PTRDIFF_MAX / sizeof(T)) refuse_size(size, what);  // such as -1
  if (!first && size > 0) refuse_null(what);
  return {first, size};
}

/// A name with options, or the one that NULL stands for.
inline std::string_view name_or(const char* name, const char* otherwise) {
  return name ? name : otherwise;
}

/// Throws `Error` (usage) where an array has another number of elements than it must.
void expect_size(std::size_t size, std::size_t expected, std::string_view what);

/// A matrix that lies column by column, of as many `rows`, row by row.
void copy_by_rows(std::span<const double> columns, std::size_t rows, std::span<double> out);

/// One sentence per line.
std::string joined(const std::vector<std::string>& notes);

/// Hands an object over to the caller.
template <class T>
void hand_out(T** out, std::unique_ptr<T> object) {
  *out = object.release();
}

}  // namespace cairn::c
