// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/run_server.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <exception>
#include <future>
#include <list>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>

#include "accept_loop.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;
using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

constexpr std::chrono::seconds kIdle{60};      // without a request, and for one to be read
constexpr std::chrono::seconds kLongPoll{20};  // until an answer without lines
constexpr std::chrono::milliseconds kCheckOfFollowers{20};
constexpr std::size_t kMostConnections = 64;
constexpr std::size_t kMostOfAnAnswer = std::size_t{4} << 20;  // [bytes], and one line more
constexpr std::uint32_t kMostOfAHeader = 16384;                // [bytes]

/// N of /lines?from=N; none: it is another request.
std::optional<std::size_t> first_line(std::string_view target) {
  constexpr std::string_view kLines = "/lines?from=";
  if (!target.starts_with(kLines)) return std::nullopt;
  const std::string_view number = target.substr(kLines.size());
  std::size_t from = 0;
  const auto [end, problem] = std::from_chars(number.data(), number.data() + number.size(), from);
  if (problem != std::errc{} || end != number.data() + number.size()) return std::nullopt;
  return from;
}

/// "http://localhost:8125/lines?from=0" as its parts; the authority is empty where there is none.
struct Target {
  std::string_view authority, path;
};
Target parts_of(std::string_view target) {
  constexpr std::string_view kScheme = "http://";
  if (!target.starts_with(kScheme)) return {{}, target};
  target.remove_prefix(kScheme.size());
  const std::size_t slash = std::min(target.find('/'), target.size());
  return {target.substr(0, slash), slash < target.size() ? target.substr(slash) : "/"};
}

/// By its name; the port may be another where a tunnel leads here.
bool is_this_machine(std::string_view host) {
  const std::string_view name = host.substr(0, host.rfind(':'));
  return name == "127.0.0.1" || name == "localhost";
}

Response text_response(http::status status, std::string body, const char* type = "text/plain") {
  Response response{status, 11};
  response.set(http::field::content_type, fmt::format("{}; charset=utf-8", type));
  response.body() = std::move(body);
  return response;
}

/// What the thread that serves knows; nothing else touches it.
struct Run {
  std::string page;
  std::vector<std::string> lines;
  bool ended = false;
  bool followed = false;    ///< lines have been asked for
  std::size_t fetched = 0;  ///< the largest number of lines that a browser has received

  /// The lines of one answer, from number `next` on, which becomes that of the next answer.
  std::string from(std::size_t& next) const {
    std::string text;
    for (; next < lines.size() && text.size() < kMostOfAnAnswer; ++next) text += lines[next];
    return text;
  }
};

