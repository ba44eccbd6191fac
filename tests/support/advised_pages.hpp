// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <ios>
#include <optional>
#include <sstream>
#include <string>

namespace cairn::test {

/// Reads what the system says of the memory of this process: calls take(begin, end, huge) for each
/// stretch of it. False if it does not say whether pages are to be huge.
template <class Take>
bool read_advice_on_pages(Take take) {
  std::ifstream in("/proc/self/smaps");
  std::uintptr_t begin = 0, end = 0;
  bool any = false;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    char dash = 0;
    if (std::uintptr_t b = 0, e = 0; words >> std::hex >> b >> dash >> e && dash == '-') {
      begin = b;
      end = e;
    } else if (line.starts_with("VmFlags:")) {
      any = true;
      take(begin, end, (line + ' ').find(" hg ") != std::string::npos);
    }
  }
  return any;
}

/// Whether the page of an address is to be huge, if the system says so.
inline std::optional<bool> advised_to_be_huge(const void* address) {
  const auto place = reinterpret_cast<std::uintptr_t>(address);
  std::optional<bool> result;
  read_advice_on_pages([&](std::uintptr_t begin, std::uintptr_t end, bool huge) {
    if (begin <= place && place < end) result = huge;
  });
  return result;
}

/// Bytes of this process that are to be in huge pages.
inline std::size_t bytes_advised_to_be_huge() {
  std::size_t bytes = 0;
  read_advice_on_pages([&](std::uintptr_t begin, std::uintptr_t end, bool huge) {
    if (huge) bytes += end - begin;
  });
  return bytes;
}

}  // namespace cairn::test
