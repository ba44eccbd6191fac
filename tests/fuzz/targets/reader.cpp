// SPDX-License-Identifier: BSD-3-Clause
// Graph and trajectory files: the first byte chooses the format (or that it is detected) and the
// options, the rest is the text. What is read is sound, and is the same after it was written.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/mutations.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr std::array<std::string_view, 9> kFormats = {"g2o",   "toro",  "isam",  "bal", "tum",
                                                      "kitti", "table", "euroc", "pyfg"};
constexpr int kPyfg = 8;
// Of the first byte: the format, or that it is detected, and the options.
constexpr int kDetected = 15, kSkipUnknown = 16, kRepair = 32, kUnit = 64, kDangling = 128;
constexpr const char* kName = "input";

/// Each format, made once: none has a state of its own.
Format& format(std::size_t index) {
  static const auto all = [] {
    std::array<std::unique_ptr<Format>, kFormats.size()> made;
    for (std::size_t k = 0; k < made.size(); ++k) made[k] = registry().make<Format>(kFormats[k]);
    return made;
  }();
  return *all[index];
}

/// The format that is surest of the text, as `read_graph` chooses.
std::optional<std::size_t> detected(std::string_view text) {
  std::optional<std::size_t> surest;
  int best = 0;
  for (std::size_t k = 0; k < kFormats.size(); ++k) {
    const int score = format(k).detect(text);
    expect(score >= 0 && score <= 100,
           [&] { return fmt::format("format {} is sure by {} of 100", kFormats[k], score); });
    if (score > best) {
      best = score;
      surest = k;
    }
  }
  return surest;
}

/// What is refused is refused with its name, as bad input.
std::optional<Graph> read(std::size_t index, std::string_view text, const ReadOptions& options,
                          std::string* why = nullptr) {
  try {
    ReadReport report;
    return format(index).read(text, kName, registry(), options, report);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input && std::string_view(error.what()).starts_with("input:"),
           [&] { return fmt::format("format {} refused by: {}", kFormats[index], error.what()); });
    if (why) *why = error.what();
    return std::nullopt;
  }
}

/// None where the format cannot express the graph.
std::optional<std::string> write(std::size_t index, const Graph& graph) {
  if (!format(index).can_write()) return std::nullopt;
  try {
    return format(index).write(graph);
  } catch (const Error& error) {
    expect(error.code() == ErrorCode::input,
           [&] { return fmt::format("format {} failed by: {}", kFormats[index], error.what()); });
    return std::nullopt;
  }
}

bool finite(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double v) { return std::isfinite(v); });
}

void expect_sound(const Graph& graph) {
  expect(graph.variable_count() + graph.factor_count() > 0, [] { return "an empty graph"; });
  for (int v = 0; v < graph.variable_count(); ++v) {
    expect(graph.id(v) >= 0 && finite(graph.state(v)),
           [&] { return "not sound: " + graph.describe_variable(v); });
  }
  for (int f = 0; f < graph.factor_count(); ++f) {
    expect(finite(graph.measurement(f)) && finite(graph.information(f)),
           [&] { return "not sound: " + graph.describe_factor(f); });
  }
}

/// What is written is read again, and written as the same text where the format keeps every bit
/// (KITTI's matrices, BAL's rotation vectors and TORO's angles are rounded).
void expect_round_trip(std::size_t index, const Graph& graph) {
  const std::optional<std::string> text = write(index, graph);
  if (!text) return;
  std::string why;
  const std::optional<Graph> back = read(index, *text, {}, &why);
  expect(back.has_value(), [&] {
    return fmt::format("format {} does not read what it wrote: {}\n{}", kFormats[index], why,
                       *text);
  });
  expect(back->variable_count() <= graph.variable_count() &&
             back->factor_count() <= graph.factor_count(),
         [&] { return fmt::format("format {} reads more than it wrote", kFormats[index]); });
  const bool has_angles = kFormats[index] == "toro" && text->find("VERTEX3") != text->npos;
  if (kFormats[index] == "kitti" || kFormats[index] == "bal" || has_angles) return;
  const std::optional<std::string> again = write(index, *back);
  expect(again == text, [&] {
    return fmt::format("format {} wrote\n{}and, having read that,\n{}", kFormats[index], *text,
                       again.value_or("nothing"));
  });
}

void run(Bytes bytes) {
  Source source(bytes);
  const int choice = source.byte();
  const std::string_view text = text_of(source.rest());
  std::optional<std::size_t> index = choice % (kDetected + 1);
  if (*index >= kFormats.size()) index = detected(text);
  if (!index) return;
  const std::optional<Graph> graph = read(*index, text,
                                          {.skip_unknown = (choice & kSkipUnknown) != 0,
                                           .repair_information = (choice & kRepair) != 0,
                                           .unit_information = (choice & kUnit) != 0,
                                           .skip_dangling = (choice & kDangling) != 0});
  if (!graph) return;
  expect_sound(*graph);
  expect_round_trip(0, *graph);  // g2o expresses all that is read
  if (*index != 0) expect_round_trip(*index, *graph);
}

