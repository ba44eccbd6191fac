// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/error.hpp"

#include <cstddef>
#include <exception>
#include <string>
#include <string_view>

#include "bindings.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(What was asked for cannot be done. The message says what is wrong, where, and what would work.

How an optimisation ended is no exception: see `Summary.status`.

kind: "usage" (a bad call: an unknown name, option or argument), "input" (a bad file or bad data), "numerical" (a number
was asked for that does not exist) or "plugin" (a plugin that is missing, broken or does not fit).)";

const char* kind_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::usage:
      return "usage";
    case ErrorCode::input:
      return "input";
    case ErrorCode::numerical:
      return "numerical";
    case ErrorCode::plugin:
      break;
  }
  return "plugin";
}

/// "ReadOptions::skip_unknown" in a message is the keyword argument skip_unknown in Python. (For
/// the program, option_words.cpp has the same.)
std::string in_words_of_python(std::string message) {
  for (const std::string_view prefix : {"ReadOptions::", "StampMatching::"}) {
    for (std::size_t at = 0; (at = message.find(prefix, at)) != std::string::npos;)
      message.erase(at, prefix.size());
  }
  return message;
}

// The translator of exceptions is a plain function, so the class has to be where it can find it. It
// lives as long as the process, as modules do.
PyObject* error_class = nullptr;

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const Error& error) {
    const py::object instance = py::handle(error_class)(in_words_of_python(error.what()));
    instance.attr("kind") = kind_of(error.code());
    PyErr_SetObject(error_class, instance.ptr());
  }
}

}  // namespace

void bind_errors(py::module_& module) {
  error_class = PyErr_NewExceptionWithDoc("cairn.Error", kDoc, PyExc_RuntimeError, nullptr);
  if (!error_class) throw py::error_already_set();
  py::handle(error_class).attr("kind") = "usage";  // of one that Python code raises itself
  module.add_object("Error", error_class);
  py::register_exception_translator(&translate);
}

}  // namespace cairn::python
