// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <gtest/gtest.h>
#include <boost/json/value.hpp>

#include "cairn/plugin/registry.hpp"
#include "integration/process.hpp"

namespace cairn::test {

/// Runs `cairn sparsify` and `cairn study`.
class Sparsify : public testing::Test {
 protected:
  void SetUp() override {
    if (!Registry().has("sparsifier", "sparsify")) GTEST_SKIP() << "no sparsifier sparsify";
  }
  boost::json::value report(Arguments arguments) {
    arguments.insert(arguments.begin(), "sparsify");
    arguments.emplace_back("--quiet");
    return report_of(arguments);
  }
  boost::json::value study(Arguments arguments, const std::string& name = "sparsify") {
    arguments.insert(arguments.begin(), {"study", name});
    arguments.emplace_back("--quiet");
    return report_of(arguments);
  }
  TemporaryFolder folder_;
};

inline double number(const boost::json::value& value) { return value.to_number<double>(); }

}  // namespace cairn::test
