// SPDX-License-Identifier: BSD-3-Clause
#include "data_sets.hpp"

#include <filesystem>

namespace cairn::performance {
namespace {

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

std::vector<DataSet> located(const std::vector<DataSet>& all, const std::string& data) {
  std::vector<DataSet> sets = all;
  std::erase_if(sets, [&](DataSet& set) { return !locate(set, data); });
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
