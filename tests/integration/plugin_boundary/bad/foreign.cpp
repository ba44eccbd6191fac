// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/plugin.hpp"
#include "plain_loss.hpp"

namespace {
const cairn::PluginOffer kOffers[] = {{"loss", "foreign", "never seen"}};

void do_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Loss>("foreign", {}, make_plain_loss);
}
}  // namespace

extern "C" CAIRN_API const cairn::PluginManifest* cairn_plugin_v1() {
  static const cairn::PluginManifest manifest{
      "foreign",    "1.0.0", "BSD-3-Clause", "", kOffers, 1, "cairn abi 0; msvc 19; Eigen 2",
      &do_register, true,    nullptr};
  return &manifest;
}
