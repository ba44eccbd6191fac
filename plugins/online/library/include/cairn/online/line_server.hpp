// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "cairn/online/conversation.hpp"
#include "cairn/runtime/api.hpp"

namespace cairn {

struct LineServerSettings {
  /// [bytes] of answers that a client has not read: above it no more of its lines are read, and
  /// updates that it follows are dropped. An answer larger than this is sent all the same.
  std::size_t max_unread = std::size_t{8} << 20;
  std::size_t max_line = std::size_t{16} << 20;  ///< [bytes]
  std::size_t max_clients = 256;
  double farewell = 1.0;  ///< [s] at the end, for clients to read what was answered
  /// What a client gets to read of a refusal; null: the text as it is.
  std::function<std::string(std::string)> rephrase = nullptr;
};

/// A conversation over a Unix domain socket: one client sends what changes the estimate, any number
/// ask and follow (docs/online.md, "As a service").
///
///     LineServer server("/run/cairn/robot.socket", conversation, {});
///     server.serve(interrupted);  // returns once that is true
///     conversation.finish();
///
/// One thread does everything, since an estimator answers one call at a time. No client is waited
/// for: sockets do not block, and what a client has not read is bounded. Where lines of several
/// clients are there, those of the writer alternate with those of the others, so that an update
/// waits for one question at most. What an answer consists of is sent as a whole.
class CAIRN_API LineServer {
 public:
  struct Counts {
    std::int64_t clients = 0;       ///< that connected
    std::int64_t most_clients = 0;  ///< at a time
    std::int64_t writers = 0;       ///< clients that became the writer
    std::int64_t updates = 0;       ///< sent to those who follow
    std::int64_t dropped = 0;       ///< updates not sent, since too much was unread
  };

  /// Listens from here on; clients are served by `serve`. The socket's file has the permissions
  /// 0600, and replaces one that nothing listens on. `conversation` outlives this object. Throws
  /// `Error` (usage) if another process listens there already, the file is something else or its
  /// name too long, and `Error` (input) if it cannot be made.
  LineServer(const std::filesystem::path& file, Conversation& conversation,
             LineServerSettings settings);
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;
  /// Removes the file, unless it is another by now.
  ~LineServer();

  /// Until `stop`, checked after each line and ten times per second: lines that are not
  /// answered by then have no effect. What the conversation throws ends it as well.
  void serve(const std::atomic<bool>& stop);

  const Counts& counts() const;

  /// The first words of lines that only a service has: WRITE, FOLLOW and JSON.
  static std::span<const std::string> words();

 private:
  class Service;
  std::unique_ptr<Service> service_;
};

}  // namespace cairn
