// SPDX-License-Identifier: BSD-3-Clause
#include "data_sets.hpp"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

namespace cairn::performance {
namespace {

/// What `cairn compact` is fed with, with the truth.
const std::vector<TruthfulSet>& compacted() {
  static const std::vector<TruthfulSet> all{
      {.set = ellipse3d()},
      {.set = ellipse_n(10)},
      {.set = {"kitti_00", "pose2d/kitti_00.g2o", {}},
       .truth = Truth::camera,
       .file = "groundtruth/kitti_00_poses.txt"},
      {.set = {"kitti_00, simulated", "", {"--types", "slam3d:metric=rotation_vector"}},
       .truth = Truth::simulated,
       .file = "groundtruth/kitti_00_poses.txt"},
      {.set = {"sphere2500", "pose3d/sphere2500.g2o", {"--types", "slam3d:metric=g2o"}},
       .truth = Truth::edges,
       .file = "groundtruth/sphere2500_groundtruth_isam.txt"},
      {.set = {"sphere2500_isam",
               "pose3d/sphere2500_isam.txt",
               {"--types", "slam3d:metric=rotation_vector"}},
       .truth = Truth::edges,
       .file = "groundtruth/sphere2500_groundtruth_isam.txt"},
      {.set = {"parking-garage", "pose3d/parking-garage.g2o", {"--types", "slam3d:metric=g2o"}},
       .truth = Truth::de_facto},
      {.set = {"10kHog-man", "pose2d/10kHog-man.graph.gz", {}},
       .truth = Truth::de_facto,
       .arguments = {"--initial", "chordal"}},
      {.set = {"manhattanOlson3500", "pose2d/manhattanOlson3500_isam.txt", {}},
       .truth = Truth::file,
       .file = "groundtruth/manhattanOlson3500_nodes_groundTruth.dat"},
      {.set = {"city10000", "pose2d/city10000_isam.txt", {}},
       .truth = Truth::edges,
       .file = "groundtruth/city10000_groundtruth_isam.txt"}};
  return all;
}

const std::vector<DataSet>& of_thesis() {
  static const std::vector<std::string> chain{"--initial", "odometry"};
  static const std::vector<DataSet> all{{"M3500", "pose2d/M3500.g2o", chain},
                                        {"Intel", "pose2d/intel1228_carlone.g2o", chain},
                                        {"FR079", "pose2d/FR079.g2o", chain},
                                        {"MITb", "pose2d/MITb.g2o", chain}};
  return all;
}

const std::vector<DataSet>& in_space() {
  static const std::vector<std::string> like_g2o{"--types", "slam3d:metric=g2o"};
  static const std::vector<DataSet> all{{"sphere2500", "pose3d/sphere2500_isam.txt", {}},
                                        {"parking-garage", "pose3d/parking-garage.g2o", like_g2o},
                                        {"eecs", "pose3d/eecs_glc.g2o", like_g2o},
                                        {"duderstadt", "pose3d/duderstadt_glc.g2o", like_g2o}};
  return all;
}

/// Turns the graph's place in the folder `data` into a path; false if there is none.
bool locate(DataSet& set, const std::string& data) {
  if (set.generated()) return true;
  set.graph = (std::filesystem::path(data) / set.graph).string();
  return !data.empty() && std::filesystem::exists(set.graph);
}

bool locate(TruthfulSet& set, const std::string& data) {
  if (!set.file.empty()) {
    set.file = (std::filesystem::path(data) / set.file).string();
    if (data.empty() || !std::filesystem::exists(set.file)) return false;
  }
  return locate(set.set, data);
}

template <class Set>
std::vector<Set> located(const std::vector<Set>& all, const std::string& data) {
  std::vector<Set> sets = all;
  std::erase_if(sets, [&](Set& set) { return !locate(set, data); });
  return sets;
}

/// The published ones; if there are none or if it is to be quick, a generated one.
std::vector<DataSet> located_or(const std::vector<DataSet>& published, const std::string& data,
                                bool quick, const DataSet& small, const DataSet& generated) {
  if (quick) return {small};
  std::vector<DataSet> sets = located(published, data);
  if (sets.empty()) sets.push_back(generated);
  return sets;
}

const DataSet kSmallPlane{"manhattan, 600 poses", "@manhattan:poses=600", {}};
const DataSet kPlane{"manhattan", "@manhattan", {}};

}  // namespace

DataSet ellipse3d(const std::string& more) {
  return {"ellipse3d",
          "@ellipse3d:translation_error=0,rotation_error=0,translation_sigma=0.058,"
          "rotation_sigma=0.032" +
              more,
          {}};
}

DataSet ellipse_n(int laps, const std::string& more) {
  return {"ellipse_n",
          fmt::format("@ellipse_n:laps={},translation_error=0,rotation_error=0,"
                      "translation_sigma=0.055,rotation_sigma=0.03,loop_radius=1{}",
                      laps, more),
          {}};
}

std::vector<TruthfulSet> compact_sets(const std::string& data, bool quick) {
  if (quick) {
    return {{.set = ellipse3d()}, {.set = {"manhattan, 500 poses", "@manhattan:poses=500", {}}}};
  }
  return located(compacted(), data);
}

std::vector<TruthfulSet> gain_sets(const std::string& data, bool quick) {
  std::vector<TruthfulSet> sets = located(compacted(), quick ? "" : data);
  std::erase_if(sets, [&](const TruthfulSet& set) {
    const std::string& name = set.set.name;
    return name != "ellipse3d" && name != "sphere2500" && name != "kitti_00, simulated";
  });
  return sets;
}

std::vector<TruthfulSet> comparison_sets(const std::string& data, bool quick) {
  std::vector<TruthfulSet> sets = located(compacted(), quick ? "" : data);
  std::erase_if(sets, [](const TruthfulSet& set) {
    return set.set.name != "ellipse3d" && set.set.name != "parking-garage";
  });
  return sets;
}

std::vector<FigureSet> figure_sets(const std::string& data, bool quick) {
  std::vector<FigureSet> sets;
  for (const TruthfulSet& set : located(compacted(), quick ? "" : data)) {
    const std::string& name = set.set.name;
    const bool drawn =
        name == "ellipse3d" || name == "parking-garage" || name == "manhattanOlson3500";
    if (drawn) sets.push_back({set, name == "ellipse3d"});
  }
  return sets;
}

std::vector<SimulatedSet> simulated_sets(const std::string& data, bool quick) {
  const std::string planar = "range=3,angle=3.14";
  const SimulatedSet ellipse{.set = {.set = ellipse3d()}, .range = kEllipseSensor};
  if (quick) {
    return {
        ellipse,
        {.set = {.set = {"manhattan, 300 poses", "@manhattan:poses=300", {}}}, .range = planar}};
  }
  std::vector<SimulatedSet> sets{
      ellipse,
      {.set = {.set = {"sphere, 900 poses", "@sphere:turns=30,poses_per_turn=30,radius=30", {}}},
       .range = "range=8,angle=0.6"},
      {.set = {.set = {"manhattan, 2000 poses", "@manhattan:poses=2000", {}}}, .range = planar}};
  for (const TruthfulSet& set : located(compacted(), data)) {
    if (set.set.name == "manhattanOlson3500") sets.push_back({.set = set, .range = planar});
  }
  return sets;
}

std::vector<LiveSet> live_sets(const std::string& data, bool quick) {
  const auto circle = [](double noisier, int laps) {
    return LiveSet{
        .set = {.set = {fmt::format("circle, loop closures × {}", noisier),
                        fmt::format(
                            "@ellipse_n:laps={},poses_per_lap=40,loop_radius=5,loop_angle=0.5,"
                            "loop_density=0.1,translation_error=0,rotation_error=0,"
                            "translation_sigma=0.02,rotation_sigma=0.005,loop_noise={}",
                            laps, noisier),
                        {}}},
        .sensor = {"--range", "5", "--angle", "0.5"}};
  };
  if (quick) return {circle(2.5, 5)};
  std::vector<LiveSet> sets;
  for (const double noisier : {0.5, 1.0, 1.5, 2.5, 5.0}) sets.push_back(circle(noisier, 25));
  for (const TruthfulSet& set : located(compacted(), data)) {
    const std::string& name = set.set.name;
    if (name == "kitti_00" || name == "manhattanOlson3500" || name == "parking-garage")
      sets.push_back({.set = set});
  }
  const std::vector<TruthfulSet> more{
      {.set = {"FR079", "pose2d/FR079.g2o", {}}, .truth = Truth::de_facto},
      {.set = {"killian5489", "pose2d/killian5489_glc.g2o", {}}, .truth = Truth::de_facto}};
  for (const TruthfulSet& set : located(more, data)) sets.push_back({.set = set});
  return sets;
}

std::vector<DataSet> thesis_sets(const std::string& data, bool quick) {
  return located_or(of_thesis(), data, quick, kSmallPlane, kPlane);
}

std::vector<DataSet> space_sets(const std::string& data, bool quick) {
  return located_or(in_space(), data, quick,
                    {"sphere, 200 poses", "@sphere:turns=10,poses_per_turn=20,radius=20", {}},
                    {"sphere", "@sphere", {}});
}

std::vector<DataSet> large_sets(const std::string& data, bool quick) {
  return located_or({of_thesis().front(), {"city10000", "pose2d/city10000_isam.txt", {}}}, data,
                    quick, kSmallPlane, kPlane);
}

std::vector<DataSet> sparsify_online_sets(const std::string& data, bool quick) {
  return located_or({{"manhattanOlson3500", "pose2d/manhattanOlson3500_isam.txt", {}},
                     {"city10000", "pose2d/city10000_isam.txt", {}}},
                    data, quick, kSmallPlane, kPlane);
}

std::vector<DataSet> edge_sets(const std::string& data, bool quick) {
  return located_or({{"M3500", "pose2d/M3500.g2o", {}},
                     {"intel1728", "pose2d/intel1728.g2o", {}},
                     {"killian5489", "pose2d/killian5489_glc.g2o", {}},
                     {"sphere2500", "pose3d/sphere2500.g2o", {}},
                     {"parking-garage", "pose3d/parking-garage.g2o", {}}},
                    data, quick, kSmallPlane, kPlane);
}

}  // namespace cairn::performance
