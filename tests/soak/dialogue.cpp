// SPDX-License-Identifier: BSD-3-Clause
#include "dialogue.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

namespace cairn::soak {
namespace {

constexpr int kUnheard = 30;  // [ms] in which a process takes nothing: it waits for a reader
constexpr int kRestoring = 3'600'000;  // [ms] as long as all lines took

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

}  // namespace

long Ledger::sent(std::string text, bool changes) {
  open_.push_back({++last_, std::move(text), changes});
  return last_;
}

void Ledger::confirm(const Sent& line) {
  if (!line.changes) return;
  safe_ = line.number;
  ++lines_;
  if (confirmed_) confirmed_(line.text);
}

void Ledger::acknowledged(long number) {
  if (number > last_) throw Violated("line " + std::to_string(number) + " was not sent");
  for (; !open_.empty() && open_.front().number <= number; open_.pop_front())
    confirm(open_.front());
}

std::vector<std::string> Ledger::restored(long number) {
  if (number < safe_) {
    throw Violated("line " + std::to_string(safe_) +
                   " was acknowledged, and is not in the journal, which ends with " +
                   std::to_string(number));
  }
  const auto is_it = [&](const Sent& line) { return line.number == number && line.changes; };
  if (number != safe_ && std::ranges::none_of(open_, is_it))
    throw Violated("the journal ends with line " + std::to_string(number) + ", which is none");
  acknowledged(number);
  std::vector<std::string> rest;
  for (const Sent& line : open_) {
    if (line.changes) rest.push_back(line.text);
  }
  open_.clear();
  last_ = number;
  return rest;
}

Dialogue::Dialogue(faults::Launch launch, std::filesystem::path errors,
                   Ledger::OnConfirmed confirmed)
    : launch_(std::move(launch)), errors_(std::move(errors)), ledger_(std::move(confirmed)) {}

std::vector<std::string> Dialogue::restore() {
  start();
  std::string line, word;
  long number = 0;
  if (!process_->read_line(line, kRestoring)) throw Violated("is not restored");
  if (!(std::istringstream(line) >> word >> number) || word != "RESTORED")
    throw Violated("is not restored: " + line);
  return ledger_.restored(number);
}

long Dialogue::take(const std::string& answer) {
  std::istringstream words(answer);
  std::string word;
  long number = 0;
  words >> word >> number;
  if (word == "ERROR" || word == "SINGULAR") throw Violated(answer);
  if (word != "OK" && word != "UNCONVERGED") return 0;
  ledger_.acknowledged(number);
  return number;
}

bool Dialogue::send(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) ledger_.sent(line, true);
  const bool taken = process_->write(joined(lines));
  for (std::string answer; process_->next_line(answer);) take(answer);
  return taken;
}

void Dialogue::send_unheard(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) ledger_.sent(line, true);
  const std::string text = joined(lines);
  const std::size_t taken = process_->write_unheard(text, kUnheard);
  if (!process_->write(std::string_view(text).substr(taken)))
    throw Violated("ends while its answers are not read");
}

std::string Dialogue::ask(const std::string& question) {
  const long number = ledger_.sent(question, false);
  std::string text;
  process_->write(question + "\n");
  for (std::string answer; process_->read_line(answer);) {
    const long acknowledged = take(answer);
    if (acknowledged == number) return text;
    text = acknowledged == 0 ? text + answer + "\n" : "";
  }
  throw Violated("ends instead of answering " + question);
}

int Dialogue::finish() {
  return process_->finish([&](const std::string& answer) { take(answer); });
}

}  // namespace cairn::soak
