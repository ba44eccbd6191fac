// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

const fs::path kSource = CAIRN_SOURCE_FOLDER;

std::string read(const fs::path& file) {
  std::ifstream stream(file);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

struct Listing {
  std::string page;
  std::string file;  ///< where the code comes from, below the project's folder
  std::string code;
};

/// The code blocks of a page that follow a line `<!-- from FILE -->`.
std::vector<Listing> listings(const fs::path& page) {
  std::vector<Listing> result;
  std::istringstream lines(read(page));
  const std::string begin = "<!-- from ", end = " -->";
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(begin) || !line.ends_with(end)) continue;
    Listing listing{
        page.filename(), line.substr(begin.size(), line.size() - begin.size() - end.size()), {}};
    std::getline(lines, line);
    EXPECT_TRUE(line.starts_with("```"))
        << page << ": no code after the line that names " << listing.file;
    while (std::getline(lines, line) && line != "```") listing.code += line + "\n";
    result.push_back(std::move(listing));
  }
  return result;
}

/// A page without its code blocks.
std::string prose(const fs::path& page) {
  std::string result;
  std::istringstream lines(read(page));
  bool code = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) code = !code;
    if (!code) result += line + "\n";
  }
  return result;
}

std::vector<fs::path> pages() {
  std::vector<fs::path> result{kSource / "README.md"};
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(kSource / "docs")) {
    if (entry.path().extension() == ".md") result.push_back(entry.path());
  }
  return result;
}

TEST(Docs, ShowTheCodeThatIsCompiled) {
  int found = 0;
  for (const fs::path& page : pages()) {
    for (const Listing& listing : listings(page)) {
      ++found;
      EXPECT_FALSE(listing.code.empty()) << listing.page;
      EXPECT_NE(read(kSource / listing.file).find(listing.code), std::string::npos)
          << listing.page << " shows code that is no longer in " << listing.file << ":\n"
          << listing.code;
    }
  }
  EXPECT_GE(found, 4) << "the tutorial on plugins alone has that many";
}

TEST(Docs, LinkOnlyToPagesThatExist) {
  for (const fs::path& page : pages()) {
    const std::string text = prose(page);
    for (std::size_t at = text.find("]("); at != std::string::npos; at = text.find("](", at + 1)) {
      std::string target = text.substr(at + 2, text.find(')', at) - at - 2);
      target = target.substr(0, target.find('#'));
      if (target.empty() || target.find("://") != std::string::npos) continue;
      EXPECT_TRUE(fs::exists(page.parent_path() / target)) << page << " links to " << target;
    }
  }
}

}  // namespace
