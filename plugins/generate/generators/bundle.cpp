// SPDX-License-Identifier: BSD-3-Clause
// Cameras that see points, for bundle adjustment: around a thing, where every camera shares points
// with many others, or along a street, where only neighbours do. Camera model and conventions are
// those of the BAL data sets.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "bundle.hpp"
#include "cairn/runtime/error.hpp"
#include "generators.hpp"
#include "rigid.hpp"

namespace cairn::generate {
namespace {

using Point = std::array<double, 3>;
using Pixel = std::array<double, 2>;

constexpr double kFocalLength = 800.0;                   // [px], the middle of all cameras
constexpr double kHalfWidth = 600.0, kHalfHeight = 450;  // of an image [px]
constexpr double kNearest = 2.0, kFurthest = 30.0;       // depths at which a point is seen [m]
constexpr int kTries = 200;                              // to place a point that two cameras see
constexpr int kLeastSightings = 8;  // of a camera: sixteen numbers for its nine unknowns

struct Camera {
  double f, k1, k2;
  Pose3 pose;  // in the world; looks along −z, y up

  std::array<double, 10> state() const {
    const Pose3::State place = generate::state(pose);
    std::array<double, 10> x{f, k1, k2};
    std::copy(place.begin(), place.end(), x.begin() + 3);
    return x;
  }
};

/// A point of a surface, which is seen from in front of it.
struct SurfacePoint {
  Point at, normal;
};

struct Sighting {
  int camera, point;
  Pixel pixel;  // where it truly is
};

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point apart(const Point& from, const Point& to) {
  return {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
}

/// The camera at `t` that looks along `forward`, upright.
Pose3 looking(const Point& t, const Point& forward) {
  // From axes forward, left, up to right, up, back.
  const Pose3 turned{{}, {0.5, -0.5, -0.5, 0.5}};
  return compose(look_along(t, forward, {0.0, 0.0, 1.0}), turned);
}

/// On a wavy circle around the origin, looking inwards.
Pose3 around(int k, int cameras) {
  constexpr double kDistance = 15.0, kWave = 3.0;  // [m]
  const double turn = 2.0 * kPi * k / cameras;
  const SinCos angle = sin_cos(wrap_angle(turn)), wave = sin_cos(wrap_angle(3.0 * turn));
  const Point t{kDistance * angle.cos, kDistance * angle.sin, kWave * wave.sin};
  return looking(t, {-t[0], -t[1], -t[2]});
}
/// A step further along x, looking ahead and to the left and right in turn.
Pose3 along(int k) {
  constexpr double kStep = 1.0, kSideways = 0.35;
  return looking({kStep * k, 0.0, 0.0}, {1.0, k % 2 == 0 ? kSideways : -kSideways, 0.0});
}

std::vector<Camera> place_cameras(const BundleOptions& world, Random& random) {
  std::vector<Camera> cameras(static_cast<std::size_t>(world.cameras));
  for (int k = 0; k < world.cameras; ++k) {
    Camera& camera = cameras[k];
    camera.f = kFocalLength * random.uniform(0.95, 1.05);
    camera.k1 = random.uniform(-0.1, 0.0);
    camera.k2 = random.uniform(0.0, 0.02);
    camera.pose = world.layout == Layout::street ? along(k) : around(k, world.cameras);
  }
  return cameras;
}

/// On a ball of 5 m at the origin, or on the fronts of the houses, 8 m to both sides.
SurfacePoint draw_point(const BundleOptions& world, Random& random) {
  if (world.layout == Layout::street) {
    constexpr double kSide = 8.0, kDepth = 1.5;  // [m]
    const bool left = random.chance(0.5);
    const double x = random.uniform(kNearest, world.cameras + kFurthest);
    const double y = kSide + random.uniform(-kDepth, kDepth), z = random.uniform(-2.0, 10.0);
    return {{x, left ? y : -y, z}, {0.0, left ? -1.0 : 1.0, 0.0}};
  }
  constexpr double kRadius = 5.0;
  Point p;
  for (;;) {
    for (double& coordinate : p) coordinate = random.uniform(-1.0, 1.0);
    const double square = dot(p, p);
    if (square > 1.0 || square < 0.01) continue;
    const double length = std::sqrt(square);
    const double bump = kRadius * random.uniform(0.8, 1.0) / length;
    return {{p[0] * bump, p[1] * bump, p[2] * bump}, {p[0] / length, p[1] / length, p[2] / length}};
  }
}

/// f (1 + k1 ‖p‖² + k2 ‖p‖⁴) p with p = −(P_x, P_y) / P_z.
Pixel project(const Camera& camera, const Point& P) {
  const double x = -P[0] / P[2], y = -P[1] / P[2];
  const double n = x * x + y * y;
  const double scale = camera.f * (1.0 + n * (camera.k1 + n * camera.k2));
  return {scale * x, scale * y};
}

Point in_camera(const Camera& camera, const Point& X) {
  return between(camera.pose, Pose3{X, {0.0, 0.0, 0.0, 1.0}}).t;
}

/// Whether a camera sees a point, and where.
bool sees(const Camera& camera, const SurfacePoint& point, Pixel& pixel) {
  constexpr double kGrazing = 0.2;  // cosine of the flattest angle
  const Point ray = apart(point.at, camera.pose.t);
  const double distance = std::sqrt(dot(ray, ray));
  if (dot(ray, point.normal) < kGrazing * distance) return false;
  const Point P = in_camera(camera, point.at);
  if (P[2] > -kNearest || P[2] < -kFurthest) return false;
  // Without distortion: far from the middle it would fold the world back into the image.
  const double scale = -camera.f / P[2];
  if (std::fabs(scale * P[0]) > kHalfWidth || std::fabs(scale * P[1]) > kHalfHeight) return false;
  pixel = project(camera, P);
  return true;
}

/// The cameras that may see a point: all, or those of the stretch of the street before it.
std::array<int, 2> candidates(const BundleOptions& world, const Point& at) {
  if (world.layout != Layout::street) return {0, world.cameras};
  const double first = std::floor(at[0] - 1.5 * kFurthest), last = std::ceil(at[0]);
  return {std::max(0, static_cast<int>(first)),
          std::min(world.cameras, std::max(0, static_cast<int>(last)))};
}

class Scene {
 public:
  Scene(const BundleOptions& world, std::uint64_t seed) : world_(world) {
    Random path(seed, Random::Stream::path), place(seed, Random::Stream::landmarks);
    cameras = place_cameras(world, path);
    for (int k = 0; k < world.points; ++k) add_point(place);
    std::stable_sort(sightings.begin(), sightings.end(),
                     [](const Sighting& a, const Sighting& b) { return a.camera < b.camera; });
    check_cameras();
  }

  std::vector<Camera> cameras;
  std::vector<SurfacePoint> points;
  std::vector<Sighting> sightings;  // by camera, then by point

 private:
  /// A point that at least two cameras see, and `track` of those that do.
  void add_point(Random& random) {
    for (int tries = 0; tries < kTries; ++tries) {
      const SurfacePoint point = draw_point(world_, random);
      const auto [first, last] = candidates(world_, point.at);
      seen_.clear();
      Pixel pixel;
      for (int c = first; c < last; ++c) {
        if (sees(cameras[c], point, pixel)) {
          seen_.push_back({c, static_cast<int>(points.size()), pixel});
        }
      }
      if (seen_.size() < 2) continue;
      choose(random);
      points.push_back(point);
      return;
    }
    throw Error(ErrorCode::usage,
                "generate bundle: found no more points that two cameras see; ask for more cameras");
  }

  /// Each of the sightings with the same probability, in their order.
  void choose(Random& random) {
    auto left = static_cast<std::int64_t>(seen_.size());
    std::int64_t wanted = std::min<std::int64_t>(world_.track, left);
    for (const Sighting& sighting : seen_) {
      if (random.below(left--) >= wanted) continue;
      sightings.push_back(sighting);
      --wanted;
    }
  }

  void check_cameras() const {
    std::vector<int> count(cameras.size(), 0);
    for (const Sighting& sighting : sightings) ++count[sighting.camera];
    const auto poorest = std::min_element(count.begin(), count.end());
    if (*poorest >= kLeastSightings) return;
    throw Error(ErrorCode::usage,
                "generate bundle: camera " + std::to_string(poorest - count.begin()) + " sees " +
                    std::to_string(*poorest) + " points, and " + std::to_string(kLeastSightings) +
                    " are the least; ask for more points, or for longer tracks (track=)");
  }

  const BundleOptions& world_;
  std::vector<Sighting> seen_;
};

/// Wrong data associations: what is seen of one point, taken for another that the camera would see
/// somewhere else.
void confuse(Scene& scene, const BundleOptions& world, Random& random) {
  const double least = 20.0 * world.errors.pixel * std::max(world.errors.scale, 1.0);
  const auto right = static_cast<std::int64_t>(scene.sightings.size());
  for (std::int64_t k = 0; k < world.outliers; ++k) {
    int tries = 0;
    for (; tries < kTries; ++tries) {
      Sighting wrong = scene.sightings[static_cast<std::size_t>(random.below(right))];
      wrong.point = static_cast<int>(random.below(world.points));
      const Point P = in_camera(scene.cameras[wrong.camera], scene.points[wrong.point].at);
      if (P[2] > -kNearest) continue;
      const Pixel truly = project(scene.cameras[wrong.camera], P);
      const double du = truly[0] - wrong.pixel[0], dv = truly[1] - wrong.pixel[1];
      if (du * du + dv * dv < least * least) continue;
      scene.sightings.push_back(wrong);
      break;
    }
    if (tries == kTries) {
      throw Error(ErrorCode::usage,
                  "generate bundle: outliers: found no two points that a camera sees far enough "
                  "apart; ask for less noise or for none (outliers=0)");
    }
  }
  std::stable_sort(scene.sightings.begin(), scene.sightings.end(),
                   [](const Sighting& a, const Sighting& b) { return a.camera < b.camera; });
}

/// The first estimate of a camera.
Camera disturbed(const Camera& truth, const BundleErrors& errors, Random& random) {
  std::array<double, 6> motion;
  for (int k = 0; k < 6; ++k) {
    motion[k] = errors.scale * (k < 3 ? errors.translation : errors.rotation) * random.gaussian();
  }
  const double f = errors.scale * errors.focal * random.gaussian();
  const double k1 = errors.scale * errors.distortion * random.gaussian();
  const double k2 = errors.scale * errors.distortion * random.gaussian();
  if (errors.scale == 0.0) return truth;  // exactly, not up to rounding
  return {truth.f + f, truth.k1 + k1, truth.k2 + k2, compose(truth.pose, from_vectors(motion))};
}

Simulation build(const Scene& scene, const BundleOptions& world, Registry& types,
                 std::uint64_t seed) {
  const auto camera = types.variable_type("VERTEX_CAMERA_BAL");
  const auto point = types.variable_type("VERTEX_TRACKXYZ");
  const auto projection = types.factor_type("EDGE_PROJECT_BAL");
  const BundleErrors& errors = world.errors;
  Random guess(seed, Random::Stream::loops), noise(seed, Random::Stream::noise);

  Graph graph;
  graph.reserve(scene.cameras.size() + scene.points.size(), scene.sightings.size());
  for (int k = 0; k < world.cameras; ++k) {
    const Camera& truth = scene.cameras[k];
    graph.add_variable(camera, k, (k == 0 ? truth : disturbed(truth, errors, guess)).state());
  }
  for (int k = 0; k < world.points; ++k) {
    Point at = scene.points[k].at;
    for (double& coordinate : at) coordinate += errors.scale * errors.point * guess.gaussian();
    graph.add_variable(point, world.cameras + k, at);
  }
  const double sigma = errors.pixel * (errors.scale == 0.0 ? 1.0 : errors.scale);
  const std::array<double, 3> information{1.0 / (sigma * sigma), 0.0, 1.0 / (sigma * sigma)};
  for (const Sighting& sighting : scene.sightings) {
    Pixel z = sighting.pixel;
    for (double& coordinate : z) coordinate += errors.scale * errors.pixel * noise.gaussian();
    const std::array<int, 2> ends{sighting.camera, world.cameras + sighting.point};
    graph.add_factor(projection, ends, z, information);
  }

  Graph truth = graph.clone();
  for (int k = 0; k < world.cameras; ++k) truth.set_state(k, scene.cameras[k].state());
  for (int k = 0; k < world.points; ++k) {
    truth.set_state(world.cameras + k, scene.points[k].at);
  }
  return {std::move(graph), std::move(truth)};
}

}  // namespace

std::unique_ptr<Generator> make_bundle(const BundleOptions& world) {
  return std::make_unique<FunctionGenerator>([world](Registry& types, std::uint64_t seed) {
    Scene scene(world, seed);
    Random wrong(seed, Random::Stream::outliers);
    confuse(scene, world, wrong);
    return build(scene, world, types, seed);
  });
}

}  // namespace cairn::generate
