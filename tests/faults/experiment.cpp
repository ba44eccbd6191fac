// SPDX-License-Identifier: BSD-3-Clause
#include "experiment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/personality.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace cairn::faults {
namespace {

namespace fs = std::filesystem;

constexpr unsigned kMostSeconds = 60;  // of a run that does some milliseconds of work
constexpr const char* kWhat[] = {"nothing", "allocation", "memory", "thread", "output"};

/// A FaultRecord in a file, shared with the process that fills it.
class SharedRecord {
 public:
  explicit SharedRecord(const fs::path& file) {
    const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const bool sized = descriptor >= 0 && ::ftruncate(descriptor, sizeof(FaultRecord)) == 0;
    memory_ = sized ? ::mmap(nullptr, sizeof(FaultRecord), PROT_READ, MAP_SHARED, descriptor, 0)
                    : MAP_FAILED;
    if (descriptor >= 0) ::close(descriptor);
    if (memory_ == MAP_FAILED) throw std::runtime_error(file.string() + ": " + strerror(errno));
  }
  SharedRecord(const SharedRecord&) = delete;
  SharedRecord& operator=(const SharedRecord&) = delete;
  ~SharedRecord() { ::munmap(memory_, sizeof(FaultRecord)); }
  const FaultRecord& operator*() const { return *static_cast<const FaultRecord*>(memory_); }

 private:
  void* memory_;
};

/// In the child: a descriptor on that file instead of descriptor `number`.
void redirect(int number, const fs::path& file, int flags) {
  const int opened = ::open(file.c_str(), flags, 0600);
  if (opened < 0 || ::dup2(opened, number) < 0) ::_exit(126);
  ::close(opened);
}

std::vector<char*> pointers(std::vector<std::string>& words) {
  std::vector<char*> all;
  for (std::string& word : words) all.push_back(word.data());
  all.push_back(nullptr);
  return all;
}

struct Streams {
  fs::path in, out, err;
};

/// Runs a command to its end; the status of waitpid(2).
int run_process(std::vector<std::string> command, std::vector<std::string> environment,
                const fs::path& folder, const Streams& streams) {
  const std::vector<char*> argv = pointers(command), envp = pointers(environment);
  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error(std::string("fork: ") + strerror(errno));
  if (child == 0) {
    if (::chdir(folder.c_str()) != 0) ::_exit(126);
    redirect(STDIN_FILENO, streams.in, O_RDONLY);
    redirect(STDOUT_FILENO, streams.out, O_WRONLY | O_CREAT | O_TRUNC);
    redirect(STDERR_FILENO, streams.err, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND);
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    ::personality(ADDR_NO_RANDOMIZE);  // the same addresses, and so the same order, in every run
    ::alarm(kMostSeconds);
    ::execve(argv[0], argv.data(), envp.data());
    ::_exit(126);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) throw std::runtime_error(std::string("waitpid: ") + strerror(errno));
  }
  return status;
}

/// What differs from run to run though nothing is wrong: how much memory was used.
std::string without_memory(std::string text) {
  static constexpr std::string_view kMember = "\"peak_memory_bytes\": ";
  for (std::size_t at = 0; (at = text.find(kMember, at)) != std::string::npos;) {
    at += kMember.size();
    text.erase(at, text.find_first_not_of("0123456789", at) - at);
  }
  return text;
}

std::map<std::string, std::string> files_in(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    files[entry.path().filename().string()] = without_memory(read_bytes(entry.path()));
  return files;
}

const char* variable_of(Fault::What what) {
  switch (what) {
    case Fault::What::allocation:
      return kAllocationVariable;
    case Fault::What::memory:
      return kMemoryVariable;
    case Fault::What::thread:
      return kThreadVariable;
    case Fault::What::output:
      return kOutputVariable;
    case Fault::What::nothing:
      break;
  }
  return nullptr;
}

std::vector<std::string> variables_of(const Fault& fault) {
  std::vector<std::string> all;
  if (const char* variable = variable_of(fault.what))
    all.push_back(std::string(variable) + "=" + std::to_string(fault.number));
  if (!fault.kind.empty()) all.push_back(std::string(kKindVariable) + "=" + fault.kind);
  return all;
}

}  // namespace

std::string to_string(const Fault& fault) {
  std::string text = kWhat[static_cast<int>(fault.what)];
  if (fault.what != Fault::What::nothing) text += ":" + std::to_string(fault.number);
  return fault.kind.empty() ? text : text + ":" + fault.kind;
}

