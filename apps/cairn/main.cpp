// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "cairn/io/output_file.hpp"
#include "cairn/program/graph_files.hpp"
#include "cairn/program/interrupt.hpp"
#include "cairn/program/option_words.hpp"
#include "cairn/program/session.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "command_line.hpp"

namespace {

constexpr int kExitBug = 1;
constexpr const char* kOutOfMemory = "out of memory";

/// Without most of words that are longer than any name or path: what a file or an argument has
/// instead of one is repeated in messages.
std::string cut_words(const std::string& message) {
  constexpr std::size_t kLongest = 5000, kShown = 100;  // [bytes]; a path has 4096 at most
  std::string cut;
  for (std::size_t at = 0; at < message.size();) {
    const std::size_t end = std::min(message.find_first_of(" \n", at), message.size());
    const bool whole = end - at <= kLongest;
    cut += message.substr(at, whole ? end - at : kShown);
    if (!whole) cut += "...";
    if (end < message.size()) cut += message[end];
    at = end + 1;
  }
  return cut;
}

/// One line on standard error, whatever the message looked like; only a table, whose lines are
/// indented by four columns, keeps its lines.
void print_error(std::string message) {
  message = cairn::app::in_command_line_words(cut_words(message));
  const bool table = message.find("\n    ") != std::string::npos;
  for (std::size_t k = 0; !table && (k = message.find('\n', k)) != std::string::npos;) {
    const std::size_t next = message.find_first_not_of(" \n", k);
    message.replace(k, (next == std::string::npos ? message.size() : next) - k, "; ");
  }
  std::fprintf(stderr, "cairn: %s\n", cairn::app::printable(message, true).c_str());
}

/// The same where there may be no memory left for it: then the message as it is.
void print_error(const char* message) noexcept {
  try {
    print_error(std::string(message));
  } catch (...) {
    std::fprintf(stderr, "cairn: %s\n", message);
  }
}

void print_bug(const char* what) noexcept {
  std::fprintf(stderr, "cairn: internal error: %s (please report it)\n", what);
}

void print_no_thread(const char* why) noexcept {
  std::fprintf(stderr, "cairn: a thread cannot be started (%s); give fewer with --threads\n", why);
}

int run(std::span<const char* const> words) {
  cairn::app::Session session;
  cairn::app::CommandLine line(session, words);
  const std::function<int()> command = line.parse();
  if (session.common.json != "-") cairn::app::check_file(session.common.json, session);
  return command();
}

/// That the program ends by its own decision.
std::atomic<bool> leaving{false};

/// Ends the process without the destructors of static objects: those of plugins and of the
/// libraries below them may crash or wait for ever, after all work is done.
[[noreturn]] void leave(int code) {
  leaving = true;
  std::fflush(nullptr);
#if defined(CAIRN_SANITIZED) || defined(CAIRN_COVERAGE)
  std::exit(code);  // what was found or counted is written at the end
#else
  std::_Exit(code);
#endif
}

/// That memory ran out, for where the exception that said so cannot be seen any more.
std::atomic<bool> memory_ran_out{false};

[[noreturn]] void note_out_of_memory() {
  memory_ran_out = true;
  throw std::bad_alloc();
}

/// Instead of abort(): memory may end in a thread of a library, or where no exception can pass.
[[noreturn]] void end_badly() {
  cairn::remove_unfinished_outputs();  // which another thread may be writing
  try {
    if (std::current_exception()) throw;
    if (memory_ran_out) throw std::bad_alloc();  // in a function that lets none through
    print_bug("std::terminate");
  } catch (const std::bad_alloc&) {
    print_error(kOutOfMemory);
    std::_Exit(static_cast<int>(cairn::ErrorCode::numerical));
  } catch (const std::exception& error) {
    const std::string_view what = error.what();
    if (what.find("pthread_create") != what.npos) {  // in a thread of oneTBB, which starts others
      print_no_thread(error.what());
      std::_Exit(static_cast<int>(cairn::ErrorCode::numerical));
    }
    print_bug(error.what());
  } catch (...) {
    print_bug("an exception that is not a std::exception");
  }
  std::_Exit(kExitBug);
}

/// `cairn online --listen …`: to be ended is how it ends, from its first moment on. With a journal
/// it may have something to write before.
bool is_service(std::span<char* const> words) {
  const auto given = [&](std::string_view begin) {
    return std::ranges::any_of(
        words, [&](const char* word) { return std::string_view(word).starts_with(begin); });
  };
  return given("online") && given("--listen") && !given("--journal");
}

bool thread_can_be_started() {
  try {
    std::thread([] {}).join();
    return true;
  } catch (const std::system_error&) {
    return false;
  }
}

/// A plugin, or a library below it, called exit() (libgomp does where it cannot start a thread):
/// not all is done, whatever code it gave, and the destructors that come next may wait for ever.
void end_after_foreign_exit() {
  if (leaving) return;
  cairn::remove_unfinished_outputs();
  if (!thread_can_be_started()) {
    print_no_thread("a library has ended the program");
    std::_Exit(static_cast<int>(cairn::ErrorCode::numerical));
  }
  std::fputs("cairn: a plugin, or a library below it, has ended the program\n", stderr);
  std::_Exit(static_cast<int>(cairn::ErrorCode::plugin));
}

/// Descriptors 0 to 2 that were closed are taken: or the first files that are opened would be them,
/// and get what is printed. Using them still fails.
void take_closed_descriptors() {
  for (const int number : {0, 1, 2}) {
    if (::fcntl(number, F_GETFD) < 0 && errno == EBADF)
      static_cast<void>(::open("/dev/null", number == 0 ? O_WRONLY : O_RDONLY));
  }
}

}  // namespace

int main(int argc, char** argv) {
  take_closed_descriptors();
  std::set_new_handler(note_out_of_memory);
  std::set_terminate(end_badly);
  static_cast<void>(std::atexit(end_after_foreign_exit));
  cairn::app::end_on_interrupts(
      is_service({argv, static_cast<std::size_t>(argc)}) ? 0 : cairn::app::kExitInterrupted);
  std::signal(SIGPIPE, SIG_IGN);  // `cairn … | head` is no reason to die before files are written
  std::signal(SIGXFSZ, SIG_IGN);  // the limit of a file's size is an error of its output
  try {
    leave(run({argv, static_cast<std::size_t>(argc)}));
  } catch (const cairn::Error& error) {
    print_error(error.what());
    leave(static_cast<int>(error.code()));
  } catch (const std::bad_alloc&) {
    print_error(kOutOfMemory);
    leave(static_cast<int>(cairn::ErrorCode::numerical));
  } catch (const std::system_error& error) {
    const bool memory = error.code() == std::errc::not_enough_memory;
    if (memory) print_error(kOutOfMemory);
    if (!memory) print_bug(error.what());
    leave(memory ? static_cast<int>(cairn::ErrorCode::numerical) : kExitBug);
  } catch (const std::exception& error) {
    print_bug(error.what());
    leave(kExitBug);
  } catch (...) {
    print_bug("an exception that is not a std::exception");
    leave(kExitBug);
  }
}
