// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>

#include <boost/asio/local/stream_protocol.hpp>

#include "cairn/online/json_answer.hpp"

namespace cairn {

/// A connection to a `LineServer`: lines come in, whole answers go out, and nothing is waited for.
/// More is read only when all lines that have come are answered, and the client has read most of
/// the answers.
class LineClient : public std::enable_shared_from_this<LineClient> {
 public:
  using Socket = boost::asio::local::stream_protocol::socket;
  using Text = std::shared_ptr<const std::string>;  // the same for all who follow
  struct Limits {
    std::size_t max_unread, max_line;  // [bytes]
  };
  /// What the client asks its server for.
  struct Events {
    std::function<void(const std::shared_ptr<LineClient>&)> ready;  // `has_line`
    std::function<void(const std::shared_ptr<LineClient>&)> gone;   // once
    IsVariableType is_variable_type;                                // for answers in JSON
  };

  LineClient(Socket socket, Limits limits, const Events& events);

  /// Begins to read. Like the others, it may call `gone` before it returns.
  void start();

  /// Whether a line is there that may be answered now.
  bool has_line() const { return is_open() && !closing_ && end_of_line_ != kNone && !is_full(); }
  /// The next one, without its end; `has_line` must be true.
  std::string take_line();
  /// After the answer to a line: goes on to the next, or reads more.
  void go_on();

  /// Sends an answer, or as much as the socket takes, and the rest as the client reads.
  void send(std::string answer);
  /// Sends it with the next `flush`. Drops it if the client has not read enough; then, once it has,
  /// a NOTE says how many were dropped. Returns whether it was taken.
  bool enqueue(const Text& text);
  /// Sends what was enqueued.
  void flush();
  /// Reads no more, and closes the connection when everything is sent.
  void close_when_sent();
  /// At once.
  void close();
  bool is_open() const { return socket_.is_open(); }

  std::int64_t lines = 0;  // of a client that does not write: those answered
  bool follows = false;
  bool wants_json = false;    // each answer as one JSON object
  bool is_scheduled = false;  // the server will come back to it

 private:
  static constexpr std::size_t kNone = std::string::npos;

  bool is_full() const { return unread_ > limits_.max_unread; }
  void wait_for_input();
  void receive();
  void wait_for_room();
  /// Sends what the socket takes now; false if the connection is broken.
  bool send_some();
  void add(std::string answer);
  void note_dropped();

  Socket socket_;
  const Limits limits_;
  const Events& events_;
  std::string input_;
  std::size_t begin_ = 0;            // of the line that is next
  std::size_t end_of_line_ = kNone;  // kNone: it has not come yet
  std::deque<Text> output_;
  std::size_t sent_ = 0;    // of the first of these
  std::size_t unread_ = 0;  // bytes of all of them
  std::int64_t dropped_ = 0;
  bool reading_ = false, writing_ = false;  // waits for the socket
  bool ended_ = false;                      // the client sends no more
  bool unheard_ = false;                    // and reads no more
  bool closing_ = false;
};

}  // namespace cairn
