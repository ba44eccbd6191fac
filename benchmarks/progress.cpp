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

void for_each_set(const std::string& study, const std::vector<DataSet>& sets,
                  const std::function<void(const DataSet&)>& work) {
  for (const DataSet& set : sets) {
    try {
      tell(fmt::format("{}: {}", study, set.name));
      work(set);
    } catch (const std::exception& error) {
      tell(fmt::format("{}: {} left out: {}", study, set.name, error.what()));
    }
  }
}

}  // namespace cairn::performance
