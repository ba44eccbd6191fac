// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <exception>

#include <fmt/format.h>

#include "studies.hpp"

namespace cairn::performance {

void tell(const std::string& sentence) {
  fmt::print(stderr, "{}\n", sentence);
  std::fflush(stderr);
}

void attempt(const std::string& what, const std::function<void()>& work) {
  try {
    tell(what);
    work();
  } catch (const std::exception& error) {
    tell(fmt::format("{} left out: {}", what, error.what()));
  }
}

void for_each_set(const std::string& study, const std::vector<DataSet>& sets,
                  const std::function<void(const DataSet&)>& work) {
  for (const DataSet& set : sets) {
    attempt(fmt::format("{}: {}", study, set.name), [&] { work(set); });
  }
}

}  // namespace cairn::performance
