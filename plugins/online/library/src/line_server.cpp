// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/online/line_server.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <deque>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include "accept_loop.hpp"
#include "cairn/online/json_answer.hpp"
#include "escaped_bytes.hpp"
#include "line_client.hpp"
#include "socket_file.hpp"

namespace cairn {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using Protocol = asio::local::stream_protocol;
using ClientPtr = std::shared_ptr<LineClient>;  // which handlers that wait for a socket own, too

const std::array<std::string, 3> kWords{"WRITE", "FOLLOW", "JSON"};
constexpr std::size_t kLongestShown = 40;  // [bytes] of a word
constexpr std::chrono::milliseconds kLookAtStop{100};

/// A word of a client, made fit for a message.
std::string shown(std::string_view word) {
  return escaped_bytes(word.substr(0, kLongestShown)) + (word.size() > kLongestShown ? "..." : "");
}

}  // namespace

class LineServer::Service {
 public:
  Service(const std::filesystem::path& file, Conversation& conversation,
          LineServerSettings settings)
      : conversation_(conversation),
        settings_(std::move(settings)),
        file_(file),
        accepting_(io_, Protocol::acceptor(io_, Protocol(), file_.take_descriptor())),
        watch_(io_) {
    events_.ready = [this](const ClientPtr& client) { schedule(client); };
    events_.gone = [this](const ClientPtr& client) {
      // Not here: a caller may be going through the clients.
      asio::post(io_, [this, client] { forget(client); });
    };
    events_.is_variable_type = [this](std::string_view tag) {
      return conversation_.is_variable_type(tag);
    };
  }

  void serve(const std::atomic<bool>& stop) {
    stop_ = &stop;
    accepting_.start([this](Protocol::socket socket) { welcome(std::move(socket)); });
    watch();
    io_.run();
  }

  const Counts& counts() const { return counts_; }

 private:
  // Clients come and go
  void welcome(Protocol::socket socket);
  void forget(const ClientPtr& client);
  void watch();
  void end();

  // Whose turn it is
  void schedule(const ClientPtr& client);
  void call_for_turn();
  void take_turn();

  // Lines
  void answer_line(LineClient& client);
  std::string answer(LineClient& client, const std::string& line);
  std::string answer_write(LineClient& client);
  std::string answer_switch(LineClient& client, std::string_view word, std::string_view line);
  std::string answer_change(LineClient& client, const std::string& line);
  std::string text_of(LineSession::Reply reply) const;
  std::string refusal(LineClient& client, std::string_view what);
  std::string acknowledgement(LineClient& client, std::string_view word);
  void publish(const std::string& text, const LineClient& writer);

  Conversation& conversation_;
  const LineServerSettings settings_;
  Counts counts_;
  LineClient::Events events_;
  const std::atomic<bool>* stop_ = nullptr;
  bool ending_ = false;

  asio::io_context io_{1};
  SocketFile file_;
  AcceptLoop<Protocol> accepting_;
  asio::steady_timer watch_;
  std::unordered_set<ClientPtr> clients_;
  LineClient* writer_ = nullptr;  // one of these
  std::deque<ClientPtr> others_;  // with a line or updates to be sent, in the order of their turns
  bool turn_is_due_ = false, turn_of_others_ = false;
};

// Clients come and go
// -------------------------------------------------------------------------------

void LineServer::Service::welcome(Protocol::socket socket) {
  const auto client = std::make_shared<LineClient>(
      std::move(socket), LineClient::Limits{settings_.max_unread, settings_.max_line}, events_);
  const bool too_many = clients_.size() >= settings_.max_clients;
  clients_.insert(client);
  if (too_many) {
    client->send(fmt::format("ERROR line 0: {} clients are connected, and no more can be\n",
                             settings_.max_clients));
    return client->close_when_sent();
  }
  ++counts_.clients;
  counts_.most_clients = std::max(counts_.most_clients, std::ssize(clients_));
  client->start();
}

void LineServer::Service::forget(const ClientPtr& client) {
  if (writer_ == client.get()) writer_ = nullptr;
  clients_.erase(client);
  if (ending_ && clients_.empty()) watch_.cancel();
}

void LineServer::Service::watch() {
  watch_.expires_after(kLookAtStop);
  watch_.async_wait([this](const error_code& cancelled) {
    if (cancelled || ending_) return;
    *stop_ ? end() : watch();
  });
}

/// No line is taken any more, and what was answered is sent, as far as it is read soon.
void LineServer::Service::end() {
  if (std::exchange(ending_, true)) return;
  accepting_.stop();
  const std::vector<ClientPtr> all(clients_.begin(), clients_.end());
  for (const ClientPtr& client : all) client->close_when_sent();
  if (all.empty()) return void(watch_.cancel());
  watch_.expires_after(std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::duration<double>(settings_.farewell)));
  watch_.async_wait([this](const error_code&) {
    const std::vector<ClientPtr> left(clients_.begin(), clients_.end());
    for (const ClientPtr& client : left) client->close();
  });
}

// Whose turn it is
// ------------------------------------------------------------------------------------

void LineServer::Service::schedule(const ClientPtr& client) {
  if (client.get() != writer_ && !std::exchange(client->is_scheduled, true))
    others_.push_back(client);
  call_for_turn();
}

void LineServer::Service::call_for_turn() {
  if (std::exchange(turn_is_due_, true)) return;
  asio::post(io_, [this] {
    turn_is_due_ = false;
    take_turn();
  });
}

