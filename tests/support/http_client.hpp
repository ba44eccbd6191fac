// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cairn::test {

/// What a server at 127.0.0.1 has sent.
struct HttpAnswer {
  int status = 0;  ///< 0: no answer
  std::string head, body;
};

/// Sends bytes and reads until the server closes. Where nobody listens the answer has no status.
HttpAnswer http_exchange(std::uint16_t port, std::string_view bytes);
/// GET, with a Host of this machine.
HttpAnswer http_get(std::uint16_t port, std::string_view target);
/// A connection that is kept open, as browsers keep theirs.
class HttpConnection {
 public:
  explicit HttpConnection(std::uint16_t port);
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;
  ~HttpConnection();
  /// As `http_get`; without status once the server has closed the connection.
  HttpAnswer get(std::string_view target);

 private:
  int socket_;
};
/// A port at which nobody listens, just now.
std::uint16_t free_port();

}  // namespace cairn::test
