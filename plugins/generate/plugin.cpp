// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"
#include "generators.hpp"

namespace {

using Make = std::unique_ptr<cairn::Generator> (*)(const cairn::Options&);

cairn::Registrar::Factory<cairn::Generator> factory(Make make) {
  return [make](const cairn::Options& options, cairn::Registry&) { return make(options); };
}

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn::generate;  // NOLINT: the list below is all that this file is
  const auto add = [&](const char* name, cairn::OptionTable table, Make make) {
    registrar.add<cairn::Generator>(name, std::move(table), factory(make));
  };
  add("manhattan", manhattan_options(), make_manhattan);
  add("city", city_options(), make_city);
  add("ring", ring_options(), make_ring);
  add("sphere", sphere_options(), make_sphere);
  add("torus", torus_options(), make_torus);
  add("grid3d", grid3d_options(), make_grid3d);
  add("ellipse3d", ellipse3d_options(), make_ellipse3d);
  add("ellipse_n", ellipse_n_options(), make_ellipse_n);
  add("landmarks2d", landmarks2d_options(), make_landmarks2d);
  add("bundle", bundle_options(), make_bundle);
}
