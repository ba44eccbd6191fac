// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <utility>

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

namespace cairn {

/// Accepts clients of a socket one after the other. Where there are no more descriptors or there is
/// no more memory it waits a little: clients stay in the queue until some leave.
template <class Protocol>
class AcceptLoop {
 public:
  using Acceptor = boost::asio::basic_socket_acceptor<Protocol>;
  using Socket = typename Protocol::socket;

  /// `acceptor` listens; it and this object live as long as `io` runs.
  AcceptLoop(boost::asio::io_context& io, Acceptor acceptor)
      : acceptor_(std::move(acceptor)), pause_(io) {}

  /// Gives each client to `welcome`, after it has begun to wait for the next: an exception, for
  /// lack of memory, costs that client alone.
  void start(std::function<void(Socket)> welcome) {
    welcome_ = std::move(welcome);
    accept();
  }
  void stop() {
    ended_ = true;
    boost::system::error_code ignored;
    acceptor_.close(ignored);
    pause_.cancel();
  }

 private:
  void accept() {
    acceptor_.async_accept([this](const boost::system::error_code& error, Socket socket) {
      if (ended_ || error == boost::asio::error::operation_aborted) return;
      if (!error || error == boost::asio::error::connection_aborted) {
        accept();
        if (!error) welcome_(std::move(socket));
        return;
      }
      pause_.expires_after(std::chrono::milliseconds(100));
      pause_.async_wait([this](const boost::system::error_code& cancelled) {
        if (!cancelled && !ended_) accept();
      });
    });
  }

  Acceptor acceptor_;
  boost::asio::steady_timer pause_;
  std::function<void(Socket)> welcome_;
  bool ended_ = false;
};

}  // namespace cairn