Fault parse_fault(const std::string& text) {
  const std::size_t first = text.find(':'), second = text.find(':', first + 1);
  const auto* const name = std::find(std::begin(kWhat), std::end(kWhat), text.substr(0, first));
  if (name == std::end(kWhat)) throw std::invalid_argument("no fault: " + text);
  Fault fault;
  fault.what = static_cast<Fault::What>(name - std::begin(kWhat));
  if (first != std::string::npos) fault.number = std::stoull(text.substr(first + 1));
  if (first != std::string::npos && second != std::string::npos)
    fault.kind = text.substr(second + 1);
  return fault;
}

std::string read_bytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream stream(file, std::ios::binary);
  stream << bytes;
  stream.close();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
}

std::string old_content(const std::string& name) { return "what was in " + name + " before\n"; }

Experiment::Experiment(const fs::path& program, const fs::path& library, fs::path folder)
    : program_(fs::absolute(program)), library_(fs::absolute(library)) {
  folder = fs::absolute(folder);
  inputs_ = folder / "inputs";
  run_ = folder / "run";
  record_ = folder / "record";
  out_ = folder / "out";
  err_ = folder / "err";
  fs::remove_all(inputs_);
  fs::create_directories(inputs_);
}

std::vector<std::string> Experiment::environment(const Fault& fault, bool injected) const {
  // Nothing of the caller's: neither plugins nor numbers of threads.
  std::vector<std::string> all{"PATH=/usr/bin:/bin", "LC_ALL=C.UTF-8", "OPENBLAS_NUM_THREADS=1",
                               "XDG_DATA_HOME=" + (inputs_ / "none").string()};
  if (const char* libraries = std::getenv("LD_LIBRARY_PATH"))  // of a program that was moved
    all.push_back(std::string("LD_LIBRARY_PATH=") + libraries);
  if (!injected) return all;
  all.push_back("LD_PRELOAD=" + library_.string());
  all.push_back(std::string(kRecordVariable) + "=" + record_.string());
  for (std::string& variable : variables_of(fault)) all.push_back(std::move(variable));
  return all;
}

void Experiment::prepare(const Trial& trial) const {
  fs::remove_all(run_);
  fs::create_directories(run_);
  for (const std::string& name : trial.outputs) {
    if (name != trial.journal) write_bytes(run_ / name, old_content(name));
  }
  for (const auto& [name, from] : trial.before) fs::copy_file(inputs_ / from, run_ / name);
}

RunResult Experiment::run(const Trial& trial, const Fault& fault) {
  prepare(trial);
  const SharedRecord shared(record_);
  std::vector<std::string> command{program_.string()};
  command.insert(command.end(), trial.arguments.begin(), trial.arguments.end());
  const fs::path input = trial.input.empty() ? fs::path("/dev/null") : inputs_ / trial.input;
  const int status =
      run_process(std::move(command), environment(fault, true), run_, {input, out_, err_});
  RunResult result;
  if (WIFEXITED(status)) result.code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
  result.out = without_memory(read_bytes(out_));
  result.err = read_bytes(err_);
  result.files = files_in(run_);
  const FaultRecord& record = *shared;
  result.started = record.started;
  result.allocations = record.allocations;
  result.threads = record.threads;
  result.outputs = record.outputs;
  result.failed = record.failed;
  const std::size_t listed =
      std::min<std::size_t>(result.outputs, std::size_t{FaultRecord::kMostCalls});
  result.calls.assign(record.calls.begin(), record.calls.begin() + listed);
  return result;
}

void Experiment::make_input(const std::vector<std::string>& arguments, const std::string& input) {
  std::vector<std::string> command{program_.string()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  const fs::path in = input.empty() ? fs::path("/dev/null") : inputs_ / input;
  const int status =
      run_process(std::move(command), environment({}, false), inputs_, {in, out_, err_});
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error(program_.string() + " " + arguments.front() +
                             " made no input: " + read_bytes(err_));
  }
}

std::string Experiment::shell_line(const Trial& trial, const Fault& fault) const {
  std::string line = "cd " + run_.string() + " &&";
  for (const std::string& variable : environment(fault, true)) line += " " + variable;
  line += " " + program_.string();
  for (const std::string& word : trial.arguments) line += " " + word;
  return trial.input.empty() ? line : line + " < " + (inputs_ / trial.input).string();
}

}  // namespace cairn::faults