/// A browser's connection, which handlers that wait for its socket own, too.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, Run& run)
      : stream_(std::move(socket)), run_(run), patience_(stream_.get_executor()) {}

  void read() {
    parser_.emplace();
    parser_->header_limit(kMostOfAHeader);
    parser_->body_limit(0);
    stream_.expires_after(kIdle);
    reading_ = true;
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](const error_code& error, std::size_t) {
                       self->reading_ = false;
                       if (is_of_a_request(error)) return self->refuse_request();
                       if (error) return self->close();
                       self->answer();
                     });
  }
  /// There are new lines, or there will be none.
  void look() {
    if (waits_for_) send_lines(*std::exchange(waits_for_, std::nullopt));
  }
  void close() {
    error_code ignored;
    patience_.cancel();
    stream_.socket().shutdown(tcp::socket::shutdown_both, ignored);
    stream_.socket().close(ignored);
    closed_ = true;
  }
  bool is_closed() const { return closed_; }
  /// Nothing is owed to its browser, which has not asked for anything yet, or not again.
  bool is_idle() const { return reading_ && !closed_; }
  /// Its browser has asked for lines and has not received all that there are.
  bool is_behind() const {
    return follows_ && !closed_ && (sending_ || received_ < run_.lines.size());
  }

 private:
  /// That what came is no HTTP, or too long, instead of that nothing more came.
  static bool is_of_a_request(const error_code& error) {
    return error && error.category() == make_error_code(http::error::bad_method).category() &&
           error != http::error::end_of_stream && error != http::error::partial_message;
  }
  void refuse_request() {
    send(text_response(http::status::bad_request, "not a request\n"), false);
  }

  void answer() {
    const Request& request = parser_->get();
    const std::string_view asked = request.target();
    const auto [authority, target] = parts_of(asked);
    if (request.count(http::field::host) > 1)
      return send(text_response(http::status::bad_request, "more than one Host\n"));
    if (!is_this_machine(request[http::field::host]) ||
        (!authority.empty() && !is_this_machine(authority)))
      return send(text_response(http::status::forbidden, "not for another host\n"));
    const bool head = request.method() == http::verb::head;
    if (!head && request.method() != http::verb::get)
      return send(text_response(http::status::method_not_allowed, "only GET and HEAD\n"));
    if (target == "/") return send(text_response(http::status::ok, run_.page, "text/html"));
    const std::optional<std::size_t> from = first_line(target);
    if (!from)
      return send(text_response(http::status::not_found, "there are / and /lines?from=N\n"));
    if (head) return send(text_response(http::status::ok, "", "application/x-ndjson"));
    // A number beyond the end is of a page of another run, which has none of these lines.
    if (*from <= run_.lines.size()) follows_ = run_.followed = true;
    if (*from < run_.lines.size() || run_.ended) return send_lines(*from);
    waits_for_ = from;
    stream_.expires_never();
    patience_.expires_after(kLongPoll);
    patience_.async_wait([self = shared_from_this()](const error_code& cancelled) {
      if (!cancelled) self->look();
    });
  }

  void send_lines(std::size_t from) {
    patience_.cancel();
    const bool is_of_this_run = from <= run_.lines.size();
    std::string text = run_.from(from);
    if (is_of_this_run) sent_ = from;
    send(text_response(http::status::ok, std::move(text), "application/x-ndjson"));
  }

  void send(Response response) { send(std::move(response), parser_->get().keep_alive()); }
  void send(Response response, bool keep_alive) {
    response_ = std::move(response);
    response_.set(http::field::cache_control, "no-store");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.keep_alive(keep_alive);
    response_.prepare_payload();
    sending_ = true;
    stream_.expires_after(kIdle);
    auto sent = [self = shared_from_this()](const error_code& error, std::size_t) {
      self->sending_ = false;
      if (error) return self->close();
      self->received_ = self->sent_;
      self->run_.fetched = std::max(self->run_.fetched, self->received_);
      if (self->response_.keep_alive()) return self->read();
      self->close();
    };
    if (parser_->get().method() != http::verb::head)
      return http::async_write(stream_, response_, std::move(sent));
    head_.emplace(response_);
    http::async_write_header(stream_, *head_, std::move(sent));
  }

  beast::tcp_stream stream_;
  Run& run_;
  asio::steady_timer patience_;
  beast::flat_buffer buffer_{kMostOfAHeader};
  std::optional<http::request_parser<http::empty_body>> parser_;
  Response response_;
  std::optional<http::response_serializer<http::string_body>> head_;  // of what has no body
  std::optional<std::size_t> waits_for_;
  std::size_t sent_ = 0, received_ = 0;  // lines, counted from the first of the run
  bool follows_ = false, reading_ = false, sending_ = false, closed_ = false;
};

[[noreturn]] void fail(std::uint16_t port, const error_code& error) {
  const bool taken = error == asio::error::address_in_use;
  throw Error(ErrorCode::usage,
              fmt::format("port {} of 127.0.0.1 cannot be served: {}; take another one, or 0 for "
                          "any that is free",
                          port, taken ? "another program does so" : error.message()));
}

