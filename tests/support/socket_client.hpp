// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::test {

/// A client of a Unix domain socket that is talked to by lines. Patient: what takes milliseconds
/// has two minutes.
class SocketClient {
 public:
  /// Connects; waits until somebody listens there. Throws `std::runtime_error`.
  explicit SocketClient(const std::string& file);
  /// None where nobody listens now.
  static std::optional<SocketClient> try_connect(const std::string& file);
  SocketClient(SocketClient&& other) noexcept;
  SocketClient& operator=(SocketClient&&) = delete;
  ~SocketClient();

  /// Sends a line; false where nobody reads it any more.
  bool tell(std::string_view line);
  /// Sends bytes as they are.
  bool tell_bytes(std::string_view bytes);
  /// The next whole line, without its end; none after the last.
  std::optional<std::string> hear();
  /// Sends a line and reads its answer: lines up to that which ends it.
  std::vector<std::string> ask(std::string_view line);
  /// The lines up to that which ends an answer or update; fewer where the connection has ended.
  std::vector<std::string> hear_answer();
  /// No line follows.
  void end_input();
  /// After the last line: bytes without the end of a line.
  const std::string& rest() const { return unread_; }

 private:
  SocketClient() = default;
  int descriptor_ = -1;
  std::string unread_;
};

/// Whether a line ends an answer: OK, SINGULAR, UNCONVERGED, ERROR, WRITER, FOLLOWS, OFF, CLOSED.
bool ends_answer(std::string_view line);

}  // namespace cairn::test
