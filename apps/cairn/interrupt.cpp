// SPDX-License-Identifier: BSD-3-Clause
#include "interrupt.hpp"

#include <unistd.h>

#include <csignal>
#include <initializer_list>
#include <string_view>

#include "cairn/io/output_file.hpp"

namespace cairn::app {
namespace {

// A signal handler can reach nothing but globals.
std::atomic<bool> interrupt_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free, "else a signal handler may not touch it");

/// Only what may be called where a signal has interrupted anything: nothing is allocated, standard
/// streams are not flushed.
extern "C" void cairn_app_end(int) {
  remove_unfinished_outputs();
  constexpr std::string_view kWords = "cairn: interrupted\n";
  static_cast<void>(!::write(STDERR_FILENO, kWords.data(), kWords.size()));
  ::_exit(kExitInterrupted);
}

extern "C" void cairn_app_on_signal(int signal) {
  if (interrupt_flag.exchange(true)) cairn_app_end(signal);
}

/// One of both signals at a time: a second one waits until the first is handled.
void handle(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM}) sigaddset(&action.sa_mask, signal);
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
}

}  // namespace

void end_on_interrupts() { handle(&cairn_app_end); }

InterruptGuard::InterruptGuard() {
  interrupt_flag.store(false);
  handle(&cairn_app_on_signal);
  end_waiting_for_readers_on(&interrupt_flag);
}

InterruptGuard::~InterruptGuard() {
  end_waiting_for_readers_on(nullptr);
  end_on_interrupts();
}

const std::atomic<bool>& InterruptGuard::flag() const { return interrupt_flag; }

}  // namespace cairn::app
