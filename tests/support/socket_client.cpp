// SPDX-License-Identifier: BSD-3-Clause
#include "support/socket_client.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <utility>

namespace cairn::test {
namespace {

constexpr int kPatience = 120'000;  // [ms]
constexpr std::chrono::milliseconds kPause{2};

}  // namespace

SocketClient::SocketClient(const std::string& file) {
  for (int waited = 0; waited < kPatience; waited += static_cast<int>(kPause.count())) {
    if (std::optional<SocketClient> client = try_connect(file)) {
      std::swap(descriptor_, client->descriptor_);
      return;
    }
    std::this_thread::sleep_for(kPause);
  }
  throw std::runtime_error("nobody listens on " + file);
}

std::optional<SocketClient> SocketClient::try_connect(const std::string& file) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (file.size() >= sizeof address.sun_path) throw std::runtime_error("too long: " + file);
  std::memcpy(address.sun_path, file.c_str(), file.size() + 1);
  SocketClient client;
  client.descriptor_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (client.descriptor_ < 0) throw std::runtime_error("no socket");
  if (::connect(client.descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof address) !=
      0)
    return std::nullopt;
  return client;
}

SocketClient::SocketClient(SocketClient&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), unread_(std::move(other.unread_)) {}

SocketClient::~SocketClient() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool SocketClient::tell(std::string_view line) { return tell_bytes(std::string(line) + '\n'); }

bool SocketClient::tell_bytes(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

std::optional<std::string> SocketClient::hear() {
  std::size_t end = 0;
  while ((end = unread_.find('\n')) == std::string::npos) {
    pollfd waiting{descriptor_, POLLIN, 0};
    if (::poll(&waiting, 1, kPatience) == 0) throw std::runtime_error("no answer");
    char more[1 << 14];
    const ssize_t count = ::read(descriptor_, more, sizeof more);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return std::nullopt;
    unread_.append(more, static_cast<std::size_t>(count));
  }
  std::string line = unread_.substr(0, end);
  unread_.erase(0, end + 1);
  return line;
}

std::vector<std::string> SocketClient::ask(std::string_view line) {
  tell(line);
  return hear_answer();
}

std::vector<std::string> SocketClient::hear_answer() {
  std::vector<std::string> answer;
  while (std::optional<std::string> line = hear()) {
    answer.push_back(std::move(*line));
    if (ends_answer(answer.back())) break;
  }
  return answer;
}

void SocketClient::end_input() { ::shutdown(descriptor_, SHUT_WR); }

bool ends_answer(std::string_view line) {
  static constexpr std::array<std::string_view, 8> kLast{
      "OK", "SINGULAR", "UNCONVERGED", "ERROR", "WRITER", "FOLLOWS", "OFF", "CLOSED"};
  return std::ranges::find(kLast, line.substr(0, line.find(' '))) != kLast.end();
}

}  // namespace cairn::test