struct Dialect {
  int choice;
  std::string_view text;
};
constexpr Dialect kDialects[] = {
    {1,
     "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nVERTEX2 2 1 0.1 0\nEDGE2 0 1 1 0 0 9 0 9 9 0 0\n"
     "EDGE2 0 2 1 0 0 9 0 9 9 0 0\nEQUIV 1 2\nBR 0 7 0.5 2 0.1 0.5\n"},
    {1 | kUnit | kDangling,
     "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 1 0 0 0.1 0.2 0.3\n"
     "EDGE3 0 1 1 0 0 0.1 0.2 0.3\nEDGE3 1 9 1 0 0 0.1 0.2 0.3\n"},
    {kUnit | kDangling | kSkipUnknown,
     "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_ODD 5 1\nEDGE_SE2_XY 0 5 1 1 1 0 1\n"
     "EDGE_SE2 0 1 1 0 0\nEDGE_SE2 0 7 1 0 0 0 0 0 0 0 0\n"},
    {0,
     "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 307121 -243387 -342143 192879 "
     "271141 1.6817e+07\n"},
    {kPyfg,
     "VERTEX_SE2 0.5 A0 5 5 0\nVERTEX_SE2 1.5 A1 6 5 0\nVERTEX_XY L0 7 6\n"
     "EDGE_SE2 0.5 A0 A1 1 0 0.5 0.25 0 0 0.5 0 0.01\nEDGE_SE2_XY 0 A0 L0 2 1 0.25 0 0.25\n"
     "VERTEX_SE2:PRIOR 0 A0 4 5 0 0.25 0 0 0.25 0 1\n"},
    {kPyfg | kSkipUnknown,
     "VERTEX_SE3:QUAT 0 A0 0 0 0 0 0 0 1\nVERTEX_XYZ L0 1 2 3\nEDGE_RANGE 0 A0 L0 3 0.1\n"
     "EDGE_SE3_XYZ 0 A0 L0 1 2 3 0.5 0 0 0.5 0 0.5\n"},
};

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  for (const test::Seed& seed : test::seeds()) {
    const auto index = std::ranges::find(kFormats, seed.format) - kFormats.begin();
    for (const auto choice : {index, std::ptrdiff_t{kDetected}, index | kSkipUnknown | kRepair})
      all.push_back(static_cast<char>(choice) + seed.text);
  }
  for (const char* rows :
       {"#timestamp [ns], p_x, p_y, p_z, q_w, q_x, q_y, "
        "q_z\n5000000,1,2,3,1,0,0,0\n6000000,1,2,3,0,1,"
        "0,0\n",
        "1403715524907143168,1,2,3,1,0,0,0,9,9\n1403715524907143168,1,2,3,1,0,0,0,9,9\n",
        "timestamp,tx,ty,tz,qx,qy,qz,qw\n1.4e9,1,2,3,0,0,0,1\n1400000000.5,1,2,3,0,0,0,1\n"}) {
    for (const char* chosen : {"euroc", "tum"}) {
      const auto index = std::ranges::find(kFormats, chosen) - kFormats.begin();
      for (const auto choice : {index, std::ptrdiff_t{kDetected}})
        all.push_back(static_cast<char>(choice) + std::string(rows));
    }
  }
  for (const auto& [choice, text] : kDialects)
    all.push_back(static_cast<char>(choice) + std::string(text));
  for (const char* graph :
       {"manhattan:poses=6", "sphere:turns=2,poses_per_turn=3", "landmarks2d:poses=5"}) {
    // Left out where there is no such generator or option.
    try {
      const auto generator = registry().make<Generator>(graph);
      const Graph made = generator->generate(registry(), 1).graph;
      for (std::size_t k = 0; k < kFormats.size(); ++k) {
        if (const auto text = write(k, made)) all.push_back(static_cast<char>(k) + *text);
      }
    } catch (const Error&) {
      continue;
    }
  }
  return all;
}

std::vector<std::string> words() {
  std::vector<std::string> all = {"FIX",
                                  "PARAMS_SE3OFFSET",
                                  "EDGE_SE3_PRIOR",
                                  "VERTEX2",
                                  "EDGE2",
                                  "EDGE3",
                                  "ODOMETRY",
                                  "LANDMARK",
                                  "VERTEX3",
                                  "EQUIV",
                                  "BR",
                                  "VERTEX_XYZ",
                                  "VERTEX_SE2:PRIOR",
                                  "EDGE_RANGE",
                                  " A0 ",
                                  "VERTEX",
                                  "EDGE",
                                  "#",
                                  "\n",
                                  "\r\n",
                                  "\t",
                                  ",",
                                  "#timestamp [ns], p_x, p_y, p_z, q_w, q_x, q_y, q_z\n",
                                  "1403715524907143168,",
                                  "1.403715524e9 ",
                                  " 0 0 0 0 0 0 0 1 ",
                                  "nan",
                                  "-inf",
                                  "1e308",
                                  "1e-308",
                                  "5e-324",
                                  "-0",
                                  "0x10",
                                  "3.141592653589793",
                                  "9223372036854775807",
                                  "2147483648",
                                  "1e999"};
  for (const char* kind : {"variable", "factor"}) {
    for (const std::string& tag : registry().names(kind)) all.push_back(tag + " ");
  }
  return all;
}

}  // namespace

Target reader() {
  std::vector<Needed> needs = {{"types", "slam2d"}, {"types", "slam3d"}, {"types", "bundle"}};
  for (const std::string_view name : kFormats) needs.push_back({Format::kKind, name});
  return {"reader", &run, &seeds, &words, needs, 512};
}

}  // namespace cairn::fuzz
