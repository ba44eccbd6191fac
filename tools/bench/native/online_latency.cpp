// SPDX-License-Identifier: BSD-3-Clause
// What the socket of `cairn online --listen` adds to the time of an update: the same stream through
// a LineSession in this process, and through the service with clients that follow; a table of both.
//
//   cairn_online_latency [POSES] [FOLLOWERS] [ROUNDS] [PAUSE]     default: 2000 20 5 0
//
// PAUSE: milliseconds between an answer and the next update, of a robot that does something else.
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/online/conversation.hpp"
#include "cairn/online/online_session.hpp"
#include "cairn/plugin/registry.hpp"

namespace cairn::performance {
namespace {

using Clock = std::chrono::steady_clock;
using Microseconds = std::chrono::duration<double, std::micro>;
using Pause = std::chrono::milliseconds;

/// A line or two, answered by the last.
using Update = std::string;

/// A robot that drives in circles of 100 poses, and closes a loop at every fifth pose.
std::vector<Update> stream_of_circles(int poses) {
  constexpr int kCircle = 100;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.02);
  const auto edge = [&](int a, int b, double x, double theta) {
    return fmt::format("EDGE_SE2 {} {} {} {} {} 2500 0 0 2500 0 2500\n", a, b, x + noise(random),
                       noise(random), theta + noise(random));
  };
  std::vector<Update> updates;
  for (int k = 1; k < poses; ++k) {
    updates.push_back(fmt::format("NEW VERTEX_SE2 {}\n", k) +
                      edge(k - 1, k, 1.0, 2.0 * std::numbers::pi / kCircle));
    if (k >= kCircle && k % 5 == 0) updates.push_back(edge(k - kCircle, k, 0.0, 0.0));
  }
  return updates;
}

constexpr const char* kFirst = "VERTEX_SE2 0 0 0 0\nFIX 0\n";

/// Microseconds of each update, with a pause before each.
std::vector<double> in_process(const std::vector<Update>& updates, Pause pause) {
  Registry registry;
  const auto estimator = registry.make<Estimator>("incremental_cholesky");
  const auto format = registry.make<StreamFormat>("g2o");
  OnlineSession session(*estimator, *format, registry, {});
  Conversation conversation(session);
  const auto take = [&](const std::string& lines) {
    for (std::size_t begin = 0; begin < lines.size();) {
      const std::size_t end = lines.find('\n', begin);
      (void)conversation.take(lines.substr(begin, end - begin));
      begin = end + 1;
    }
  };
  take(kFirst);
  std::vector<double> times;
  for (const Update& update : updates) {
    if (pause > Pause::zero()) std::this_thread::sleep_for(pause);
    const Clock::time_point begin = Clock::now();
    take(update);
    times.push_back(Microseconds(Clock::now() - begin).count());
  }
  return times;
}

class Client {
 public:
  explicit Client(const std::string& file) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, file.c_str(), sizeof address.sun_path - 1);
    descriptor_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    for (int k = 0;
         ::connect(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0;
         ++k) {
      if (k == 1000) throw std::runtime_error("the service does not listen");
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { ::close(descriptor_); }

  void send(const std::string& text) const {
    if (::send(descriptor_, text.data(), text.size(), MSG_NOSIGNAL) != std::ssize(text))
      throw std::runtime_error("the service has ended");
  }
  /// Reads the rest of an answer of this stream, whose last line begins with "OK".
  void read_answer() {
    std::string answer;
    for (char more[4096]; answer.empty() || answer.back() != '\n' ||
                          answer.compare(last_line(answer), 3, "OK ") != 0;) {
      const ssize_t count = ::read(descriptor_, more, sizeof more);
      if (count <= 0) throw std::runtime_error("the service has ended");
      answer.append(more, static_cast<std::size_t>(count));
    }
  }
  /// Reads to the end of the connection; how many lines "OK" there were.
  int count_updates() const {
    std::string text;
    for (char more[1 << 16];;) {
      const ssize_t count = ::read(descriptor_, more, sizeof more);
      if (count <= 0) break;
      text.append(more, static_cast<std::size_t>(count));
    }
    int updates = 0;
    for (std::size_t at = 0; (at = text.find("\nOK ", at)) != std::string::npos; ++at) ++updates;
    return updates;
  }

 private:
  static std::size_t last_line(const std::string& text) {
    const std::size_t end = text.rfind('\n', text.size() - 2);
    return end == std::string::npos ? 0 : end + 1;
  }
  int descriptor_ = -1;
};

std::vector<double> through_socket(const std::vector<Update>& updates, int followers, Pause pause,
                                   const std::filesystem::path& program) {
  const std::string file =
      (std::filesystem::temp_directory_path() / fmt::format("cairn-latency-{}", ::getpid()))
          .string();
  const pid_t service = ::fork();
  if (service == 0) {
    ::execl(program.c_str(), "cairn", "online", "--quiet", "--listen", file.c_str(), nullptr);
    ::_exit(127);
  }
  std::vector<double> times;
  {
    Client writer(file);
    std::vector<std::thread> readers;
    for (int k = 0; k < followers; ++k) {
      readers.emplace_back([&file, &updates] {
        Client follower(file);
        follower.send("FOLLOW\n");
        if (follower.count_updates() + 5 < std::ssize(updates))
          fmt::print(stderr, "a follower has missed updates\n");
      });
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    writer.send(kFirst);
    for (const Update& update : updates) {
      if (pause > Pause::zero()) std::this_thread::sleep_for(pause);
      const Clock::time_point begin = Clock::now();
      writer.send(update);
      writer.read_answer();
      times.push_back(Microseconds(Clock::now() - begin).count());
    }
    ::kill(service, SIGTERM);
    for (std::thread& reader : readers) reader.join();
  }
  ::waitpid(service, nullptr, 0);
  return times;
}

double percentile(std::vector<double> times, double p) {
  std::ranges::sort(times);
  return times[static_cast<std::size_t>(p * static_cast<double>(times.size() - 1))];
}

void print(const char* where, const std::vector<double>& times) {
  fmt::print("| {} | {} | {:.0f} | {:.0f} | {:.0f} |\n", where, times.size(),
             percentile(times, 0.5), percentile(times, 0.99), percentile(times, 0.999));
}

}  // namespace
}  // namespace cairn::performance

int main(int argc, char** argv) {
  using namespace cairn::performance;
  const auto number = [&](int k, int otherwise) {
    return argc > k ? std::atoi(argv[k]) : otherwise;
  };
  const int poses = number(1, 2000), followers = number(2, 20), rounds = number(3, 5);
  const Pause pause(number(4, 0));
  if (poses < 2 || followers < 0 || rounds < 1 || pause < Pause::zero()) {
    fmt::print(stderr,
               "usage: cairn_online_latency [POSES] [FOLLOWERS] [ROUNDS] [PAUSE], 2000 20 5 0 by "
               "default\n");
    return 1;
  }
  const std::vector<Update> updates = stream_of_circles(poses);
  const auto program = std::filesystem::canonical("/proc/self/exe").parent_path() / "cairn";
  std::vector<double> inside, outside, fastest_inside, fastest_outside;
  const auto add = [](std::vector<double>& all, std::vector<double>& fastest,
                      const std::vector<double>& times) {
    all.insert(all.end(), times.begin(), times.end());
    if (fastest.empty()) fastest = times;
    for (std::size_t k = 0; k < times.size(); ++k) fastest[k] = std::min(fastest[k], times[k]);
  };
  for (int round = 0; round < rounds; ++round) {  // in turn, so that both meet what else runs
    add(inside, fastest_inside, in_process(updates, pause));
    add(outside, fastest_outside, through_socket(updates, followers, pause, program));
  }
  fmt::print("| update, {} followers | updates | median [us] | 99 % | 99.9 % |\n", followers);
  fmt::print("| --- | ---: | ---: | ---: | ---: |\n");
  print("in process", inside);
  print("through the socket", outside);
  print("in process, fastest of the rounds", fastest_inside);
  print("through the socket, fastest of the rounds", fastest_outside);
  // Update by update: what the longest of them compute is the same in both, and drops out. The
  // fastest may be of different rounds, so single differences may be negative.
  std::vector<double> added = fastest_outside;
  for (std::size_t k = 0; k < added.size(); ++k) added[k] -= fastest_inside[k];
  print("difference of the fastest, by update", added);
  return 0;
}
