// SPDX-License-Identifier: BSD-3-Clause
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <utility>

#include "cairn/runtime/error.hpp"
#include "command_line.hpp"
#include "option_words.hpp"
#include "session.hpp"

namespace {

constexpr int kExitBug = 1;

/// One line on standard error, whatever the message looked like; only a table, whose lines are
/// indented by four columns, keeps its lines.
void print_error(std::string message) {
  message = cairn::app::in_command_line_words(std::move(message));
  const bool table = message.find("\n    ") != std::string::npos;
  for (std::size_t k = 0; !table && (k = message.find('\n', k)) != std::string::npos;) {
    const std::size_t next = message.find_first_not_of(" \n", k);
    message.replace(k, (next == std::string::npos ? message.size() : next) - k, "; ");
  }
  std::fprintf(stderr, "cairn: %s\n", message.c_str());
}

int run(int argc, const char* const* argv) {
  cairn::app::Session session;
  cairn::app::CommandLine line(session);
  return line.parse(argc, argv)();
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);  // `cairn … | head` is no reason to die before files are written
  try {
    return run(argc, argv);
  } catch (const cairn::Error& error) {
    if (error.code() == cairn::ErrorCode::input && cairn::app::stdout_reader_is_gone()) return 0;
    print_error(error.what());
    return static_cast<int>(error.code());
  } catch (const std::bad_alloc&) {
    print_error("out of memory");
    return static_cast<int>(cairn::ErrorCode::numerical);
  } catch (const std::exception& error) {
    print_error(std::string("internal error: ") + error.what() + " (please report it)");
    return kExitBug;
  } catch (...) {
    print_error("internal error: an exception that is no std::exception (please report it)");
    return kExitBug;
  }
}
