// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#include "cairn/conformance/checker.hpp"
#include "cairn/conformance/samples.hpp"
#include "cairn/runtime/api.hpp"

// One input again and again, whatever the kind of component: memory that grows, and results that
// change when the same code runs on other threads.

namespace cairn::conformance {

/// A component whose destructor is a call of the plugin's, too: a crash in it is attributed to it.
template <class Interface>
struct AnnouncedDestructor {
  Checker* check;
  void operator()(Interface* component) const {
    check->announce("the destructor");
    delete component;
  }
};
template <class Interface>
using Made = std::unique_ptr<Interface, AnnouncedDestructor<Interface>>;

/// The component that is checked, with its default options.
template <class Interface>
Made<Interface> made(const Subject& subject, Checker& check) {
  check.announce("the factory");
  return {subject.registry.make<Interface>(subject.name).release(), {&check}};
}

/// One use on an input that never changes; returns all that comes out of it, for comparison to the
/// last bit.
using Use = std::function<State()>;

struct Repetition {
  std::string_view
      callback;   ///< what is called; empty: it cannot be used here, and nothing is checked
  int calls = 1;  ///< uses that take some milliseconds together
  /// A use with a component of its own, which it keeps from call to call; of types and losses,
  /// whose objects serve all threads, with that of the latest input 0. Another number stands for
  /// another input. To be called on one thread.
  std::function<Use(std::uint64_t input)> make;
};

/// That memory, open files and threads do not become more with each use, neither of one component
/// nor of new ones. In this process with glibc; elsewhere a note.
CAIRN_API void check_memory(const Repetition& repetition, Checker& check);

/// That repeated uses give the same bits, and so do uses at the same time on several threads, each
/// with a component and an input of its own: what one thread writes, no other reads. A race that
/// changes no result is not found.
CAIRN_API void check_threads(const Repetition& repetition, Checker& check);

using MakeRepetition = Repetition (*)(const Subject&, Checker&);

/// These as groups: `{"memory", memory_group<loss_uses>}`.
template <MakeRepetition uses>
void memory_group(const Subject& subject, Checker& check) {
  check_memory(uses(subject, check), check);
}
template <MakeRepetition uses>
void threads_group(const Subject& subject, Checker& check) {
  check_threads(uses(subject, check), check);
}

}  // namespace cairn::conformance
