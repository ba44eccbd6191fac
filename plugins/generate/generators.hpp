// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "cairn/io/generator.hpp"
#include "cairn/plugin/options.hpp"
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

// Each kind of world: its options, and a generator of it.
OptionTable manhattan_options();
std::unique_ptr<Generator> make_manhattan(const Options& options);

OptionTable city_options();
std::unique_ptr<Generator> make_city(const Options& options);

OptionTable ring_options();
std::unique_ptr<Generator> make_ring(const Options& options);

OptionTable landmarks2d_options();
std::unique_ptr<Generator> make_landmarks2d(const Options& options);

OptionTable sphere_options();
std::unique_ptr<Generator> make_sphere(const Options& options);

OptionTable torus_options();
std::unique_ptr<Generator> make_torus(const Options& options);

OptionTable grid3d_options();
std::unique_ptr<Generator> make_grid3d(const Options& options);

OptionTable ellipse3d_options();
std::unique_ptr<Generator> make_ellipse3d(const Options& options);

OptionTable ellipse_n_options();
std::unique_ptr<Generator> make_ellipse_n(const Options& options);

OptionTable bundle_options();
std::unique_ptr<Generator> make_bundle(const Options& options);

}  // namespace cairn::generate
