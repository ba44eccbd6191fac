// SPDX-License-Identifier: BSD-3-Clause
#include "trials.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace cairn::faults {
namespace {

constexpr int kLinesBeforeSave = 14;
constexpr int kMetresWithFaults = 1, kMetresForKills = 12;
constexpr int kBeams = 90;

std::string edge(int from, int to, const std::string& measurement) {
  return "EDGE_SE2 " + std::to_string(from) + " " + std::to_string(to) + " " + measurement +
         " 100 0 0 100 0 400\n";
}

const std::string kStep = "1 0 0.785";

/// A robot once around, in as many steps as there are poses (8 make a circle), with questions
/// between its measurements.
std::string stream(int poses) {
  std::string text = "VERTEX_SE2 0 0 0 0\nFIX 0\n";
  for (int k = 1; k < poses; ++k) {
    text += "NEW VERTEX_SE2 " + std::to_string(k) + "\n" + edge(k - 1, k, kStep);
    if (k % 3 == 0) text += "CHI2\nESTIMATE ALL\nCOVARIANCE 0 " + std::to_string(k) + "\n";
  }
  return text + edge(poses - 1, 0, kStep) + "FULL\nREMOVE FACTOR 1\nCHI2\n";
}

/// The same for a policy.
std::string policy_stream(int poses) {
  std::string text = "NEW VERTEX_SE2 0\n";
  for (int k = 1; k < poses; ++k) {
    text += "NEW VERTEX_SE2 " + std::to_string(k) + "\n" + edge(k - 1, k, kStep) + "NEXT\n";
  }
  return text + edge(poses - 1, 0, kStep) + "NEXT\nDONE\nCHI2\n";
}

/// The log of a robot that drives along the middle of a room of 8 m by 6 m and looks ahead, in
/// steps of 0.4 m.
std::string laser_log(int scans) {
  std::string text;
  for (int k = 0; k < scans; ++k) {
    const double x = 0.4 * k - 2;
    text += "FLASER " + std::to_string(kBeams);
    for (int beam = 0; beam < kBeams; ++beam) {
      const double angle = std::numbers::pi * (beam / (kBeams - 1.0) - 0.5);
      const double ahead = (4 - x) / std::max(std::cos(angle), 1e-9);
      const double aside = 3 / std::max(std::abs(std::sin(angle)), 1e-9);
      text += " " + std::to_string(std::min(ahead, aside));
    }
    const std::string pose = " " + std::to_string(x) + " 0 0";
    text += pose + pose + " " + std::to_string(k) + " robot " + std::to_string(k) + "\n";
  }
  return text;
}

std::string first_lines(const std::string& text, int count) {
  std::size_t end = 0;
  for (; count > 0; --count) end = text.find('\n', end) + 1;
  return text.substr(0, end);
}

/// To the end of a measurement: questions have no number in a journal to go on from.
std::string first_half(const std::string& text) {
  return text.substr(0, text.find('\n', text.find("\nEDGE", text.size() / 2) + 1) + 1);
}

Trial trial(const std::string& name, std::vector<std::string> arguments,
            std::vector<std::string> outputs) {
  Trial made;
  made.name = name;
  made.arguments = std::move(arguments);
  made.arguments.insert(made.arguments.end(), {"--threads", "1"});
  made.outputs = std::move(outputs);
  return made;
}

Trial online_trial(const std::string& name, std::vector<std::string> arguments,
                   const std::string& input) {
  std::vector<std::string> words{"online"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  words.insert(words.end(), {"--journal", "run.journal", "-o", "map.g2o", "--json", "online.json"});
  Trial made = trial(name, std::move(words), {"run.journal", "map.g2o", "online.json"});
  made.journal = "run.journal";
  made.input = made.stream = input;
  return made;
}

const std::vector<std::string> kOnline{"--output", "last", "--marginals", "last"};
const std::vector<std::string> kPolicy{"--policy", "compact_pose:range=3,angle=1,reuse=true"};

std::vector<Trial> online_trials() {
  Trial fresh = online_trial("online", kOnline, "stream.txt");
  Trial restored = online_trial("online-restored", kOnline, "rest.txt");
  restored.before["run.journal"] = "half.journal";
  restored.stream = "stream.txt";
  return {fresh, restored, online_trial("online-policy", kPolicy, "policy.txt")};
}

std::vector<Trial> file_trials() {
  return {
      trial("optimize",
            {"optimize", "../inputs/graph.g2o", "-o", "best.g2o", "--json", "run.json", "--record",
             "run.jsonl", "--covariance", "blocks"},
            {"best.g2o", "run.json", "run.jsonl"}),
      trial("optimize-stdout", {"optimize", "../inputs/graph.g2o.gz", "-o", "-"}, {}),
      trial("replay",
            {"replay", "../inputs/graph.g2o", "-o", "last.g2o", "--json", "replay.json", "--steps",
             "steps.csv", "--marginals", "diagonal", "--check", "2"},
            {"last.g2o", "replay.json", "steps.csv"}),
      trial("marginals",
            {"marginals", "../inputs/graph.g2o", "--diagonal", "--column", "last", "-o",
             "graph.cov", "--json", "marginals.json"},
            {"graph.cov", "marginals.json"}),
      trial("compact",
            {"compact", "../inputs/graph.g2o", "-o", "compact.g2o", "--trajectory", "full.g2o",
             "--steps", "steps.csv", "--save-thresholds", "thresholds.json", "--json",
             "compact.json"},
            {"compact.g2o", "full.g2o", "steps.csv", "thresholds.json", "compact.json"}),
      trial("sparsify",
            {"sparsify", "../inputs/graph.g2o", "-o", "sparse.g2o", "--json", "sparsify.json"},
            {"sparse.g2o", "sparsify.json"}),
      trial("convert", {"convert", "../inputs/graph.g2o", "graph.g2o.gz", "--json", "convert.json"},
            {"graph.g2o.gz", "convert.json"}),
      trial("generate",
            {"generate", "ring:poses=20", "-o", "ring.g2o", "--ground-truth", "truth.g2o", "--json",
             "generate.json"},
            {"ring.g2o", "truth.g2o", "generate.json"}),
      trial("bench",
            {"bench", "../inputs/graph.g2o", "--linear-solver", "block_cholesky", "--repeat", "1",
             "--no-memory", "--csv", "bench.csv", "--json", "bench.json"},
            {"bench.csv", "bench.json"}),
      trial("evaluate",
            {"evaluate", "../inputs/graph.g2o", "../inputs/best.g2o", "--json", "errors.json"},
            {"errors.json"}),
      trial("view",
            {"view", "../inputs/graph.g2o", "../inputs/best.g2o", "../inputs/run.json",
             "../inputs/run.jsonl", "-o", "page.html", "--json", "view.json"},
            {"page.html", "view.json"}),
  };
}

/// A robot that records its run as it goes, for so many metres.
Trial explore_trial(int metres) {
  Trial made =
      trial("explore",
            {"explore", "@rooms:width=10,height=8,seed=2", "--registration",
             "simulated:range=1.4,angle=0.35", "--until", "distance=" + std::to_string(metres),
             "--record", "run.jsonl", "--html", "run.html", "-o", "run.g2o", "--map", "run.yaml",
             "--json", "run.json", "--quiet"},
            {"run.jsonl", "run.html", "run.g2o", "run.yaml", "run.png", "run.json"});
  made.recording = "run.jsonl";
  made.parts["run.png"] = "run.yaml";
  return made;
}

Trial map_trial() {
  Trial made = trial("map",
                     {"map", "../inputs/robot.clf", "-o", "floor.yaml", "--graph", "poses.g2o",
                      "--trajectory", "all.g2o", "--json", "map.json", "--quiet"},
                     {"floor.yaml", "floor.png", "poses.g2o", "all.g2o", "map.json"});
  made.parts["floor.png"] = "floor.yaml";
  return made;
}

/// Where memory is short, it is so in Python too, whose libraries end the process by a signal.
Trial plot_trial() {
  Trial made = trial("plot",
                     {"replay", "../inputs/graph.g2o", "--solve-every", "10", "--plot", "steps.svg",
                      "--json", "replay.json"},
                     {"steps.svg", "replay.json"});
  made.memory = false;
  return made;
}

/// Memory that ends in one of several threads; larger, so that they have work.
Trial parallel_trial() {
  Trial made = trial(
      "parallel",
      {"marginals", "@manhattan:poses=500,seed=3", "-o", "graph.cov", "--json", "marginals.json"},
      {"graph.cov", "marginals.json"});
  made.arguments.back() = "3";
  return made;
}

/// Several threads, whose starts fail.
Trial thread_trial() {
  Trial made =
      trial("threads", {"optimize", "../inputs/graph.g2o", "-o", "best.g2o", "--json", "run.json"},
            {"best.g2o", "run.json"});
  made.arguments.back() = "4";
  made.threads = true;
  return made;
}

}  // namespace

void make_inputs(const std::vector<Trial>& trials, const InputSizes& sizes,
                 Experiment& experiment) {
  experiment.make_input({"generate", "manhattan:poses=" + std::to_string(sizes.graph), "-o",
                         "graph.g2o", "--seed", "3"});
  experiment.make_input({"convert", "graph.g2o", "graph.g2o.gz"});
  experiment.make_input({"optimize", "graph.g2o", "-o", "best.g2o", "--json", "run.json",
                         "--record", "run.jsonl", "--threads", "1"});
  const std::string all = stream(sizes.stream);
  const std::string half = first_half(all);
  write_bytes(experiment.inputs() / "stream.txt", all);
  const std::string first = first_lines(all, kLinesBeforeSave);
  write_bytes(experiment.inputs() / "saving.txt",
              first + "SAVE saved.g2o\n" + all.substr(first.size()));
  write_bytes(experiment.inputs() / "first.txt", half);
  write_bytes(experiment.inputs() / "rest.txt", all.substr(half.size()));
  write_bytes(experiment.inputs() / "policy.txt", policy_stream(sizes.stream));
  write_bytes(experiment.inputs() / "robot.clf", laser_log(sizes.stream));
  const auto restores = [](const Trial& made) { return !made.before.empty(); };
  if (std::ranges::none_of(trials, restores)) return;  // nor need there be an estimator
  std::vector<std::string> online{"online", "--journal", "half.journal", "--threads", "1"};
  online.insert(online.end(), kOnline.begin(), kOnline.end());
  experiment.make_input(online, "first.txt");
}

std::vector<Trial> cairn_trials() {
  std::vector<Trial> all = file_trials();
  all.push_back(map_trial());
  all.push_back(explore_trial(kMetresWithFaults));
  for (Trial& online : online_trials()) all.push_back(std::move(online));
  all.push_back(plot_trial());
  all.push_back(parallel_trial());
  all.push_back(thread_trial());
  return all;
}

std::vector<Trial> kill_trials() {
  std::vector<Trial> all = file_trials();
  for (const char* const sync : {"every", "batch", "none"}) {
    Trial made = online_trial(std::string("online-") + sync, kOnline, "saving.txt");
    made.arguments.insert(made.arguments.end(), {"--sync", sync});
    made.outputs.push_back("saved.g2o");
    made.saved["saved.g2o"] = kLinesBeforeSave + 1;
    all.push_back(made);
  }
  for (Trial& online : online_trials()) {
    if (online.name != "online") all.push_back(std::move(online));
  }
  all.push_back(parallel_trial());
  all.push_back(map_trial());
  all.push_back(explore_trial(kMetresForKills));
  return all;
}

Trial careless_trial() {
  Trial made;
  made.name = "careless";
  made.outputs = {"result.txt", "second.txt"};
  return made;
}

Trial careless_online_trial(Experiment& experiment) {
  write_bytes(experiment.inputs() / "lines.txt", "one\ntwo\nSAVE saved.txt\nthree\nfour\n");
  Trial made;
  made.name = "careless-online";
  made.arguments = {"online", "--journal"};
  made.outputs = {"run.journal", "map.g2o", "saved.txt"};
  made.journal = "run.journal";
  made.input = made.stream = "lines.txt";
  made.saved["saved.txt"] = 3;
  return made;
}

}  // namespace cairn::faults
