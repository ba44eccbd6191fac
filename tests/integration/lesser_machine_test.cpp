// SPDX-License-Identifier: BSD-3-Clause
// The same binary on machines with narrower vectors, played by QEMU.
#include <gtest/gtest.h>

#include <ostream>
#include <string>

#include "integration/process.hpp"

namespace cairn::test {
namespace {

struct Machine {
  const char* cpu;
  const char* kernels;  // the widest that it can run
};

void PrintTo(const Machine& machine, std::ostream* out) { *out << machine.cpu; }

class LesserMachine : public ::testing::TestWithParam<Machine> {
 protected:
  static boost::json::value optimized(const std::string& graph, const Arguments& emulator) {
    Arguments command = emulator;
    const Arguments rest{program(), "optimize", graph, "--threads", "1", "--quiet", "--json", "-"};
    command.insert(command.end(), rest.begin(), rest.end());
    const Outcome outcome = run_program(command);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return parse_json(outcome.out);
  }
};

TEST_P(LesserMachine, ReachesTheSameChi2WithTheSameBinary) {
  const Arguments emulator{"qemu-x86_64", "-cpu", GetParam().cpu};
#if defined(CAIRN_SANITIZED)
  GTEST_SKIP() << "an emulated processor has no room for the sanitizer's shadow memory";
#endif
  if (run_program({"qemu-x86_64", "--version"}).exit_code != 0)
    GTEST_SKIP() << "no qemu-x86_64 here: install the package qemu-user";
  for (const char* graph : {"@manhattan:poses=500", "@sphere:turns=8,poses_per_turn=12"}) {
    const auto here = optimized(graph, {}), there = optimized(graph, emulator);
    const double chi2 = here.at("chi2").at("final").as_double();
    EXPECT_NEAR(there.at("chi2").at("final").as_double(), chi2, 1e-9 * chi2) << graph;
    const std::string note(there.at("solver").at("note").as_string());
    EXPECT_NE(note.find(std::string(GetParam().kernels) + " kernels"), std::string::npos) << note;
  }
}

// QEMU 7.2 knows AVX2 and no AVX-512; a Nehalem has neither.
INSTANTIATE_TEST_SUITE_P(Machines, LesserMachine,
                         ::testing::Values(Machine{"max", "avx2"}, Machine{"Nehalem", "portable"}),
                         [](const auto& machine) { return std::string(machine.param.cpu); });

}  // namespace
}  // namespace cairn::test
