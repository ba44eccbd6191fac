// SPDX-License-Identifier: BSD-3-Clause
#include "python.hpp"

#include <dlfcn.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"

namespace cairn::plot {
namespace {

namespace fs = std::filesystem;

/// What is run, without the folder that the program is started in: files there may have any name.
constexpr const char* kBegin = "import sys; sys.path[:] = filter(None, sys.path); ";
constexpr const char* kDraw =
    "import runpy; runpy.run_module('cairn.plot', run_name='__main__', alter_sys=True)";
constexpr const char* kMissing =
    "from importlib.util import find_spec; "
    "print(', '.join(name for name in ('cairn', 'numpy', 'matplotlib') if not find_spec(name)), "
    "end='')";

struct Interpreter {
  std::string program;
  std::string module_folder;  ///< where it finds the package before it looks elsewhere; or empty
};

/// The folder with the Python package that belongs to this plugin; empty where there is none.
std::string own_module_folder() {
  Dl_info info{};
  if (::dladdr(reinterpret_cast<const void*>(&own_module_folder), &info) == 0) return {};
  std::error_code error;
  for (const char* folder : {CAIRN_PYTHON_BUILT, CAIRN_PYTHON_INSTALLED}) {
    const fs::path path = fs::absolute(info.dli_fname, error).parent_path() / folder;
    if (fs::exists(path / "cairn" / "plot" / "__main__.py", error))
      return path.lexically_normal().string();
  }
  return {};
}

/// One that the user names has modules of its own, which those for another must not come before.
Interpreter find_interpreter() {
  const char* const named = std::getenv("CAIRN_PYTHON");
  if (named && *named) return {named, {}};
  std::error_code error;
  constexpr std::string_view kBuiltFor = CAIRN_PYTHON_INTERPRETER;
  if (!kBuiltFor.empty() && fs::exists(kBuiltFor, error))
    return {std::string(kBuiltFor), own_module_folder()};
  return {"python3", {}};
}

Error cannot_draw(const Interpreter& python, const std::string& why) {
  return {
      ErrorCode::plugin,
      fmt::format("no plot can be drawn: Python draws them, and {} {}; install what is missing, "
                  "on Debian by apt install python3-matplotlib python3-cairn, or name another "
                  "interpreter by CAIRN_PYTHON=FILE",
                  python.program, why)};
}

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// A file without a name.
File temporary_file() {
  File file(std::tmpfile(), std::fclose);
  if (!file) {
    throw Error(ErrorCode::input, fmt::format("a plot needs a temporary file: {}",
                                              std::generic_category().message(errno)));
  }
  return file;
}

std::string content(std::FILE* file) {
  std::string text;
  std::rewind(file);
  char bytes[1 << 16];
  for (std::size_t count = 0; (count = std::fread(bytes, 1, sizeof bytes, file)) > 0;)
    text.append(bytes, count);
  return text;
}

std::vector<std::string> environment(const Interpreter& python) {
  std::vector<std::string> all{"MPLBACKEND=Agg"};
  std::string path = python.module_folder;
  for (char** setting = ::environ; *setting; ++setting) {
    const std::string_view text = *setting;
    if (text.starts_with("MPLBACKEND=")) continue;
    if (text.starts_with("PYTHONPATH=")) {
      if (text.back() != '=')
        path += (path.empty() ? "" : ":") + std::string(text.substr(text.find('=') + 1));
      continue;
    }
    all.emplace_back(text);
  }
  if (!path.empty()) all.push_back("PYTHONPATH=" + path);
  return all;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> all;
  for (std::string& text : texts) all.push_back(text.data());
  all.push_back(nullptr);
  return all;
}

struct Ended {
  int status = 0;  ///< as of `waitpid`
  std::string out, err;
};

Ended run(const Interpreter& python, const std::string& code, const std::string& argument,
          const std::string& input) {
  const File in = temporary_file(), out = temporary_file(), err = temporary_file();
  if (std::fwrite(input.data(), 1, input.size(), in.get()) != input.size() ||
      std::fflush(in.get()) != 0) {
    throw Error(ErrorCode::input, fmt::format("the numbers of a plot cannot be written: {}",
                                              std::generic_category().message(errno)));
  }
  std::rewind(in.get());
  std::vector<std::string> words{python.program, "-c", kBegin + code, argument},
      settings = environment(python);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(in.get()), STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(out.get()), STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ::fileno(err.get()), STDERR_FILENO);
  pid_t child = -1;
  const int failed = ::posix_spawnp(&child, python.program.c_str(), &actions, nullptr,
                                    pointers(words).data(), pointers(settings).data());
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    throw cannot_draw(python, failed == ENOENT
                                  ? "is not there"
                                  : fmt::format("cannot be started ({})",
                                                std::generic_category().message(failed)));
  }
  Ended ended;
  while (::waitpid(child, &ended.status, 0) < 0 && errno == EINTR) {
  }
  ended.out = content(out.get());
  ended.err = content(err.get());
  while (ended.err.ends_with('\n')) ended.err.pop_back();
  return ended;
}

bool is_exit(int status, int code) { return WIFEXITED(status) && WEXITSTATUS(status) == code; }

/// How Python ended where it should not have: the last line of what it said.
std::string failure(const Ended& ended) {
  if (WIFSIGNALED(ended.status))
    return fmt::format("was ended by signal {}", WTERMSIG(ended.status));
  const std::string said = ended.err.substr(ended.err.rfind('\n') + 1);
  return fmt::format("ends with code {}{}{}", WEXITSTATUS(ended.status), said.empty() ? "" : ": ",
                     said);
}

}  // namespace

void check_python() {
  static std::atomic<bool> checked = false;  // once is enough: several plots may be drawn
  if (checked) return;
  const Interpreter python = find_interpreter();
  const Ended ended = run(python, kMissing, "", "");
  if (!is_exit(ended.status, 0)) throw cannot_draw(python, failure(ended));
  if (!ended.out.empty()) throw cannot_draw(python, "has no module " + ended.out);
  checked = true;
}

std::string draw_by_python(const std::string& format, const std::string& numbers) {
  const Interpreter python = find_interpreter();
  Ended ended = run(python, kDraw, format, numbers);
  if (is_exit(ended.status, 0)) return std::move(ended.out);
  for (const ErrorCode code : {ErrorCode::usage, ErrorCode::input}) {
    if (is_exit(ended.status, static_cast<int>(code))) throw Error(code, ended.err);
  }
  throw cannot_draw(python, failure(ended));
}

}  // namespace cairn::plot
