// SPDX-License-Identifier: BSD-3-Clause
#include "experiment.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "process.hpp"
#include "shared_record.hpp"

namespace cairn::faults {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr const char* kWhat[] = {"nothing", "allocation", "memory", "thread", "output", "kill"};

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
    case Fault::What::kill:
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
  std::vector<std::string> all = plain_environment(inputs_ / "none");
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

/// `input`: a file in the folder of inputs, or empty.
pid_t Experiment::start(const std::vector<std::string>& arguments,
                        std::vector<std::string> environment, const fs::path& folder,
                        const std::string& input) const {
  Launch launch{{program_.string()}, std::move(environment), folder};
  launch.command.insert(launch.command.end(), arguments.begin(), arguments.end());
  const Descriptor in(input.empty() ? fs::path("/dev/null") : inputs_ / input, O_RDONLY);
  const Descriptor out(out_, O_WRONLY | O_CREAT | O_TRUNC);
  const Descriptor err(err_, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND);
  return start_process(std::move(launch), {in.number(), out.number(), err.number()});
}

RunResult Experiment::run(const Trial& trial, const Fault& fault) {
  prepare(trial);
  const SharedRecord shared(record_);
  const auto begin = Clock::now();
  const pid_t process = start(trial.arguments, environment(fault, true), run_, trial.input);
  if (fault.what == Fault::What::kill) {
    std::this_thread::sleep_until(begin + std::chrono::microseconds(fault.number));
    ::kill(process, SIGKILL);
  }
  const int status = wait_for(process);
  RunResult result;
  result.microseconds =
      std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - begin).count();
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
  const int status = wait_for(start(arguments, environment({}, false), inputs_, input));
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
