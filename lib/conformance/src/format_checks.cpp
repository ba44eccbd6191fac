// SPDX-License-Identifier: BSD-3-Clause
// Formats, which read what they write, and generators, which give the same graph for the same seed.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/repetition.hpp"
#include "cairn/conformance/sample_graph.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/io/format.hpp"
#include "cairn/io/generator.hpp"
#include "cairn/io/random_numbers.hpp"
#include "cairn/runtime/error.hpp"
#include "own_checks.hpp"

namespace cairn::conformance {
namespace {

using std::literals::operator""sv;

struct NamedGraph {
  std::string name;
  Graph graph;
};

/// Graphs of what is on offer: poses in the plane, in space, cameras with points.
std::vector<NamedGraph> graphs_to_write(Registry& registry, std::uint64_t seed) {
  std::vector<NamedGraph> graphs;
  if (registry.has("variable", "VERTEX_SE2") && registry.has("factor", "EDGE_SE2")) {
    graphs.push_back(
        {"40 poses in the plane, two of them fixed",
         two_laps(40, seed,
                  {registry.variable_type("VERTEX_SE2"), registry.factor_type("EDGE_SE2")})});
    for (const int fixed : {0, 7}) graphs.back().graph.set_fixed(fixed);
  }
  for (const char* name : {"ellipse3d", "bundle"}) {
    if (!registry.has(Generator::kKind, name)) continue;
    graphs.push_back({fmt::format("what generator '{}' makes", name),
                      registry.make<Generator>(name)->generate(registry, seed).graph});
  }
  return graphs;
}

/// The text of a graph; none where the format cannot express it.
std::optional<std::string> written(Format& format, const Graph& graph, Checker& check) {
  return check.call("write", [&]() -> std::optional<std::string> {
    try {
      return format.write(graph);
    } catch (const Error& error) {
      if (error.code() == ErrorCode::input) return {};
      throw;
    }
  });
}

/// How many variables are poses, which is all that a format of trajectories holds.
int poses_of(const Graph& graph) {
  int count = 0;
  for (int v = 0; v < graph.variable_count(); ++v) {
    const Placement* placement = graph.type(v).placement();
    if (placement && placement->has_orientation()) ++count;
  }
  return count;
}

/// What numbers may lose when they are written and read: some units in the last place, since a
/// format may turn them into other coordinates. Seventeen digits keep all of them.
constexpr double kDigits = 1e-12;

/// Where a format keeps ids: the same variables have them, and the same factors are on them.
void compare_by_id(const Graph& before, const Graph& after, Checker& check) {
  bool same = before.factor_count() == after.factor_count();
  for (int f = 0; same && f < before.factor_count(); ++f) {
    const Factor a = before.factor(f), b = after.factor(f);
    const bool ends = a.variables == b.variables && a.type->tag() == b.type->tag();
    double off = 0.0;
    for (std::size_t k = 0; ends && k < a.measurement.size(); ++k)
      off = std::max(off, std::abs(a.measurement[k] - b.measurement[k]));
    same = check.expect(ends && off <= kDigits * (1.0 + norm(a.measurement)),
                        "read finds the factors that were written", [&] {
                          return fmt::format("{} with {} instead of {} with {}",
                                             after.describe_factor(f), text_of(b.measurement),
                                             before.describe_factor(f), text_of(a.measurement));
                        });
  }
}

void compare(const Graph& before, const Graph& after, Checker& check) {
  if (after.factor_count() == 0 && after.variable_count() != before.variable_count()) {
    check.expect(after.variable_count() == poses_of(before),
                 "read finds as many poses as were written",
                 [&] { return fmt::format("{} of {}", after.variable_count(), poses_of(before)); });
    return;
  }
  check.expect(after.variable_count() == before.variable_count(),
               "read finds as many variables as were written", [&] {
                 return fmt::format("{} of {}", after.variable_count(), before.variable_count());
               });
  if (after.variable_count() != before.variable_count()) return;
  for (int v = 0; v < before.variable_count(); ++v) {
    if (after.type(v).tag() != before.type(v).tag()) continue;  // a trajectory in space
    State delta(static_cast<std::size_t>(before.type(v).tangent_size()));
    before.type(v).local(1, before.state(v).data(), after.state(v).data(), delta.data());
    check.within(norm(delta), kDigits * (1.0 + norm(before.state(v))),
                 "read finds the states that were written, to their last digits");
  }
  if (after.factor_count() == 0) return;  // a format of trajectories
  check.expect(
      after.factor_count() == before.factor_count(), "read finds as many factors as were written",
      [&] { return fmt::format("{} of {}", after.factor_count(), before.factor_count()); });
  compare_by_id(before, after, check);
  for (int v = 0; v < before.variable_count(); ++v) {
    const std::optional<int> there = after.find(before.id(v));
    if (!there) continue;
    check.expect(after.fixed(*there) == before.fixed(v), "read finds which variables are fixed",
                 [&] {
                   return fmt::format("{} is {}fixed", before.describe_variable(v),
                                      before.fixed(v) ? "not " : "");
                 });
  }
  const double here = chi2(before), there = chi2(after);
  check.within(std::abs(here - there), 1e-8 * (1.0 + here),
               "chi2 is that of the graph that was written");
}

void check_round_trip(const Subject& subject, Checker& check) {
  const auto format = made<Format>(subject, check);
  const bool reads = check.call("can_read", [&] { return format->can_read(); }),
             writes = check.call("can_write", [&] { return format->can_write(); });
  check.expect(reads || writes, "it reads or writes", [] { return std::string("neither"); });
  check.expect(!check.call("extensions", [&] { return format->extensions(); }).empty(),
               "extensions has an ending for new files", [] { return std::string("it is empty"); });
  if (!writes) return check.note("it writes nothing, so there is nothing to compare");
  bool some = false;
  for (const NamedGraph& sample : graphs_to_write(subject.registry, check.options().seed)) {
    check.sample(sample.name, [&] {
      const std::optional<std::string> text = written(*format, sample.graph, check);
      if (!text) return;
      some = true;
      if (!reads) return;
      const int confidence = check.call("detect", [&] { return format->detect(*text); });
      check.expect(confidence > 0 && confidence <= 100, "detect knows what it wrote",
                   [&] { return fmt::format("its confidence is {}", confidence); });
      ReadReport report;
      const Graph again = check.call(
          "read", [&] { return format->read(*text, "conformance", subject.registry, {}, report); });
      compare(sample.graph, again, check);
    });
  }
  check.describe("");
  if (!some) check.note("it expresses none of the graphs that could be made here");
}

/// A record that the format does not have, in the middle of a file that it has written.
void check_unknown_records(const Subject& subject, Checker& check) {
  const auto format = made<Format>(subject, check);
  if (!format->can_read() || !format->can_write())
    return check.note("it does not both read and write");
  for (const NamedGraph& sample : graphs_to_write(subject.registry, check.options().seed)) {
    check.sample(sample.name + ", and among its lines NO_SUCH_RECORD 1 2 3", [&] {
      std::optional<std::string> text = written(*format, sample.graph, check);
      if (!text) return;
      const std::size_t middle = text->find('\n', text->size() / 2);
      if (middle == std::string::npos) return;  // not in lines
      text->insert(middle + 1, "NO_SUCH_RECORD 1 2 3\n");
      ReadReport report;
      const bool read = check.call("read", [&] {
        try {
          static_cast<void>(format->read(*text, "conformance", subject.registry, {}, report));
          return true;
        } catch (const Error& error) {
          if (error.code() == ErrorCode::input) return false;
          throw;
        }
      });
      check.expect(!read || !report.skipped.empty() || !report.notes.empty(),
                   "read refuses a record that it does not know, or reports that it skips it",
                   [] { return std::string("it was skipped without a word"); });
    });
  }
}

/// What stands in place of others: what numbers, lines and words are made of, and what they are
/// not.
constexpr std::string_view kBytes = "0123456789.-+e \t\n\r#n:abXYZ\"\xff\x01\0"sv;

/// What is no graph is refused with an `Error`, and half a file is read or refused.
void check_bad_texts(const Subject& subject, Checker& check) {
  const auto format = made<Format>(subject, check);
  if (!format->can_read()) return check.note("it reads nothing");
  const auto reads = [&](std::string_view text) {
    return check.call("read", [&] {
      try {
        ReadReport report;
        static_cast<void>(format->read(text, "conformance", subject.registry, {}, report));
        return true;
      } catch (const Error& error) {
        if (error.code() == ErrorCode::input) return false;
        throw;
      }
    });
  };
  for (const std::string_view text :
       {std::string_view("this is no graph\n"), std::string_view("\x00\xff\x01\n\x00", 5),
        std::string_view("VERTEX_SE2 0 zero zero zero\n"), std::string_view("0 1 2 x\n")}) {
    check.sample(fmt::format("a text of {} bytes: {}", text.size(), text.substr(0, 16)), [&] {
      check.expect(!reads(text), "read refuses what is no graph with an Error (input)",
                   [] { return std::string("it was read"); });
    });
  }
  if (!format->can_write()) return;
  RandomNumbers random(RandomNumbers::mixed(check.options().seed + 71));
  for (const NamedGraph& sample : graphs_to_write(subject.registry, check.options().seed)) {
    check.sample("the beginning of " + sample.name, [&] {
      const std::optional<std::string> text = written(*format, sample.graph, check);
      if (!text) return;
      for (std::size_t k = 1; k < 12; ++k)
        static_cast<void>(reads(std::string_view(*text).substr(0, k * text->size() / 12)));
    });
    check.sample(sample.name + ", bytes of it changed", [&] {
      const std::optional<std::string> text = written(*format, sample.graph, check);
      if (!text || text->empty()) return;
      // A few kilobytes are enough to meet every kind of line, and quick.
      const std::string beginning =
          text->substr(0, text->find('\n', std::min<std::size_t>(text->size() - 1, 4000)));
      for (int k = 0; k < 10 * check.options().samples; ++k) {
        std::string changed = beginning;
        for (std::size_t bytes = 1 + random.below(3); bytes-- > 0;)
          changed[random.below(changed.size())] = kBytes[random.below(kBytes.size())];
        static_cast<void>(reads(changed));
      }
    });
  }
}

/// Written and read again, the first graph that it expresses.
Repetition format_uses(const Subject& subject, Checker& check) {
  const Made<Format> first = made<Format>(subject, check);
  if (!first->can_read() || !first->can_write()) return {};
  const auto expressed = [&](std::uint64_t seed) -> std::shared_ptr<const Graph> {
    for (NamedGraph& sample : graphs_to_write(subject.registry, seed)) {
      if (sample.graph.factor_count() <= 1000 && written(*first, sample.graph, check))
        return std::make_shared<const Graph>(std::move(sample.graph));
    }
    return nullptr;
  };
  std::vector<std::shared_ptr<const Graph>> graphs;
  for (std::uint64_t k = 0; k < 3; ++k) graphs.push_back(expressed(check.options().seed + k));
  if (!graphs.front()) return {};
  return {"write and read", 4, [&subject, &check, graphs](std::uint64_t input) {
            const std::shared_ptr<Format> format = made<Format>(subject, check);
            return [format, graph = graphs[input % graphs.size()], &registry = subject.registry] {
              ReadReport report;
              return states_of(
                  format->read(format->write(*graph), "conformance", registry, {}, report));
            };
          }};
}

bool same(const Graph& a, const Graph& b) {
  if (a.variable_count() != b.variable_count() || a.factor_count() != b.factor_count())
    return false;
  for (int v = 0; v < a.variable_count(); ++v) {
    if (!std::ranges::equal(a.state(v), b.state(v))) return false;
  }
  for (int f = 0; f < a.factor_count(); ++f) {
    if (!std::ranges::equal(a.measurement(f), b.measurement(f))) return false;
  }
  return true;
}

void check_simulation(const Subject& subject, Checker& check) {
  const auto generate = [&](std::uint64_t seed) {
    const auto generator = made<Generator>(subject, check);
    return check.call("generate", [&] { return generator->generate(subject.registry, seed); });
  };
  check.sample(fmt::format("seed {}", check.options().seed), [&] {
    const Simulation one = generate(check.options().seed), two = generate(check.options().seed);
    check.expect(one.graph.variable_count() > 0, "the graph has variables",
                 [] { return std::string("it is empty"); });
    check.expect(same(one.graph, two.graph) && same(one.truth, two.truth),
                 "the same seed gives the same graph", [] { return std::string("they differ"); });
    check.expect(one.truth.variable_count() == one.graph.variable_count() &&
                     one.truth.factor_count() == one.graph.factor_count(),
                 "the truth has the variables and factors of the graph", [&] {
                   return fmt::format("{} and {} variables, {} and {} factors",
                                      one.truth.variable_count(), one.graph.variable_count(),
                                      one.truth.factor_count(), one.graph.factor_count());
                 });
    check.expect(
        std::isfinite(chi2(one.graph)) && std::isfinite(chi2(one.truth)), "chi2 is finite",
        [&] { return fmt::format("{}, of the truth {}", chi2(one.graph), chi2(one.truth)); });
  });
}

Repetition generator_uses(const Subject& subject, Checker& check) {
  return {"generate", 1, [&subject, &check](std::uint64_t input) {
            const std::shared_ptr<Generator> generator = made<Generator>(subject, check);
            return [generator, &registry = subject.registry, seed = check.options().seed + input] {
              return states_of(generator->generate(registry, seed).graph);
            };
          }};
}

}  // namespace

std::span<const Group> format_groups() {
  static constexpr std::array<Group, 5> groups{{{"round trip", check_round_trip},
                                                {"unknown records", check_unknown_records},
                                                {"texts that are no graph", check_bad_texts},
                                                {"memory", memory_group<format_uses>, true},
                                                {"threads", threads_group<format_uses>, true}}};
  return groups;
}

std::span<const Group> generator_groups() {
  static constexpr std::array<Group, 3> groups{{{"simulation", check_simulation},
                                                {"memory", memory_group<generator_uses>, true},
                                                {"threads", threads_group<generator_uses>, true}}};
  return groups;
}

}  // namespace cairn::conformance