/// Listens on the loopback address; `taken` is the port, also where `port` is 0.
tcp::acceptor listening(asio::io_context& io, std::uint16_t port, std::uint16_t& taken) {
  const tcp::endpoint here(asio::ip::address_v4::loopback(), port);
  tcp::acceptor acceptor(io);
  error_code error;
  acceptor.open(here.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(here, error);
  if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
  if (error) fail(port, error);
  taken = acceptor.local_endpoint().port();
  return acceptor;
}

}  // namespace

class RunServer::Service {
 public:
  explicit Service(std::uint16_t port)
      : clients_(io_, listening(io_, port, port_)), next_check_(io_) {
    clients_.start([this](tcp::socket socket) { welcome(std::move(socket)); });
    thread_ = std::thread([this] { run(); });
  }
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;
  ~Service() {
    io_.stop();
    thread_.join();
  }

  std::uint16_t port() const { return port_; }
  void show(std::string page) {
    asio::post(io_, [this, page = std::move(page)]() mutable { run_.page = std::move(page); });
  }
  void add(std::string_view line) {
    asio::post(io_, [this, line = std::string(line)]() mutable {
      run_.lines.push_back(std::move(line));
      look();
    });
  }
  void finish(double timeout) {
    const auto until = std::chrono::steady_clock::now() +
                       std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                           std::chrono::duration<double>(timeout));
    const auto fetched = std::make_shared<std::promise<void>>();  // which may be set after return
    asio::post(io_, [this, until, fetched] {
      run_.ended = true;
      look();
      wait_for_followers(until, fetched);
    });
    fetched->get_future().wait_until(until + kCheckOfFollowers);
  }

 private:
  using Signal = std::shared_ptr<std::promise<void>>;

  void run() {
    while (!io_.stopped()) {
      try {
        io_.run();
      } catch (const std::exception&) {  // no memory for an answer: that one is not given
      }
    }
  }
  void welcome(tcp::socket socket) {
    connections_.remove_if([](const auto& connection) { return connection->is_closed(); });
    if (connections_.size() >= kMostConnections) make_room();
    if (connections_.size() >= kMostConnections) return;  // closed with the socket
    connections_.push_back(std::make_shared<Connection>(std::move(socket), run_));
    connections_.back()->read();
  }
  /// Who connects and asks for nothing must not keep others out: the oldest of these is closed.
  void make_room() {
    const auto idle = std::ranges::find_if(
        connections_, [](const auto& connection) { return connection->is_idle(); });
    if (idle == connections_.end()) return;
    (*idle)->close();
    connections_.erase(idle);
  }
  void look() {
    for (const auto& connection : connections_) connection->look();
  }
  /// Sets `fetched` once all browsers that have asked for lines have all of them. Of those that
  /// have closed their connection since, which may ask again on another, one must have them all.
  void wait_for_followers(std::chrono::steady_clock::time_point until, const Signal& fetched) {
    const bool behind = std::ranges::any_of(
        connections_, [](const auto& connection) { return connection->is_behind(); });
    const bool done = !run_.followed || (run_.fetched >= run_.lines.size() && !behind);
    if (done || std::chrono::steady_clock::now() >= until) return fetched->set_value();
    next_check_.expires_after(kCheckOfFollowers);
    next_check_.async_wait(
        [this, until, fetched](const error_code&) { wait_for_followers(until, fetched); });
  }

  asio::io_context io_{1};
  Run run_;
  std::uint16_t port_ = 0;
  AcceptLoop<tcp> clients_;
  asio::steady_timer next_check_;
  std::list<std::shared_ptr<Connection>> connections_;
  std::thread thread_;
};

RunServer::RunServer(std::uint16_t port) : service_(std::make_unique<Service>(port)) {}
RunServer::~RunServer() = default;

std::uint16_t RunServer::port() const { return service_->port(); }
void RunServer::show(std::string page) { service_->show(std::move(page)); }
void RunServer::add(std::string_view line) { service_->add(line); }
void RunServer::finish(double timeout) { service_->finish(timeout); }

}  // namespace cairn
