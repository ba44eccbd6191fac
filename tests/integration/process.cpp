// SPDX-License-Identifier: BSD-3-Clause
#include "integration/process.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <thread>

#include <boost/json/parse.hpp>

namespace cairn::test {
namespace {

struct Pipe {
  int read_end = -1;
  int write_end = -1;
  Pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    read_end = ends[0];
    write_end = ends[1];
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  ~Pipe() {
    close_read();
    close_write();
  }
  void close_read() { close_end(read_end); }
  void close_write() { close_end(write_end); }

 private:
  static void close_end(int& end) {
    if (end >= 0) ::close(end);
    end = -1;
  }
};

/// In the child, after fork: becomes the command. Never returns.
[[noreturn]] void become(const Arguments& command, const Environment& environment) {
  for (const auto& [name, value] : environment) ::setenv(name.c_str(), value.c_str(), 1);
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  ::execvp(argv[0], argv.data());
  ::_exit(127);
}

int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// Prints what says that a plugin is missing, by which a build without it skips the test.
void show_what_is_missing(const std::string& text) {
  for (const char* sign : {"there is no ", "unknown tag '", "nothing of the name "}) {
    if (const auto at = text.find(sign); at != std::string::npos)
      std::cout << text.substr(at, 200) << std::endl;
  }
}

/// A child with its three streams on pipes.
class Child {
 public:
  Child(const Arguments& command, const Environment& environment) {
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(in_.read_end, STDIN_FILENO);
      ::dup2(out_.write_end, STDOUT_FILENO);
      ::dup2(err_.write_end, STDERR_FILENO);
      become(command, environment);
    }
    in_.close_read();
    out_.close_write();
    err_.close_write();
  }

  void feed(const std::string& input) {
    feed_and_keep_open(input);
    in_.close_write();
  }

  void feed_and_keep_open(const std::string& input) {
    std::size_t done = 0;
    while (done < input.size()) {
      const ssize_t put = ::write(in_.write_end, input.data() + done, input.size() - done);
      if (put <= 0) break;
      done += static_cast<std::size_t>(put);
    }
  }

  /// More of standard output; false at its end.
  bool read_out(std::string& text) { return read_some(out_.read_end, text); }

  void send_signal(int number) { ::kill(pid_, number); }

  void kill() {
    send_signal(SIGKILL);
    wait_for(pid_);
  }

  /// Makes room for input that is fed before anything is read.
  void make_room(std::size_t bytes) {
    ::fcntl(in_.write_end, F_SETPIPE_SZ, static_cast<int>(bytes));
  }

  /// Kills the child once it has written that many lines and `delay` has passed, or when it has
  /// been silent for long.
  Outcome kill_after(int lines, std::chrono::microseconds delay) {
    Outcome outcome;
    while (std::ranges::count(outcome.out, '\n') < lines) {
      pollfd end{out_.read_end, POLLIN, 0};
      const int ready = ::poll(&end, 1, 300);
      if (ready == 0 || (ready > 0 && !read_some(out_.read_end, outcome.out))) break;
    }
    std::this_thread::sleep_for(delay);
    ::kill(pid_, SIGKILL);
    while (read_some(out_.read_end, outcome.out)) {
    }
    while (read_some(err_.read_end, outcome.err)) {
    }
    outcome.exit_code = wait_for(pid_);
    return outcome;
  }

  /// Reads both streams to their ends; sends `signal` when standard error first holds `cue`.
  Outcome finish(const std::string& cue, int signal) {
    Outcome outcome;
    bool sent = cue.empty();
    while (out_.read_end >= 0 || err_.read_end >= 0) {
      std::array<pollfd, 2> ends{{{out_.read_end, POLLIN, 0}, {err_.read_end, POLLIN, 0}}};
      if (::poll(ends.data(), ends.size(), -1) < 0) continue;
      if (ends[0].revents && !read_some(out_.read_end, outcome.out)) out_.close_read();
      if (ends[1].revents && !read_some(err_.read_end, outcome.err)) err_.close_read();
      if (!sent && outcome.err.find(cue) != std::string::npos) {
        ::kill(pid_, signal);
        sent = true;
      }
    }
    outcome.exit_code = wait_for(pid_);
    EXPECT_TRUE(sent) << "the program never said '" << cue << "'; it said: " << outcome.err;
    show_what_is_missing(outcome.err);
    show_what_is_missing(outcome.out);
    return outcome;
  }

 private:
  static bool read_some(int end, std::string& text) {
    char buffer[4096];
    const ssize_t count = ::read(end, buffer, sizeof buffer);
    if (count <= 0) return false;
    text.append(buffer, static_cast<std::size_t>(count));
    return true;
  }

