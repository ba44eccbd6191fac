// SPDX-License-Identifier: BSD-3-Clause
// Measures cairn, study by study, and writes what it found into the pages of docs/.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "json_access.hpp"
#include "studies.hpp"
#include "tables.hpp"

namespace cairn::performance {

namespace {

namespace fs = std::filesystem;
namespace json = boost::json;

struct Arguments {
  std::vector<std::string> studies;
  std::vector<std::string> pages;
  std::string cairn, folder, data, commit;
  std::string ours = "block_cholesky";
  int rounds = 0;
  bool quick = false;
};

using Study = void (*)(const Bench&, const Keep&);

const std::vector<std::pair<std::string, Study>>& all_studies() {
  static const std::vector<std::pair<std::string, Study>> all{
      {"sparsify_sets", study_sparsify_sets},
      {"sparsify_topology", study_sparsify_topology},
      {"sparsify_problems", study_sparsify_problems},
      {"sparsify_whole", study_sparsify_whole},
      {"sparsify_online", study_sparsify_online},
      {"sparsify_selection", study_sparsify_selection},
      {"sparsify_edges", study_sparsify_edges},
      {"explore_cave", study_explore_cave},
      {"explore_freiburg", study_explore_freiburg},
      {"explore_action", study_explore_action},
      {"explore_scale", study_explore_scale},
      {"explore_floors", study_explore_floors},
      {"explore_sensitivity", study_explore_sensitivity}};
  return all;
}

/// Of a group of studies, such as compact_sets, the name before the underscore stands for all.
bool is_chosen(const std::string& study, const std::vector<std::string>& chosen) {
  return chosen.empty() || std::ranges::any_of(chosen, [&](const std::string& name) {
           return study == name || study.starts_with(name + "_");
         });
}

/// What can be chosen.
std::set<std::string> study_names() {
  std::set<std::string> names;
  for (const auto& [name, study] : all_studies()) {
    names.insert(name);
    names.insert(name.substr(0, name.find('_')));
  }
  return names;
}

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void write(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

/// Machine and build, as the program that is measured tells them.
json::object begin_report(const std::string& study, const Arguments& arguments,
                          const Bench& bench) {
  const Run run = bench.cairn.optimize({"tiny", "@manhattan:poses=4", {}},
                                       {"--linear-solver", bench.ours}, 1, 0.0);
  if (run.report.is_null())
    throw std::runtime_error(arguments.cairn + " does not run: " + run.outcome.complaint);
  return {{"study", study},
          {"cairn", *member(run.report, "cairn")},
          {"commit", arguments.commit},
          {"quick", arguments.quick},
          {"rounds", bench.rounds},
          {"ours", bench.ours},
          {"machine", *member(run.report, "machine")},
          {"build", *member(run.report, "build")},
          {"entries", json::array()}};
}

void measure(const Arguments& arguments) {
  const fs::path folder = arguments.folder;
  fs::create_directories(folder);
  const int rounds = arguments.rounds > 0 ? arguments.rounds : arguments.quick ? 2 : 5;
  const Bench bench{Cairn(arguments.cairn, folder / "work"), arguments.data, arguments.quick,
                    arguments.ours, rounds};
  for (const auto& [name, study] : all_studies()) {
    if (!is_chosen(name, arguments.studies)) continue;
    json::object report = begin_report(name, arguments, bench);
    const fs::path file = folder / (name + ".json");
    study(bench, [&](json::object entry) {
      report["entries"].get_array().push_back(std::move(entry));
      write(file, json::serialize(report) + "\n");
    });
  }
}

/// Into the page that has a place for it.
void put_into(std::vector<std::string>& pages, const Section& section) {
  const auto page = std::ranges::find_if(
      pages, [&](const std::string& text) { return has_place(section, text); });
  put(section, page == pages.end() ? pages.front() : *page);
}

/// Of every study that there is a report of; the others' sections stay as they are.
void write_tables(const Arguments& arguments) {
  std::vector<std::string> pages;
  for (const std::string& file : arguments.pages) pages.push_back(read(file));
  for (const auto& [name, study] : all_studies()) {
    const fs::path file = fs::path(arguments.folder) / (name + ".json");
    if (!fs::exists(file)) continue;
    const json::value report = json::parse(read(file));
    for (const Section& section : sections(report)) put_into(pages, section);
  }
  for (std::size_t k = 0; k < pages.size(); ++k) {
    write(arguments.pages[k], pages[k]);
    tell("tables: " + arguments.pages[k]);
  }
}

int run(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("Measures the program cairn, one JSON file a study, and turns those into tables.");
  app.add_option("studies", arguments.studies, "all, or some of: sparsify explore")
      ->check(CLI::IsMember(study_names()));
  app.add_option("--cairn", arguments.cairn, "the program to measure");
  app.add_option("--folder", arguments.folder, "where the JSON is")->required();
  app.add_option("--data", arguments.data, "folder of the real graphs");
  app.add_option("--commit", arguments.commit, "what is measured, for the tables");
  app.add_option("--ours", arguments.ours, "cairn's own linear solver, with options")
      ->capture_default_str();
  app.add_option("--rounds", arguments.rounds, "of each comparison [5, quick 2]")
      ->check(CLI::Range(1, 1000));
  app.add_flag("--quick", arguments.quick, "few and small graphs: shows that it works, no more");
  app.add_option("--tables", arguments.pages, "do not measure: fill in the tables of these pages");
  CLI11_PARSE(app, argc, argv);
  if (!arguments.pages.empty()) {
    write_tables(arguments);
  } else {
    measure(arguments);
  }
  return 0;
}

}  // namespace
}  // namespace cairn::performance

int main(int argc, char** argv) {
  try {
    return cairn::performance::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "cairn_performance: {}\n", error.what());
    return 1;
  }
}
