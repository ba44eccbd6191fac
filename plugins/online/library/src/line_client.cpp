// SPDX-License-Identifier: BSD-3-Clause
#include "line_client.hpp"

#include <array>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include <boost/asio/buffer.hpp>

namespace cairn {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

constexpr std::size_t kReadAtOnce = std::size_t{64} << 10;  // [bytes]
constexpr std::size_t kSendAtOnce = 16;                     // texts

bool would_block(const error_code& error) {
  return error == asio::error::would_block || error == asio::error::try_again ||
         error == asio::error::interrupted;
}

}  // namespace

LineClient::LineClient(Socket socket, Limits limits, const Events& events)
    : socket_(std::move(socket)), limits_(limits), events_(events) {
  socket_.non_blocking(true);
}

void LineClient::start() { wait_for_input(); }

// Lines in ----------------------------------------------------------------------------------------

void LineClient::wait_for_input() {
  if (reading_ || !is_open()) return;
  reading_ = true;
  socket_.async_wait(Socket::wait_read, [self = shared_from_this()](const error_code& error) {
    self->reading_ = false;
    if (!error) self->receive();
  });
}

void LineClient::receive() {
  if (!is_open() || closing_) return;
  std::array<char, kReadAtOnce> more;
  error_code error;
  const std::size_t count = socket_.read_some(asio::buffer(more), error);
  if (error && !would_block(error)) {
    ended_ = true;  // or broken off: what has come is taken
  }
  if (begin_ > 0) input_.erase(0, std::exchange(begin_, 0));
  const std::size_t searched = input_.size();
  input_.append(more.data(), count);
  end_of_line_ = input_.find('\n', searched);
  if ((end_of_line_ == kNone ? input_.size() : end_of_line_) > limits_.max_line) {
    send(fmt::format("ERROR line {}: of more than {} bytes; expected text\n", lines + 1,
                     limits_.max_line));
    return close_when_sent();
  }
  go_on();
}

std::string LineClient::take_line() {
  std::string line(input_, begin_, end_of_line_ - begin_);
  begin_ = end_of_line_ + 1;
  end_of_line_ = input_.find('\n', begin_);
  return line;
}

void LineClient::go_on() {
  if (!is_open() || closing_) return;
  if (is_full()) return;  // goes on when the client has read
  if (end_of_line_ != kNone) {
    events_.ready(shared_from_this());
  } else if (ended_) {
    close_when_sent();
  } else {
    wait_for_input();
  }
}

// Answers out -------------------------------------------------------------------------------------

void LineClient::send(std::string answer) {
  if (!is_open() || unheard_ || answer.empty()) return;
  add(std::move(answer));
  flush();
}

void LineClient::add(std::string answer) {
  const auto& text = output_.emplace_back(std::make_shared<const std::string>(
      wants_json ? json_answer(answer, events_.is_variable_type) : std::move(answer)));
  unread_ += text->size();
}

bool LineClient::enqueue(const Text& text) {
  if (!is_open() || closing_ || unheard_) return false;
  if (is_full() || dropped_ > 0) {
    ++dropped_;
    return false;
  }
  unread_ += text->size();
  output_.push_back(text);
  return true;
}

void LineClient::flush() {
  if (writing_ || !is_open() || !send_some()) return;
  if (!output_.empty()) return wait_for_room();
  if (closing_) close();
}

bool LineClient::send_some() {
  while (!output_.empty()) {
    std::vector<asio::const_buffer> texts;
    for (std::size_t k = 0; k < output_.size() && k < kSendAtOnce; ++k)
      texts.push_back(asio::buffer(*output_[k]) + (k == 0 ? sent_ : 0));
    error_code error;
    std::size_t count = socket_.write_some(texts, error);
    if (would_block(error)) return true;
    if (error) {
      // Nobody reads the answers any more. What the client has sent is taken to its end.
      unheard_ = true;
      output_.clear();
      sent_ = unread_ = 0;
      dropped_ = 0;
      return true;
    }
    unread_ -= count;
    for (count += sent_; !output_.empty() && count >= output_.front()->size();) {
      count -= output_.front()->size();
      output_.pop_front();
    }
    sent_ = count;
    if (dropped_ > 0 && !is_full()) note_dropped();
  }
  return true;
}

void LineClient::note_dropped() {
  const std::int64_t count = std::exchange(dropped_, 0);
  add(
      fmt::format("NOTE {} updates were dropped, since as many were not read; ESTIMATE ALL answers "
                  "with the newest estimate\n",
                  count));
}

void LineClient::wait_for_room() {
  writing_ = true;
  socket_.async_wait(Socket::wait_write, [self = shared_from_this()](const error_code& error) {
    self->writing_ = false;
    if (error) return;
    self->flush();
    self->go_on();
  });
}

void LineClient::close_when_sent() {
  closing_ = true;
  flush();
}

void LineClient::close() {
  if (!is_open()) return;
  error_code ignored;
  socket_.close(ignored);
  events_.gone(shared_from_this());
}

}  // namespace cairn
