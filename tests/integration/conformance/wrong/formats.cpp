// SPDX-License-Identifier: BSD-3-Clause
// g2o as cairn's own format reads and writes it, with one thing wrong each.
#include <cstdlib>
#include <iomanip>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "cairn/io/format.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/runtime/error.hpp"

namespace {

using namespace cairn;

double rounded(double number) {
  std::ostringstream text;
  text << std::setprecision(9) << number;
  return std::stod(text.str());
}

class Wrapped : public Format {
 public:
  explicit Wrapped(std::unique_ptr<Format> right) : right_(std::move(right)) {}
  bool can_read() const override { return true; }
  bool can_write() const override { return true; }
  std::vector<std::string> extensions() const override { return {"wrong"}; }
  int detect(std::string_view head) const override { return right_->detect(head); }
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    return right_->read(text, name, types, options, report);
  }
  std::string write(const Graph& graph) override { return right_->write(graph); }

 private:
  std::unique_ptr<Format> right_;
};

/// The last line is not read.
struct LosesTheLast final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    return Wrapped::read(text.substr(0, text.rfind('\n', text.size() - 2) + 1), name, types,
                         options, report);
  }
};

/// What it does not understand is an empty graph.
struct AcceptsAnything final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    try {
      return Wrapped::read(text, name, types, options, report);
    } catch (const Error&) {
      return {};
    }
  }
};

/// A file that ends within a line is not foreseen.
struct CrashesOnHalf final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    if (!text.ends_with('\n') && text.size() > 100) std::abort();
    return Wrapped::read(text, name, types, options, report);
  }
};

/// Every variable is free.
struct LosesFix final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    Graph graph = Wrapped::read(text, name, types, options, report);
    for (int v = 0; v < graph.variable_count(); ++v) graph.set_fixed(v, false);
    return graph;
  }
};

/// Nine digits are kept.
struct NineDigits final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types,
             const ReadOptions& options, ReadReport& report) override {
    Graph graph = Wrapped::read(text, name, types, options, report);
    for (int v = 0; v < graph.variable_count(); ++v) {
      std::vector<double> state(graph.state(v).begin(), graph.state(v).end());
      for (double& number : state) number = rounded(number);
      graph.set_state(v, state);
    }
    return graph;
  }
};

/// Lines that it does not know are skipped, and nobody hears of it.
struct SkipsSilently final : Wrapped {
  using Wrapped::Wrapped;
  Graph read(std::string_view text, const std::string& name, Registry& types, const ReadOptions&,
             ReadReport&) override {
    ReadReport unseen;
    return Wrapped::read(text, name, types, {.skip_unknown = true}, unseen);
  }
};

template <class Wrong>
void add(Registrar& registrar, const char* name) {
  registrar.add<Format>(name, {}, [](const Options&, Registry& registry) {
    return std::make_unique<Wrong>(registry.make<Format>("g2o"));
  });
}

}  // namespace

void cairn_register(Registrar& registrar) {
  add<LosesTheLast>(registrar, "loses_the_last");
  add<AcceptsAnything>(registrar, "accepts_anything");
  add<CrashesOnHalf>(registrar, "crashes_on_half");
  add<LosesFix>(registrar, "loses_fix");
  add<NineDigits>(registrar, "nine_digits");
  add<SkipsSilently>(registrar, "skips_silently");
}
