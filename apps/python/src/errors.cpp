// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/error.hpp"

#include <cerrno>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>

#include "bindings.hpp"
#include "cairn/io/file_error.hpp"
#include "cairn/plugin/unknown_name.hpp"
#include "cairn/runtime/callback_exit.hpp"
#include "missing.hpp"

namespace cairn::python {
namespace {

const char* const kDoc =
    R"(What was asked for cannot be done. The message says what is wrong, where, and what would work.

How an optimisation ended is no exception: see `Summary.status`.

kind: "usage" (a bad call: an unknown option or argument), "input" (a bad file or bad data), "numerical" (a number was
asked for that does not exist) or "plugin" (a name that no plugin offers, or a plugin that is broken or does not fit).

An error is an exception of Python's kind as well where there is one: what the system refuses about a file is an OSError
with its errno (cairn.FileError), which is a FileNotFoundError of a file that is not there (cairn.MissingFileError), an
IsADirectoryError of a folder (cairn.FolderError) and a PermissionError where it may not be read or written
(cairn.FilePermissionError); an id that is not there is a KeyError (cairn.MissingKeyError), and any other bad value, name,
shape or content of a file a ValueError (cairn.InvalidError).)";

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

// The translator of exceptions is a plain function, so the classes have to be where it can find
// them. They live as long as the process, as modules do.
struct Classes {
  PyObject *error, *invalid, *missing_key, *file, *missing_file, *folder, *file_permission;
} classes{};

py::object made(PyObject* type, const Error& error) {
  py::object instance = py::handle(type)(in_words_of_python(error.what()));
  instance.attr("kind") = kind_of(error.code());
  return instance;
}

void raise_again(const std::exception_ptr& cause) {
  try {
    std::rethrow_exception(cause);
  } catch (py::error_already_set& error) {
    error.restore();
  }
}

/// Of a failure of the system, the class that is Python's own for its number too.
PyObject* file_class(int number) {
  switch (number) {
    case ENOENT:
      return classes.missing_file;
    case EISDIR:
      return classes.folder;
    case EACCES:
    case EPERM:
      return classes.file_permission;
    default:
      return classes.file;
  }
}

void raise_file_error(const Error& error, const std::filesystem::path& file, int number) {
  PyObject* const type = file_class(number);
  const py::object instance = made(type, error);
  instance.attr("errno") = number;
  instance.attr("filename") = file.string();
  PyErr_SetObject(type, instance.ptr());
}

void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const MissingFile& error) {
    raise_file_error(error, error.file(), ENOENT);
  } catch (const FileError& error) {
    raise_file_error(error, error.file(), error.number());
  } catch (const MissingKey& error) {
    PyErr_SetObject(classes.missing_key, made(classes.missing_key, error).ptr());
  } catch (const UnknownName& error) {
    PyErr_SetObject(classes.invalid, made(classes.invalid, error).ptr());
  } catch (const CallbackExit& exit) {
    raise_again(exit.cause());
  } catch (const Error& error) {
    const bool invalid = error.code() == ErrorCode::usage || error.code() == ErrorCode::input;
    PyObject* const type = invalid ? classes.invalid : classes.error;
    PyErr_SetObject(type, made(type, error).ptr());
  }
}

/// A class that is a `base` of ours and a built-in one, and is shown as the text that it was made
/// with.
PyObject* add_class(py::module_& module, const char* name, PyObject* base, PyObject* built_in,
                    const char* doc) {
  py::dict members;
  members["__str__"] = py::handle(PyExc_BaseException).attr("__str__");  // a KeyError quotes it
  const py::tuple bases = py::make_tuple(py::handle(base), py::handle(built_in));
  PyObject* const made = PyErr_NewExceptionWithDoc((std::string("cairn.") + name).c_str(), doc,
                                                   bases.ptr(), members.ptr());
  if (!made) throw py::error_already_set();
  module.add_object(name, made);
  return made;
}

}  // namespace

void bind_errors(py::module_& module) {
  classes.error = PyErr_NewExceptionWithDoc("cairn.Error", kDoc, PyExc_RuntimeError, nullptr);
  if (!classes.error) throw py::error_already_set();
  py::handle(classes.error).attr("kind") = "usage";  // of one that Python code raises itself
  module.add_object("Error", classes.error);
  classes.invalid = add_class(module, "InvalidError", classes.error, PyExc_ValueError,
                              "A value, name, shape, option or file that is not as it has to be.");
  classes.missing_key = add_class(module, "MissingKeyError", classes.error, PyExc_KeyError,
                                  "An id, or the position of a factor, that is not there.");
  classes.file = add_class(module, "FileError", classes.error, PyExc_OSError,
                           "A file that the system refuses to read or to write: a full disk, a "
                           "folder. `errno` says why; it is of Python's class for that too.");
  classes.missing_file =
      add_class(module, "MissingFileError", classes.file, PyExc_FileNotFoundError,
                "A file, or the folder of one, that is not there.");
  classes.folder = add_class(module, "FolderError", classes.file, PyExc_IsADirectoryError,
                             "A folder where a file is expected.");
  classes.file_permission =
      add_class(module, "FilePermissionError", classes.file, PyExc_PermissionError,
                "A file, or the folder of one, that may not be read or written.");
  py::register_exception_translator(&translate);
}

}  // namespace cairn::python
