// SPDX-License-Identifier: BSD-3-Clause
// What the driver has to notice: ends by a signal where memory runs out, with the wrong exit code
// where an output fails, leaves half a file and a temporary one, and forgets a second output.
//
// With the word "online" it answers lines as cairn does, and acknowledges each before it is in the
// journal, or saved; what the journal has when it starts it forgets. It needs more memory with
// each line, knows no signals, and takes no notice of a full disk.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

namespace {

bool write_half_of(const char* name, const char* text) {
  const int file = ::open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  const bool written = file >= 0 && ::write(file, text, 4) == 4 && ::write(file, text + 4, 4) == 4;
  if (file >= 0) ::close(file);
  return written;
}

void append(int file, const std::string& text) {
  if (::write(file, text.data(), text.size()) < 0) std::_Exit(0);  // as if all was well
}

/// The number of the last record of the journal.
int last_number() {
  std::ifstream journal("run.journal");
  int last = 0;
  std::string checksum, number;
  for (std::string line; std::getline(journal, line);) {
    std::istringstream(line) >> checksum >> number;
    last = number.empty() ? 0 : std::atoi(number.c_str());
  }
  return last;
}

/// Answers lines, and keeps only the number of those that this process has taken.
class Session {
 public:
  explicit Session(bool keeps_journal) {
    if (!keeps_journal) return;
    number_ = last_number();
    journal_ = ::open("run.journal", O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (number_ == 0) append(journal_, "journal\n");
    append(STDOUT_FILENO, "RESTORED " + std::to_string(number_) + "\n");
  }

  void take(const std::string& line) {
    const bool asks = line == "CHI2" || line == "ESTIMATE ALL" || line == "QUIT";
    taken_ += asks ? 0 : 1;
    if (asks) append(STDOUT_FILENO, "CHI2 " + std::to_string(taken_) + "\n");
    append(STDOUT_FILENO, "OK " + std::to_string(++number_) + "\n");
    if (!asks) pending_ += "00000000 " + std::to_string(number_) + " " + line + "\n";
    if (line.starts_with("SAVE ")) write_half_of(line.c_str() + 5, "12345678");
    if (number_ % 40 == 0) commit();
    leaks_.emplace_back(5000, 'x');
  }

  void end() {
    commit();
    if (journal_ < 0) return;
    ::close(journal_);
    write_half_of("map.g2o", (std::to_string(taken_) + " lines").c_str());
  }

 private:
  void commit() {
    if (journal_ >= 0) append(journal_, pending_);
    pending_.clear();
  }

  int number_ = 0, taken_ = 0, journal_ = -1;
  std::string pending_;
  std::vector<std::string> leaks_;
};

int converse(bool keeps_journal) {
  Session session(keeps_journal);
  for (std::string line; std::getline(std::cin, line) && !std::cin.eof();) session.take(line);
  session.end();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words[0] == "online")
    return converse(std::ranges::find(words, "--journal") != words.end());
  const auto numbers = std::vector<int>(100, 1);  // no handler: std::terminate
  void* memory = std::malloc(numbers.size());
  if (!memory) return 0;  // as if all was written
  std::free(memory);
  if (!write_half_of("temporary.txt", "12345678")) return 1;
  ::unlink("temporary.txt");
  if (!write_half_of("result.txt", "12345678")) {
    std::fputs("cairn: result.txt: cannot be written\n", stderr);
    return 3;
  }
  return write_half_of("second.txt", "12345678") ? 0 : 3;
}
