// SPDX-License-Identifier: BSD-3-Clause
#include "python_explorer.hpp"

#include <memory>
#include <optional>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "situation.hpp"

namespace cairn::python {
namespace {

/// The argument of a call, and asked no more after it. Under the interpreter's lock.
class Asked {
 public:
  explicit Asked(const Situation& now)
      : object_(py::cast(std::make_unique<BoundSituation>(now))),
        situation_(&object_.cast<BoundSituation&>()) {}
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;
  ~Asked() { situation_->end(); }

  const py::object& object() const { return object_; }
  BoundSituation& situation() const { return *situation_; }

 private:
  py::object object_;  // Python may keep it
  BoundSituation* situation_;
};

/// What `is_worthwhile` has returned: a bool, NumPy's too, or an integer. None, which a method
/// without a return statement returns, is not one.
bool truth_of(const py::object& returned) {
  py::detail::make_caster<bool> boolean;
  if (boolean.load(returned, false)) return py::detail::cast_op<bool>(boolean);
  if (py::isinstance<py::int_>(returned)) return bool(py::bool_(returned));
  PyErr_Format(PyExc_TypeError,
               "what is_worthwhile returned: expected True or False, not a value of type %s",
               Py_TYPE(returned.ptr())->tp_name);
  throw py::error_already_set();
}

}  // namespace

PythonExplorer::PythonExplorer(const py::object& explorer, std::function<void()> stop)
    : PythonComponent("explorer"),
      decide_(method_of(explorer, "decide")),
      begin_(method_of(explorer, "begin")),
      is_worthwhile_(method_of(explorer, "is_worthwhile")),
      stop_(std::move(stop)) {
  if (decide_.is_none()) decide_ = explorer;
  if (PyCallable_Check(decide_.ptr()) == 0 || py::isinstance<py::type>(explorer)) {
    throw Error(ErrorCode::usage,
                "explorer: expected the name of one, a function decide(situation) that returns a "
                "cairn.Decision, or an object (not its class) with such a method");
  }
}

void PythonExplorer::begin(std::uint64_t seed) {
  if (!begin_.is_none() && !call([&] { return begin_(seed), true; }, false)) stop_();
}

Decision PythonExplorer::decide(const Situation& situation) {
  const auto work = [&]() -> std::optional<Decision> {
    const Asked asked(situation);
    return decision_of(decide_(asked.object()), asked.situation());
  };
  auto decision = call(work, std::optional<Decision>());
  if (decision) return *std::move(decision);
  stop_();
  return {.kind = Decision::Kind::drive, .why = {}, .candidates = {{}}, .chosen = 0, .notes = {}};
}

bool PythonExplorer::is_worthwhile(const Situation& situation, const PlannedPath& path) {
  if (is_worthwhile_.is_none()) return Explorer::is_worthwhile(situation, path);
  const auto work = [&]() -> std::optional<bool> {
    const Asked asked(situation);
    return truth_of(is_worthwhile_(asked.object(), path));
  };
  const auto worthwhile = call(work, std::optional<bool>());
  if (!worthwhile) stop_();
  return worthwhile.value_or(false);
}

}  // namespace cairn::python
