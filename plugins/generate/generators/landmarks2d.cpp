// SPDX-License-Identifier: BSD-3-Clause
// A random walk through streets with point landmarks beside them, seen from within a range: nothing
// but the landmarks ties the path together.
#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/runtime/error.hpp"
#include "generators.hpp"
#include "landmarks2d.hpp"
#include "loops.hpp"
#include "noise.hpp"
#include "simulation_builder.hpp"
#include "streets.hpp"

namespace cairn::generate {
namespace {

using Point = std::array<double, 2>;

/// How landmarks are seen.
struct Sensor {
  bool bearing_range = false;  ///< else Cartesian in the frame of the pose
  double range = 0.0;          ///< [m]
  double probability = 0.0;    ///< that a landmark within range is seen
  double sigma = 0.0;          ///< Cartesian: each axis; bearing and range: range [m]
  double bearing_sigma = 0.0;  ///< [rad]
};

struct Sighting {
  int pose;
  int landmark;
  bool wrong;
};

std::vector<Point> scatter(const std::vector<Pose2>& path, double density, double margin,
                           Random& random) {
  double low_x = path[0].x, high_x = low_x, low_y = path[0].y, high_y = low_y;
  for (const Pose2& pose : path) {
    low_x = std::min(low_x, pose.x), high_x = std::max(high_x, pose.x);
    low_y = std::min(low_y, pose.y), high_y = std::max(high_y, pose.y);
  }
  low_x -= margin, low_y -= margin, high_x += margin, high_y += margin;
  const double count = std::ceil(density * (high_x - low_x) * (high_y - low_y));
  if (count > 1e8) {
    throw Error(ErrorCode::usage,
                "generate landmarks2d: more than 1e8 landmarks; lower landmark_density");
  }
  std::vector<Point> landmarks(static_cast<std::size_t>(count));
  for (Point& landmark : landmarks) {
    landmark[0] = random.uniform(low_x, high_x);
    landmark[1] = random.uniform(low_y, high_y);
  }
  return landmarks;
}

std::vector<Sighting> look_around(const std::vector<Pose2>& path,
                                  const std::vector<Point>& landmarks, const Sensor& sensor,
                                  Random& random) {
  CellGrid grid(sensor.range, 0);
  for (std::size_t k = 0; k < landmarks.size(); ++k) {
    grid.add(static_cast<int>(k), {landmarks[k][0], landmarks[k][1], 0.0}, random);
  }
  std::vector<Sighting> sightings;
  for (int pose = 0; pose < static_cast<int>(path.size()); ++pose) {
    const std::size_t first = sightings.size();
    grid.around({path[pose].x, path[pose].y, 0.0}, [&](int landmark) {
      const double dx = landmarks[landmark][0] - path[pose].x,
                   dy = landmarks[landmark][1] - path[pose].y;
      if (dx * dx + dy * dy >= sensor.range * sensor.range) return;
      if (random.chance(sensor.probability)) sightings.push_back({pose, landmark, false});
    });
    std::sort(sightings.begin() + static_cast<std::ptrdiff_t>(first), sightings.end(),
              [](const Sighting& a, const Sighting& b) { return a.landmark < b.landmark; });
  }
  return sightings;
}

/// Wrong data associations: a landmark that is seen somewhere, taken for one that is far from
/// there.
void confuse(std::vector<Sighting>& sightings, std::int64_t count, const std::vector<Pose2>& path,
             const std::vector<Point>& landmarks, double range, Random& random) {
  constexpr int kTries = 1000;
  const auto right = static_cast<std::int64_t>(sightings.size());
  for (std::int64_t k = 0; k < count; ++k) {
    int tries = 0;
    for (; tries < kTries && right > 0; ++tries) {
      const int landmark = sightings[static_cast<std::size_t>(random.below(right))].landmark;
      const int pose = static_cast<int>(random.below(static_cast<std::int64_t>(path.size())));
      const double dx = landmarks[landmark][0] - path[pose].x,
                   dy = landmarks[landmark][1] - path[pose].y;
      if (dx * dx + dy * dy <= 9.0 * range * range) continue;
      sightings.push_back({pose, landmark, true});
      break;
    }
    if (tries == kTries || right == 0) {
      throw Error(ErrorCode::usage,
                  "generate landmarks2d: outliers: no landmark is further than three times "
                  "sensor_range from "
                  "a pose; ask for a larger world or for none (outliers=0)");
    }
  }
  std::stable_sort(sightings.begin(), sightings.end(),
                   [](const Sighting& a, const Sighting& b) { return a.pose < b.pose; });
}

/// Adds landmarks and their sightings to a path under construction.
class LandmarkBuilder {
 public:
  LandmarkBuilder(Registry& types, const Sensor& sensor, const Noise& noise, std::uint64_t seed,
                  std::size_t landmarks, Id first_id)
      : sensor_(sensor),
        noise_(noise),
        random_(seed, Random::Stream::landmarks),
        variable_(types.variable_type("VERTEX_XY")),
        factor_(
            types.factor_type(sensor.bearing_range ? "EDGE_BEARING_RANGE_SE2_XY" : "EDGE_SE2_XY")),
        variable_of_(landmarks, -1),
        next_id_(first_id) {}

