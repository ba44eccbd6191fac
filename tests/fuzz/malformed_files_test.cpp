// SPDX-License-Identifier: BSD-3-Clause
// Malformed variants of good files: each must end in an error that names the line, never in a
// crash, a hang or a graph.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ostream>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/mutations.hpp"

namespace cairn::test {

void PrintTo(const Seed& seed, std::ostream* out) { *out << seed.name; }

namespace {

Registry& registry() {
  static Registry instance;
  return instance;
}

Graph read(const std::string& format, const std::string& text, const ReadOptions& options = {}) {
  ReadReport report;
  return registry().make<Format>(format)->read(text, "file", registry(), options, report);
}

/// As `read_graph` chooses, without a file.
std::string detected(const std::string& text) {
  int best = 0;
  std::string surest;
  for (const std::string& name : registry().names(Format::kKind)) {
    const int score = registry().make<Format>(name)->detect(text);
    if (score > best) {
      best = score;
      surest = name;
    }
  }
  return surest;
}

/// The line that a message names, 0 if none: "file:LINE: …".
int line_of(const std::string& message) {
  return message.starts_with("file:") ? std::atoi(message.c_str() + 5) : 0;
}

std::string read_and_catch(const std::string& format, const std::string& text) {
  try {
    read(format, text);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::input) << error.what();
    return error.what();
  }
  return "";
}

/// What must hold of any graph that a reader hands out.
void expect_sound(const Graph& graph) {
  EXPECT_GT(graph.variable_count() + graph.factor_count(), 0);
  const auto finite = [](std::span<const double> numbers) {
    return std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); });
  };
  for (int v = 0; v < graph.variable_count(); ++v) {
    EXPECT_GE(graph.id(v), 0);
    EXPECT_TRUE(finite(graph.state(v)));
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    EXPECT_TRUE(finite(graph.measurement(f)));
    EXPECT_TRUE(finite(graph.information(f)));
  }
}

class MalformedFiles : public testing::TestWithParam<Seed> {};

TEST_P(MalformedFiles, ComeFromAGoodFile) {
  const Seed& seed = GetParam();
  EXPECT_EQ(read_and_catch(seed.format, seed.text), "");
  EXPECT_EQ(detected(seed.text), seed.format);
  expect_sound(read(seed.format, seed.text));
}

TEST_P(MalformedFiles, AreAllRefusedByLine) {
  const Seed& seed = GetParam();
  for (const Mutant& mutant : mutants(seed)) {
    const std::string message = read_and_catch(seed.format, mutant.text);
    EXPECT_NE(message, "") << mutant.what << "\n" << mutant.text;
    EXPECT_EQ(line_of(message), mutant.line) << mutant.what << "\n" << mutant.text << message;
  }
}

TEST_P(MalformedFiles, AreRefusedByLineWhateverFormatTheirContentSuggests) {
  const Seed& seed = GetParam();
  for (const Mutant& mutant : mutants(seed)) {
    const std::string format = detected(mutant.text);
    if (format.empty()) continue;  // refused as a whole, by read_graph
    const std::string message = read_and_catch(format, mutant.text);
    EXPECT_NE(line_of(message), 0) << mutant.what << " read as " << format << "\n"
                                   << mutant.text << message;
  }
}

TEST_P(MalformedFiles, WithOptionsOnAreRefusedOrSound) {
  const Seed& seed = GetParam();
  for (const Mutant& mutant : mutants(seed)) {
    try {
      expect_sound(read(seed.format, mutant.text,
                        {.skip_unknown = true,
                         .repair_information = true,
                         .unit_information = true,
                         .skip_dangling = true}));
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), ::testing::StartsWith("file:"));
    }
  }
}

TEST_P(MalformedFiles, ThatAreScrambledAreRefusedOrSound) {
  const Seed& seed = GetParam();
  for (const std::string& text : scrambled(seed, 300)) {
    for (const char* format :
         {"g2o", "toro", "isam", "bal", "pyfg", "tum", "euroc", "kitti", "table"}) {
      try {
        expect_sound(read(format, text));
      } catch (const Error& error) {
        EXPECT_THAT(error.what(), ::testing::StartsWith("file:"));
      }
    }
    detected(text);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, MalformedFiles, testing::ValuesIn(seeds()), [](const auto& test) {
  std::string name = test.param.name;
  std::ranges::replace_if(
      name, [](char c) { return c == ' ' || c == '+'; }, '_');
  return name;
});

TEST(MalformedFileCount, IsFarAboveTwoHundred) {
  std::size_t all = 0;
  for (const Seed& seed : seeds()) {
    const std::size_t count = mutants(seed).size();
    EXPECT_GT(count, 50u) << seed.name;
    all += count;
  }
  EXPECT_GT(all, 2000u);
}

}  // namespace
}  // namespace cairn::test