  Pipe in_, out_, err_;
  pid_t pid_ = 0;
};

Arguments with_program(const Arguments& arguments) {
  Arguments command{program()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

}  // namespace

std::string program() { return CAIRN_PROGRAM; }
std::string source_folder() { return CAIRN_SOURCE_FOLDER; }
std::string bad_plugins() { return CAIRN_BAD_PLUGINS; }

Outcome run_program(const Arguments& command, const Environment& environment,
                    const std::string& input) {
  std::signal(SIGPIPE, SIG_IGN);  // a child that reads nothing
  Child child(command, environment);
  child.feed(input);
  return child.finish("", 0);
}

Outcome cairn(const Arguments& arguments, const Environment& environment,
              const std::string& input) {
  return run_program(with_program(arguments), environment, input);
}

Outcome cairn_killed(const Arguments& arguments, const std::string& input, int lines,
                     std::chrono::microseconds delay) {
  std::signal(SIGPIPE, SIG_IGN);
  Child child(with_program(arguments), {});
  child.make_room(std::max<std::size_t>(input.size(), 1u << 16));
  child.feed_and_keep_open(input);
  return child.kill_after(lines, delay);
}

Outcome cairn_interrupted(const Arguments& arguments, const std::string& cue, int signal) {
  Child child(with_program(arguments), {});
  child.feed("");
  return child.finish(cue, signal);
}

struct Partner::Process {
  explicit Process(const Arguments& arguments) : child(with_program(arguments), {}) {}
  Child child;
  std::string unheard;
  bool ended = false;
};

Partner::Partner(const Arguments& arguments) {
  std::signal(SIGPIPE, SIG_IGN);
  process_ = std::make_unique<Process>(arguments);
}

Partner::~Partner() {
  if (!process_->ended) process_->child.kill();
}

void Partner::tell(const std::string& line) { process_->child.feed_and_keep_open(line + "\n"); }

std::optional<std::string> Partner::hear() {
  std::string& unheard = process_->unheard;
  std::size_t end = 0;
  while ((end = unheard.find('\n')) == std::string::npos) {
    if (!process_->child.read_out(unheard)) return std::nullopt;
  }
  std::string line = unheard.substr(0, end);
  unheard.erase(0, end + 1);
  return line;
}

void Partner::send_signal(int number) { process_->child.send_signal(number); }

Outcome Partner::end() {
  process_->child.feed("");
  Outcome outcome = process_->child.finish("", 0);
  process_->ended = true;
  outcome.out = process_->unheard + outcome.out;
  return outcome;
}

Outcome cairn_on_terminal(const Arguments& arguments, const Environment& environment, int columns) {
  int terminal = -1;
  winsize size{};
  size.ws_col = static_cast<unsigned short>(columns);
  const pid_t child = ::forkpty(&terminal, nullptr, nullptr, &size);
  if (child == 0) become(with_program(arguments), environment);
  Outcome outcome;
  char buffer[4096];
  // A terminal whose other side has gone reads as an error, not as an end.
  for (ssize_t count; (count = ::read(terminal, buffer, sizeof buffer)) > 0;) {
    outcome.out.append(buffer, static_cast<std::size_t>(count));
  }
  outcome.exit_code = wait_for(child);
  ::close(terminal);
  show_what_is_missing(outcome.out);
  return outcome;
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "cairn-test-XXXXXX").string();
  if (!::mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<std::string> TemporaryFolder::contents() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(path_)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

boost::json::value parse_json(const std::string& text) {
  boost::json::error_code error;
  boost::json::value value = boost::json::parse(text, error);
  EXPECT_FALSE(error) << "not JSON, or not JSON alone: " << error.message() << "\n" << text;
  return error ? boost::json::value(boost::json::object_kind) : value;
}

std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) all.push_back(line);
  return all;
}

std::string unfolded(const std::string& text) {
  std::string words;
  for (const char c : text) {
    const bool blank = c == ' ' || c == '\n';
    if (!blank || (!words.empty() && words.back() != ' ')) words += blank ? ' ' : c;
  }
  return words;
}

std::size_t columns(const std::string& line) {
  std::size_t count = 0;
  for (std::size_t k = 0; k < line.size(); ++k) {
    if (line[k] == '\x1b') {
      while (k < line.size() && std::isalpha(static_cast<unsigned char>(line[k])) == 0) ++k;
    } else if (line[k] != '\r') {
      count += (static_cast<unsigned char>(line[k]) & 0xc0) != 0x80;
    }
  }
  return count;
}

boost::json::value report_of(Arguments arguments) {
  arguments.insert(arguments.end(), {"--json", "-"});
  const Outcome outcome = cairn(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  return parse_json(outcome.out);
}

std::string WithGraphFile::graph() {
  const std::string file = folder_.file("graph.g2o");
  const Outcome made = cairn({"generate", "manhattan:poses=200", "-o", file, "--seed", "3"});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  return file;
}

}  // namespace cairn::test
