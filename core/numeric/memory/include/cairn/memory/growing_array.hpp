// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace cairn {
namespace memory {

/// Memory of an array that grows, on a 64-byte boundary.
struct Room {
  void* begin = nullptr;
  std::size_t bytes = 0;
};
// libcairn has these, for all in a process.
#define CAIRN_MEMORY_API __attribute__((visibility("default")))
/// Room for so many bytes, neither more nor less. Throws std::bad_alloc.
CAIRN_MEMORY_API Room make_room(std::size_t bytes);
/// Room for at least `needed` bytes instead of `old`, of which the first `used` are kept: twice the
/// room of before or what is needed, whichever is more, and less where so much is refused. Throws
/// std::bad_alloc, and leaves everything as it was.
CAIRN_MEMORY_API Room enlarge(const Room& old, std::size_t used, std::size_t needed);
CAIRN_MEMORY_API void release(const Room& room) noexcept;
#undef CAIRN_MEMORY_API

}  // namespace memory

/// A contiguous array of plain values, on a cache line, for what gets a few elements again and
/// again. Unlike a std::vector, a large one (half a megabyte) is not copied when it grows: it moves
/// to a larger place by its pages, and room that is not used yet takes no memory. References and
/// iterators are valid until the next addition. What adds throws std::bad_alloc where there is no
/// memory, and leaves the array as it was.
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
  ~GrowingArray() { memory::release(room_); }
  void swap(GrowingArray& other) noexcept {
    std::swap(room_, other.room_);
    std::swap(size_, other.size_);
  }

  std::size_t size() const { return size_; }
  std::size_t capacity() const { return room_.bytes / sizeof(T); }
  bool empty() const { return size_ == 0; }
  T* data() { return static_cast<T*>(room_.begin); }
  const T* data() const { return static_cast<const T*>(room_.begin); }
  T* begin() { return data(); }
  const T* begin() const { return data(); }
  T* end() { return data() + size_; }
  const T* end() const { return data() + size_; }
  T& operator[](std::size_t k) { return data()[k]; }
  const T& operator[](std::size_t k) const { return data()[k]; }
  T& front() { return data()[0]; }
  const T& front() const { return data()[0]; }
  T& back() { return data()[size_ - 1]; }
  const T& back() const { return data()[size_ - 1]; }

  /// Makes room for so many elements in all; where there is none, for twice as many as before if
  /// there is memory for them.
  void reserve(std::size_t size) {
    if (size > capacity()) room_ = memory::enlarge(room_, bytes_of(size_), bytes_of(size));
  }
  void push_back(T value) {
    reserve(size_ + 1);
    ::new (static_cast<void*>(end())) T(value);
    ++size_;
  }
  /// At the end; also values of this array itself. The first values of an array get just the room
  /// that they need.
  void append(std::span<const T> values) {
    if (values.empty()) return;
    const T* from = values.data();
    const bool own = std::less_equal<>{}(data(), from) && std::less<>{}(from, data() + size_);
    const std::ptrdiff_t offset = own ? from - data() : 0;
    if (room_.begin) {
      if (values.size() > most() - size_) throw std::bad_alloc();
      reserve(size_ + values.size());
    } else {
      room_ = memory::make_room(values.size_bytes());
    }
    std::copy_n(own ? data() + offset : from, values.size(), end());
    size_ += values.size();
  }
  /// New elements are zero.
  void resize(std::size_t size) {
    reserve(size);
    if (size > size_) std::fill(data() + size_, data() + size, T{});
    size_ = size;
  }

 private:
  static constexpr std::size_t most() {
    return std::numeric_limits<std::size_t>::max() / sizeof(T);
  }
  static std::size_t bytes_of(std::size_t size) {
    if (size > most()) throw std::bad_alloc();
    return size * sizeof(T);
  }

  memory::Room room_;
  std::size_t size_ = 0;
};

}  // namespace cairn
