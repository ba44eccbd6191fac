// SPDX-License-Identifier: BSD-3-Clause
#include "bundle.hpp"
#include "cairn/plugin/registry.hpp"
#include "city.hpp"
#include "ellipse.hpp"
#include "grid3d.hpp"
#include "landmarks2d.hpp"
#include "manhattan.hpp"
#include "ring.hpp"
#include "sphere.hpp"
#include "torus.hpp"

void cairn_register(cairn::Registrar& registrar) {
  using namespace cairn;
  using namespace cairn::generate;
  registrar.add<Generator, ManhattanOptions>("manhattan", make_manhattan);
  registrar.add<Generator, CityOptions>("city", make_city);
  registrar.add<Generator, RingOptions>("ring", make_ring);
  registrar.add<Generator, SphereOptions>("sphere", make_sphere);
  registrar.add<Generator, TorusOptions>("torus", make_torus);
  registrar.add<Generator, Grid3dOptions>("grid3d", make_grid3d);
  registrar.add<Generator, Ellipse3dOptions>("ellipse3d", make_ellipse3d);
  registrar.add<Generator, EllipseNOptions>("ellipse_n", make_ellipse_n);
  registrar.add<Generator, Landmarks2dOptions>("landmarks2d", make_landmarks2d);
  registrar.add<Generator, BundleOptions>("bundle", make_bundle);
}
