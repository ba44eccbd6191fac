// SPDX-License-Identifier: BSD-3-Clause
#include "live_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <thread>
#include <utility>

namespace cairn::soak {
namespace {

using faults::Descriptor;

constexpr int kPatience = 120'000;  // [ms] for what takes milliseconds

std::pair<Descriptor, Descriptor> make_pipe() {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

void never_block(const Descriptor& descriptor) {
  ::fcntl(descriptor.number(), F_SETFL, ::fcntl(descriptor.number(), F_GETFL) | O_NONBLOCK);
}

}  // namespace

LiveProcess::LiveProcess(faults::Launch launch, const std::filesystem::path& errors) {
  auto [stdin_end, in] = make_pipe();
  auto [out, stdout_end] = make_pipe();
  const Descriptor err(errors, O_WRONLY | O_CREAT | O_APPEND);
  process_ = faults::start_process(std::move(launch),
                                   {stdin_end.number(), stdout_end.number(), err.number()});
  in_ = std::move(in);
  out_ = std::move(out);
  never_block(in_);
  never_block(out_);
}

LiveProcess::~LiveProcess() {
  if (process_ < 0) return;
  ::kill(process_, SIGKILL);
  faults::wait_for(process_);
}

/// False where nothing is ready in that time.
bool LiveProcess::wait_until_ready(bool to_write, bool to_read, int milliseconds) {
  pollfd ends[2] = {{to_write ? in_.number() : -1, POLLOUT, 0},
                    {to_read ? out_.number() : -1, POLLIN, 0}};
  const int ready = ::poll(ends, 2, milliseconds);
  return ready > 0 || (ready < 0 && errno == EINTR);
}

/// Reads what is there; false if nothing is.
bool LiveProcess::read_some() {
  char buffer[1 << 16];
  const ssize_t got = out_.is_open() ? ::read(out_.number(), buffer, sizeof buffer) : 0;
  if (got > 0) answers_.append(buffer, static_cast<std::size_t>(got));
  ended_ = ended_ || got == 0;
  return got > 0;
}

bool LiveProcess::write(std::string_view text) {
  while (!text.empty()) {
    const ssize_t put = ::write(in_.number(), text.data(), text.size());
    if (put < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (put > 0) text.remove_prefix(static_cast<std::size_t>(put));
    if (text.empty()) break;
    if (!wait_until_ready(true, out_.is_open() && !ended_, kPatience))
      throw Violated("takes no input");
    read_some();
  }
  return true;
}

std::size_t LiveProcess::write_unheard(std::string_view text, int milliseconds) {
  std::size_t taken = 0;
  while (taken < text.size()) {
    const ssize_t put = ::write(in_.number(), text.data() + taken, text.size() - taken);
    if (put < 0 && errno != EAGAIN && errno != EINTR) break;
    if (put > 0) taken += static_cast<std::size_t>(put);
    if (put < 0 && !wait_until_ready(true, false, milliseconds)) break;
  }
  return taken;
}

bool LiveProcess::next_line(std::string& line) {
  std::size_t end = answers_.find('\n');
  if (end == std::string::npos) {
    while (read_some()) continue;
    end = answers_.find('\n');
  }
  if (end == std::string::npos) return false;
  line = answers_.substr(0, end);
  answers_.erase(0, end + 1);
  return true;
}

bool LiveProcess::read_line(std::string& line, int patience) {
  while (!next_line(line)) {
    if (ended_) return false;
    if (!wait_until_ready(false, true, patience)) throw Violated("gives no answer");
  }
  return true;
}

void LiveProcess::send_signal(int number) const { ::kill(process_, number); }

int LiveProcess::wait() {
  int status = 0;
  for (int waited = 0; ::waitpid(process_, &status, WNOHANG) == 0; waited += 2) {
    if (waited > kPatience) throw Violated("does not end");
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  process_ = -1;
  return status;
}

long LiveProcess::memory() const {
  std::ifstream status("/proc/" + std::to_string(process_) + "/status");
  for (std::string word; status >> word;) {
    long kilobytes = 0;
    if (word == "VmRSS:" && status >> kilobytes) return kilobytes;
  }
  return 0;
}

}  // namespace cairn::soak
