// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace cairn::python {

/// Whether C++ works on something without the interpreter's lock. Every other use of it is refused
/// meanwhile, since another thread of Python could change it.
class Exclusive {
 public:
  /// What the refusal says.
  explicit Exclusive(const char* message) : message_(message) {}

  /// Throws `Error` (usage) while it is in use.
  void refuse_if_used() const;

 private:
  friend class Use;
  const char* message_;
  std::atomic<bool> used_ = false;
};

/// Marks something as in use. Throws `Error` (usage) if it is in use already.
class Use {
 public:
  explicit Use(Exclusive& exclusive) : exclusive_(&exclusive) {
    exclusive.refuse_if_used();
    exclusive.used_ = true;
  }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;
  ~Use() { exclusive_->used_ = false; }

 private:
  Exclusive* exclusive_;
};

}  // namespace cairn::python
