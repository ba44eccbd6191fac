// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz/targets/target.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "cairn/plugin/plugin_search.hpp"

namespace cairn::fuzz {
namespace {

/// Made by mkdtemp: no other user may write to it.
struct ScratchFolder {
  ScratchFolder() {
    const std::filesystem::path memory = "/dev/shm";
    const bool there = ::access(memory.c_str(), W_OK) == 0;
    path = ((there ? memory : std::filesystem::temp_directory_path()) / "cairn_fuzz_XXXXXX");
    if (!::mkdtemp(path.data())) throw std::system_error(errno, std::generic_category(), path);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  std::string path;
};

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all = {
      reader(),      packed_file(), line_protocol(), policy_protocol(),
      journal(),     sidecar(),     recording(),     option_text(),
      incremental(), grid(),        scan_log()};
  return all;
}

const Target& target(std::string_view name) {
  for (const Target& one : targets()) {
    if (one.name == name) return one;
  }
  throw std::out_of_range("no fuzz target is called " + std::string(name));
}

Registry& registry() {
  static Registry instance(PluginSearch{.files = {}, .environment = false, .user_folder = false});
  return instance;
}

std::string_view text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::uint8_t Source::byte() {
  if (left_.empty()) return 0;
  const std::uint8_t first = left_.front();
  left_ = left_.subspan(1);
  return first;
}

int Source::below(int count) { return count > 0 ? byte() % count : 0; }

double Source::unit() { return static_cast<double>(static_cast<std::int8_t>(byte())) / 127.0; }

const std::string& scratch_folder() {
  static const ScratchFolder folder;
  return folder.path;
}

}  // namespace cairn::fuzz
