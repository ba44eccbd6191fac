// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <initializer_list>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/conformance/conformance.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"

namespace cairn::conformance {

// What checks of a kind of component are written with: those of cairn's own kinds, and those that a
// subject brings for its kinds (`KindChecks`).

/// "(1, -0.5, 3)", every number to its last bit; long vectors are cut.
CAIRN_API std::string text_of(std::span<const double> numbers);

/// An array between guards, for an argument of a plugin's function. It begins at an address that
/// is a multiple of 8 bytes and not of 16: nothing more is guaranteed of what a plugin is given.
class CAIRN_API Guarded {
 public:
  /// An input: it must not change.
  Guarded(std::string name, std::span<const double> values);
  /// An output, at first full of NaN.
  Guarded(std::string name, std::size_t size);
  /// An output to which is added, at first zero.
  static Guarded sum(std::string name, std::size_t size);
  /// An input that is the output too.
  static Guarded in_place(std::string name, std::span<const double> values);

  double* data();
  std::span<double> span() { return {data(), size_}; }
  std::vector<double> values() const;

  /// What was written that must not be; empty: nothing.
  std::string damage() const;

 private:
  std::string name_;
  std::size_t size_;
  std::vector<double> original_;  // of an input; empty of an output
  std::vector<double> memory_;
  std::size_t begin_;  // of the array in `memory_`
};

/// Ends the checks of one sample after a call that did not return: the finding is recorded.
struct Abandoned {};

/// Counts the checks of one group, and keeps the first input that shows each law broken.
class CAIRN_API Checker {
 public:
  Checker(ConformanceResult& result, const ConformanceOptions& options,
          ConformanceObserver* observer)
      : result_(result), options_(options), observer_(observer) {}

  const ConformanceOptions& options() const { return options_; }

  /// With which options the component is made from now on, for the descriptions of inputs; empty:
  /// with its defaults.
  void set_component(std::string spec) { component_ = std::move(spec); }
  bool of_defaults() const { return component_.empty(); }

  /// Runs `work`, the checks on one input, described by `input`.
  template <class Work>
  void sample(std::string input, const Work& work) {
    input_ = std::move(input);
    try {
      work();
    } catch (const Abandoned&) {  // the finding stands
    }
  }
  /// Replaces the description of the input.
  void describe(std::string input) { input_ = std::move(input); }

  /// Before code of the plugin runs that is called otherwise than by `call`, such as a destructor.
  void announce(std::string_view callback) const {
    if (observer_) observer_->on_call(callback, input());
  }

  /// Calls the plugin's function `callback`, and returns what it returns. What it throws, and what
  /// it writes outside of the arrays that it is given, are findings; after an exception the sample
  /// is abandoned.
  template <class Work>
  decltype(auto) call(std::string_view callback, std::initializer_list<const Guarded*> arrays,
                      const Work& work) {
    announce(callback);
    const auto examine = [&] {
      for (const Guarded* array : arrays) examine_array(callback, *array);
    };
    try {
      if constexpr (std::is_void_v<decltype(work())>) {
        work();
        examine();
      } else {
        auto result = work();
        examine();
        return result;
      }
    } catch (const Abandoned&) {
      throw;
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      threw(callback, error.what());
    } catch (...) {
      threw(callback, "what is not a std::exception");
    }
  }
  template <class Work>
  decltype(auto) call(std::string_view callback, const Work& work) {
    return call(callback, {}, work);
  }

  /// Counts one check. `problem()` is the text of the finding, asked for only if there is one.
  template <class Problem>
  bool expect(bool holds, std::string_view law, const Problem& problem) {
    ++result_.checks;
    if (!holds) fail(law, problem());
    return holds;
  }
  /// A distance that must be small; NaN is not.
  bool within(double distance, double tolerance, std::string_view law) {
    return expect(distance <= tolerance, law, [&] {
      return fmt::format("off by {:.3g}, where {:.1g} is allowed", distance, tolerance);
    });
  }
  /// Runs `work`, which measures something: without a finding, its checks do not count.
  template <class Work>
  void without_counting(const Work& work) {
    const std::int64_t before = result_.checks;
    work();
    if (result_.ok()) result_.checks = before;
  }
  /// A law that is broken, whatever was counted.
  void fail(std::string_view law, std::string problem);
  void note(std::string text) { result_.notes.push_back(std::move(text)); }

 private:
  /// The input, after the component if that is not with its defaults.
  std::string input() const;
  void examine_array(std::string_view callback, const Guarded& array);
  [[noreturn]] void threw(std::string_view callback, std::string_view what);

  ConformanceResult& result_;
  ConformanceOptions options_;
  ConformanceObserver* observer_;
  std::string component_, input_;
};

/// What the checks of one group are run on.
struct Subject {
  Registry& registry;
  const std::string& name;
};
using Checks = void (*)(const Subject&, Checker&);

/// A group of checks of a kind.
struct Group {
  std::string_view name;
  Checks run;
  bool of_defaults = false;  ///< with default options alone, since it takes its time
};

/// The checks of a kind of component, found under its name: `checks|pose_policy` in the manifest of
/// a plugin is what `cairn plugins --check` runs on every policy.
class CAIRN_API KindChecks : public Component {
 public:
  static constexpr const char* kKind = "checks";
  /// They live as long as the process.
  virtual std::span<const Group> groups() const = 0;
};

}  // namespace cairn::conformance
