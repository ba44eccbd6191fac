// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

namespace cairn {

/// Owns a file descriptor, and closes it; a negative number is none.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  int number() const { return number_; }

 private:
  int number_;
};

}  // namespace cairn
