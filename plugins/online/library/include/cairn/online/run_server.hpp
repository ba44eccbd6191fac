// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/runtime/api.hpp"

namespace cairn {

/// Shows a run that goes on to browsers on this machine: HTTP/1.1 on the loopback address 127.0.0.1
/// alone.
///
///     RunServer server(8080);                       // http://127.0.0.1:8080/
///     server.show(page);
///     ExplorationRecorder recorder("", run, [&](std::string_view line) { server.add(line); });
///     …
///     server.finish();
///
/// `GET /` is the page, `GET /lines?from=N` the lines of the recording from number N on, a few MB
/// at most, as soon as there is one (after 20 s an empty answer). A request whose Host is not this
/// machine's is refused, so that a page of another site can't read the run through a name that
/// resolves to 127.0.0.1; nothing can be sent that changes anything. Every user of this machine can
/// read the run: there is no password.
///
/// A thread of its own serves, so that no browser delays the run. All lines are kept in memory.
class CAIRN_API RunServer {
 public:
  /// Listens from here on; 0: any port that is free. Throws `Error` (usage) where another program
  /// listens there already or the port may not be taken.
  explicit RunServer(std::uint16_t port);
  RunServer(const RunServer&) = delete;
  RunServer& operator=(const RunServer&) = delete;
  /// Closes all connections.
  ~RunServer();

  std::uint16_t port() const;
  /// The page, in HTML.
  void show(std::string page);
  /// The next line, with its line end.
  void add(std::string_view line);
  /// No line follows. Returns once every browser that has asked for lines, and whose connection is
  /// open, has all of them, or after `timeout` [s].
  void finish(double timeout = 3.0);

 private:
  class Service;
  std::unique_ptr<Service> service_;
};

}  // namespace cairn