/// A line of the writer, or what one other client needs: what has arrived meanwhile is seen after
/// each.
void LineServer::Service::take_turn() {
  if (ending_) return;
  if (*stop_) return end();
  const bool writer_waits = writer_ && writer_->has_line();
  if (writer_waits && !(turn_of_others_ && !others_.empty())) {
    turn_of_others_ = true;
    answer_line(*writer_);
  } else if (!others_.empty()) {
    turn_of_others_ = false;
    const ClientPtr client = std::move(others_.front());
    others_.pop_front();
    client->is_scheduled = false;
    client->flush();
    client->has_line() ? answer_line(*client) : client->go_on();
  }
  if (!others_.empty() || (writer_ && writer_->has_line())) call_for_turn();
}

// Lines
// -----------------------------------------------------------------------------------------------

void LineServer::Service::answer_line(LineClient& client) {
  const std::string line = client.take_line();
  client.send(answer(client, line));
  client.go_on();
}

std::string LineServer::Service::answer(LineClient& client, const std::string& line) {
  const std::string_view word = LineSession::first_word(line);
  const bool writes = writer_ == &client;
  if (word == "WRITE") return answer_write(client);
  if (word == "FOLLOW" || word == "JSON") return answer_switch(client, word, line);
  if (word == "QUIT") {
    std::string text = acknowledgement(client, "CLOSED");
    client.send(std::move(text));
    client.close_when_sent();
    return {};
  }
  if (writes) return answer_change(client, line);
  if (word.empty()) {
    ++client.lines;
    return {};
  }
  if (LineSession::is_question(word)) {
    return text_of(conversation_.ask(line, ++client.lines));
  }
  if (writer_) {
    return refusal(client,
                   fmt::format("{} is for the client that writes, which is another until it "
                               "disconnects; expected ESTIMATE, COVARIANCE, CHI2, HELP, FOLLOW, "
                               "JSON or QUIT",
                               shown(word)));
  }
  return answer_change(client, line);
}

std::string LineServer::Service::answer_write(LineClient& client) {
  if (writer_ && writer_ != &client)
    return refusal(client, "another client writes, until it disconnects");
  if (!std::exchange(writer_, &client)) ++counts_.writers;
  return acknowledgement(client, "WRITER");
}

/// "FOLLOW", "JSON", or one of them with "OFF".
std::string LineServer::Service::answer_switch(LineClient& client, std::string_view word,
                                               std::string_view line) {
  const std::string_view more = LineSession::first_word(line.substr(line.find(word) + word.size()));
  if (!more.empty() && more != "OFF") {
    return refusal(client, fmt::format("{0} {1}; expected '{0}' or '{0} OFF'", word, shown(more)));
  }
  (word == "FOLLOW" ? client.follows : client.wants_json) = more.empty();
  return acknowledgement(client, !more.empty() ? "OFF" : word == "FOLLOW" ? "FOLLOWS" : "JSON");
}

/// A line of the stream, or the first that a client may become the writer by.
std::string LineServer::Service::answer_change(LineClient& client, const std::string& line) {
  const bool writes = writer_ == &client;
  const LineSession::Reply reply =
      writes ? conversation_.take(line) : conversation_.take_if_it_changes(line);
  if (!writes && reply.changes) {
    writer_ = &client;
    ++counts_.writers;
  }
  if (reply.changes && !reply.text.empty()) publish(reply.text, client);
  return text_of(reply);
}

/// To all who follow: sent when it is their turn, so that the writer need not wait for that.
void LineServer::Service::publish(const std::string& text, const LineClient& writer) {
  LineClient::Text update, update_in_json;  // each for all that want it so
  for (const ClientPtr& client : clients_) {
    if (!client->follows || client.get() == &writer) continue;
    if (!update) {
      update = std::make_shared<const std::string>(
          fmt::format("UPDATE {}\n{}", conversation_.line_number(), text));
    }
    if (client->wants_json && !update_in_json)
      update_in_json =
          std::make_shared<const std::string>(json_answer(*update, events_.is_variable_type));
    const bool taken = client->enqueue(client->wants_json ? update_in_json : update);
    ++(taken ? counts_.updates : counts_.dropped);
    schedule(client);
  }
}

std::string LineServer::Service::text_of(LineSession::Reply reply) const {
  return reply.refused && settings_.rephrase ? settings_.rephrase(std::move(reply.text))
                                             : std::move(reply.text);
}

std::string LineServer::Service::refusal(LineClient& client, std::string_view what) {
  const std::int64_t number = writer_ == &client ? conversation_.line_number() : ++client.lines;
  return fmt::format("ERROR line {}: {}\n", number, what);
}

/// Of what concerns the connection alone, and is no line of the stream.
std::string LineServer::Service::acknowledgement(LineClient& client, std::string_view word) {
  if (writer_ != &client) ++client.lines;
  return conversation_.standing(word);
}

// The server
// --------------------------------------------------------------------------------------------

LineServer::LineServer(const std::filesystem::path& file, Conversation& conversation,
                       LineServerSettings settings)
    : service_(std::make_unique<Service>(file, conversation, std::move(settings))) {}

LineServer::~LineServer() = default;

void LineServer::serve(const std::atomic<bool>& stop) { service_->serve(stop); }

const LineServer::Counts& LineServer::counts() const { return service_->counts(); }

std::span<const std::string> LineServer::words() { return kWords; }

}  // namespace cairn
