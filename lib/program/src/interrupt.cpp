// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/program/interrupt.hpp"

#include <unistd.h>

#include <array>
#include <csignal>
#include <string_view>

#include "cairn/io/output_file.hpp"

namespace cairn::app {
namespace {

constexpr std::array kSignals{SIGINT, SIGTERM, SIGHUP};

// A signal handler can reach nothing but globals.
std::atomic<bool> interrupt_flag{false};
std::atomic<int> end_code{kExitInterrupted};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free,
              "else a signal handler may not touch them");

/// Only what may be called where a signal has interrupted anything: nothing is allocated, standard
/// streams are not flushed.
void end_with(int code) {
  remove_unfinished_outputs();
  constexpr std::string_view kWords = "cairn: interrupted\n";
  static_cast<void>(!::write(STDERR_FILENO, kWords.data(), kWords.size()));
  ::_exit(code);
}

extern "C" void cairn_app_end(int) { end_with(end_code.load()); }

/// The first asks for an end with the best result; a second one costs that. But for the end of a
/// terminal, which shells and the kernel both send.
extern "C" void cairn_app_on_signal(int signal) {
  if (interrupt_flag.exchange(true) && signal != SIGHUP) end_with(kExitInterrupted);
}

/// As `nohup` starts programs: the end of a terminal shall not be theirs.
bool ignores_hangups() {
  struct sigaction now {};
  return sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
}

/// One of the signals at a time: a second one waits until the first is handled.
void handle(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int signal : kSignals) sigaddset(&action.sa_mask, signal);
  const bool not_hangups = ignores_hangups();
  for (const int signal : kSignals) {
    if (signal != SIGHUP || !not_hangups) sigaction(signal, &action, nullptr);
  }
}

}  // namespace

void end_on_interrupts(int code) {
  end_code.store(code);
  handle(&cairn_app_end);
}

InterruptGuard::InterruptGuard() {
  interrupt_flag.store(false);
  handle(&cairn_app_on_signal);
  end_waiting_for_readers_on(&interrupt_flag);
}

InterruptGuard::~InterruptGuard() {
  end_waiting_for_readers_on(nullptr);
  handle(&cairn_app_end);
}

const std::atomic<bool>& InterruptGuard::flag() const { return interrupt_flag; }

}  // namespace cairn::app
