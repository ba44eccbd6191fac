// SPDX-License-Identifier: BSD-3-Clause
// Writes what fuzzing starts from: FOLDER/corpus/TARGET/seed_N, FOLDER/TARGET.dict and
// FOLDER/TARGET.options, whose lines are arguments of libFuzzer.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>

#include "fuzz/targets/target.hpp"

namespace {

namespace fs = std::filesystem;

void write(const fs::path& file, const std::string& bytes) {
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream << bytes;
  stream.close();
  if (!stream) throw std::runtime_error("cannot be written: " + file.string());
}

/// As libFuzzer reads it: one quoted word per line.
std::string dictionary(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    if (word.empty()) continue;
    text += '"';
    for (const char c : word) {
      const auto byte = static_cast<unsigned char>(c);
      const bool plain = byte >= 0x20 && byte < 0x7f && c != '"' && c != '\\';
      text += plain ? std::string(1, c) : fmt::format("\\x{:02X}", byte);
    }
    text += "\"\n";
  }
  return text;
}

void write_all(const fs::path& folder) {
  for (const cairn::fuzz::Target& target : cairn::fuzz::targets()) {
    const fs::path corpus = folder / "corpus" / target.name;
    fs::create_directories(corpus);
    int number = 0;
    for (const std::string& seed : target.seeds())
      write(corpus / fmt::format("seed_{:03}", number++), seed);
    write(folder / fmt::format("{}.dict", target.name), dictionary(target.words()));
    write(folder / fmt::format("{}.options", target.name),
          fmt::format("-max_len={}\n", target.longest));
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("fuzz_seeds FOLDER\n", stderr);
    return 2;
  }
  try {
    write_all(arguments[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzz_seeds: %s\n", error.what());
    return 3;
  }
  return 0;
}
