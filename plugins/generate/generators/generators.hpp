// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::generate {

/// A generator that is a function: options were read when it was made.
class FunctionGenerator final : public Generator {
 public:
  using Function = std::function<Simulation(Registry&, std::uint64_t)>;
  explicit FunctionGenerator(Function function) : function_(std::move(function)) {}
  Simulation generate(Registry& types, std::uint64_t seed) override {
    return function_(types, seed);
  }

 private:
  Function function_;
};

}  // namespace cairn::generate
