// SPDX-License-Identifier: BSD-3-Clause
#include "support/http_client.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <stdexcept>

#include <fmt/core.h>

namespace cairn::test {
namespace {

sockaddr_in here(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

void connect_to(int socket, std::uint16_t port) {
  constexpr timeval kPatience{120, 0};
  ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  const sockaddr_in address = here(port);
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    throw std::runtime_error("no server there");
}

void send_all(int socket, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) break;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
}

/// More of what the server sends; false: it has closed.
bool receive(int socket, std::string& text) {
  std::array<char, 65536> buffer{};
  const ssize_t got = ::recv(socket, buffer.data(), buffer.size(), 0);
  if (got > 0) text.append(buffer.data(), static_cast<std::size_t>(got));
  return got > 0;
}

HttpAnswer answer_of(const std::string& text) {
  HttpAnswer answer;
  const std::size_t end = text.find("\r\n\r\n");
  if (end == std::string::npos) return answer;
  answer.head = text.substr(0, end);
  answer.body = text.substr(end + 4);
  answer.status = std::atoi(answer.head.substr(answer.head.find(' ') + 1).c_str());
  return answer;
}

class Socket {
 public:
  Socket() : number_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (number_ < 0) throw std::runtime_error("no socket");
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() { ::close(number_); }
  int number() const { return number_; }

 private:
  int number_;
};

}  // namespace

HttpAnswer http_exchange(std::uint16_t port, std::string_view bytes) {
  const Socket socket;
  try {
    connect_to(socket.number(), port);
  } catch (const std::runtime_error&) {
    return {};
  }
  send_all(socket.number(), bytes);
  std::string text;
  while (receive(socket.number(), text)) {
  }
  return answer_of(text);
}

HttpAnswer http_get(std::uint16_t port, std::string_view target) {
  return http_exchange(port, fmt::format("GET {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n"
                                         "Connection: close\r\n\r\n",
                                         target, port));
}

HttpConnection::HttpConnection(std::uint16_t port)
    : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  connect_to(socket_, port);
}
HttpConnection::~HttpConnection() { ::close(socket_); }

HttpAnswer HttpConnection::get(std::string_view target) {
  send_all(socket_, fmt::format("GET {} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", target));
  std::string text;
  while (receive(socket_, text)) {
    const HttpAnswer answer = answer_of(text);
    const std::size_t length = answer.head.find("Content-Length: ");
    if (length == std::string::npos) continue;
    const int bytes = std::atoi(answer.head.substr(length + 16).c_str());
    if (answer.body.size() >= static_cast<std::size_t>(bytes)) return answer;
  }
  return {};
}

std::uint16_t free_port() {
  const Socket socket;
  sockaddr_in address = here(0);
  socklen_t size = sizeof address;
  if (::bind(socket.number(), reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
      ::getsockname(socket.number(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
    throw std::runtime_error("no port is free");
  return ntohs(address.sin_port);
}

}  // namespace cairn::test