  /// `seen_at`: where the sensor truly saw something, which may not be the landmark it is taken
  /// for.
  void add(SimulationBuilder<Pose2>& builder, const Sighting& sighting, const Point& landmark,
           const Point& seen_at) {
    const Pose2 in_pose = between(builder.truth(sighting.pose), Pose2{seen_at[0], seen_at[1], 0.0});
    const double sigma = noise_.scale * sensor_.sigma;
    const double sigma_bearing = noise_.scale * sensor_.bearing_sigma;
    Point z{in_pose.x, in_pose.y};
    if (sensor_.bearing_range) {
      z = {wrap_angle(arc_tangent(in_pose.y, in_pose.x) + sigma_bearing * random_.gaussian()),
           std::fabs(length(in_pose) + sigma * random_.gaussian())};
    } else {
      z[0] += sigma * random_.gaussian();
      z[1] += sigma * random_.gaussian();
    }
    if (variable_of_[sighting.landmark] < 0) create(builder, sighting, landmark, z);
    const double s0 = weight_sigma(sensor_.bearing_range ? sensor_.bearing_sigma : sensor_.sigma);
    const double s1 = weight_sigma(sensor_.sigma);
    const std::array<double, 3> information{1.0 / (s0 * s0), 0.0, 1.0 / (s1 * s1)};
    const std::array<int, 2> variables{*builder.graph().find(sighting.pose),
                                       variable_of_[sighting.landmark]};
    builder.graph().add_factor(factor_, variables, z, information);
  }

 private:
  double weight_sigma(double sigma) const {
    return noise_.scale == 0.0 ? sigma : noise_.scale * sigma;
  }

  /// The first sighting places the landmark from the estimate of the pose.
  void create(SimulationBuilder<Pose2>& builder, const Sighting& sighting, const Point& landmark,
              const Point& z) {
    Pose2 in_pose{z[0], z[1], 0.0};
    if (sensor_.bearing_range) {
      const SinCos bearing = sin_cos(z[0]);
      in_pose = {z[1] * bearing.cos, z[1] * bearing.sin, 0.0};
    }
    const Pose2 guess = compose(builder.estimate(sighting.pose), in_pose);
    const int variable =
        builder.graph().add_variable(variable_, next_id_++, Point{guess.x, guess.y});
    variable_of_[sighting.landmark] = variable;
    builder.set_truth(variable, {landmark[0], landmark[1]});
  }

  Sensor sensor_;
  Noise noise_;
  Random random_;
  std::shared_ptr<const VariableType> variable_;
  std::shared_ptr<const FactorType> factor_;
  std::vector<int> variable_of_;
  Id next_id_;
};

}  // namespace

std::unique_ptr<Generator> make_landmarks2d(const Landmarks2dOptions& options) {
  const std::int64_t poses = options.poses;
  const int block = options.block;
  int streets = options.streets;
  if (streets == 0) streets = streets_for(poses, block, 3.0);
  StreetWorld world{options.step, {}, {}};
  world.east_gaps.assign(static_cast<std::size_t>(std::max(streets - 1, 1)), block);
  world.north_gaps = world.east_gaps;
  const Sensor sensor{options.sensor == LandmarkSensor::bearing_range, options.sensor_range,
                      options.loop_density, options.landmark_sigma, options.bearing_sigma};
  const double density = options.landmark_density;
  const std::int64_t outliers = options.outliers;
  const Noise noise = options.noise;
  return std::make_unique<FunctionGenerator>([=](Registry& types, std::uint64_t seed) {
    Random walk(seed, Random::Stream::path), meet(seed, Random::Stream::loops);
    Random wrong(seed, Random::Stream::outliers);
    const std::vector<Pose2> path = random_walk(world, poses, walk);
    const std::vector<Point> landmarks = scatter(path, density, 0.5 * sensor.range, meet);
    std::vector<Sighting> sightings = look_around(path, landmarks, sensor, meet);
    confuse(sightings, outliers, path, landmarks, sensor.range, wrong);

    SimulationBuilder<Pose2> builder(types, noise, seed, path.size() + landmarks.size(),
                                     path.size() + sightings.size());
    LandmarkBuilder seen(types, sensor, noise, seed, landmarks.size(),
                         static_cast<Id>(path.size()));
    auto sighting = sightings.begin();
    for (int k = 0; k < static_cast<int>(path.size()); ++k) {
      builder.add_pose(path[k]);
      for (; sighting != sightings.end() && sighting->pose == k; ++sighting) {
        Point at = landmarks[sighting->landmark];
        if (sighting->wrong) {
          const double reach = 0.5 * sensor.range;
          at = {path[k].x + wrong.uniform(-reach, reach), path[k].y + wrong.uniform(-reach, reach)};
        }
        seen.add(builder, *sighting, landmarks[sighting->landmark], at);
      }
    }
    return builder.finish();
  });
}

}  // namespace cairn::generate
