// SPDX-License-Identifier: BSD-3-Clause
// Does in a static constructor, or destructor, what CAIRN_TEST_CONSTRUCTOR names in the
// environment.
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string_view>

#include "plain_loss.hpp"

namespace {

struct Eager {
  Eager() {
    const char* named = std::getenv("CAIRN_TEST_CONSTRUCTOR");
    const std::string_view what = named ? named : "";
    if (what == "throws") throw std::runtime_error("there is no camera");
    if (what == "throws a number") throw 7;  // NOLINT(hicpp-exception-baseclass)
    if (what == "exits") std::exit(0);
    if (what == "ends at once") std::_Exit(3);
    if (what == "crashes") static_cast<void>(std::raise(SIGSEGV));
    crashes_at_the_end_ = what == "crashes at the end";
  }
  ~Eager() {
    if (crashes_at_the_end_) static_cast<void>(std::raise(SIGSEGV));
  }

 private:
  bool crashes_at_the_end_ = false;
} const eager;

}  // namespace

void cairn_register(cairn::Registrar& registrar) {
  registrar.add<cairn::Loss>("eager", {}, make_plain_loss);
}
