// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Memory of `GrowingArray`, on a 64-byte boundary. Throws std::bad_alloc.
CAIRN_API void* allocate_growing(std::size_t bytes);
/// `memory` of `bytes`, of which the first `used` are in use, as `more` bytes; null and 0 at first.
CAIRN_API void* grow_aligned(void* memory, std::size_t used, std::size_t bytes, std::size_t more);
/// `bytes` as they were asked for.
CAIRN_API void release_growing(void* memory, std::size_t bytes) noexcept;

/// A contiguous array of plain values, on a cache line, for what gets a few elements again and
/// again. Unlike with std::vector, no addition copies all that is there: a large array moves to a
/// larger place by its pages, and the room that is not used yet takes no memory. References and
/// iterators are valid until the next addition. For as many elements as there is memory for.
template <class T>
class GrowingArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  using value_type = T;
  using iterator = T*;
  using const_iterator = const T*;

  GrowingArray() = default;
  GrowingArray(const GrowingArray& other) : GrowingArray() { append(other); }
  GrowingArray(GrowingArray&& other) noexcept { swap(other); }
  GrowingArray& operator=(GrowingArray other) noexcept {
    swap(other);
    return *this;
  }
  ~GrowingArray() {
    if (data_) release_growing(data_, capacity_ * sizeof(T));
  }
  void swap(GrowingArray& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  std::size_t size() const { return size_; }
  std::size_t capacity() const { return capacity_; }
  bool empty() const { return size_ == 0; }
  T* data() { return data_; }
  const T* data() const { return data_; }
  T* begin() { return data_; }
  const T* begin() const { return data_; }
  T* end() { return data_ + size_; }
  const T* end() const { return data_ + size_; }
  T& operator[](std::size_t k) { return data_[k]; }
  const T& operator[](std::size_t k) const { return data_[k]; }
  T& front() { return data_[0]; }
  const T& front() const { return data_[0]; }
  T& back() { return data_[size_ - 1]; }
  const T& back() const { return data_[size_ - 1]; }

  /// Makes room for so many elements in all; where there is none, for twice as many as there was
  /// room for, at least.
  void reserve(std::size_t size) {
    if (size <= capacity_) return;
    const std::size_t more = std::max({size, 2 * capacity_, std::size_t{16}});
    data_ = static_cast<T*>(
        grow_aligned(data_, size_ * sizeof(T), capacity_ * sizeof(T), more * sizeof(T)));
    capacity_ = more;
  }
  void push_back(T value) {
    reserve(size_ + 1);
    ::new (static_cast<void*>(data_ + size_)) T(value);
    ++size_;
  }
  /// At the end; not values of this array itself.
  void append(std::span<const T> values) {
    if (values.empty()) return;
    if (data_) {
      reserve(size_ + values.size());
    } else {
      data_ = static_cast<T*>(allocate_growing(values.size_bytes()));
      capacity_ = values.size();
    }
    std::copy(values.begin(), values.end(), data_ + size_);
    size_ += values.size();
  }
  /// New elements are zero.
  void resize(std::size_t size) {
    reserve(size);
    if (size > size_) std::fill(data_ + size_, data_ + size, T{});
    size_ = size;
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace cairn
