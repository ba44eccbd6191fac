// SPDX-License-Identifier: BSD-3-Clause
// ./dev soak: robots that never stop talk to cairn online, while much goes wrong; says where more
// is lost than must be.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "long_session.hpp"
#include "mission.hpp"

namespace cairn::soak {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kRounds = 12;          // of a mission
constexpr int kLongPoses = 100;      // of the long session, between two rounds
constexpr int kMostViolations = 40;  // before it gives up

struct Options {
  Place place;
  double minutes = 60.0;
  long rounds = 0;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> mission;
};

void add_options(CLI::App& app, Options& options) {
  app.add_option("--program", options.place.program, "the program")->required();
  app.add_option("--library", options.place.library, "the injected library")->required();
  app.add_option("--folder", options.place.folder, "for its files")->required();
  app.add_option("--minutes", options.minutes, "how long")->capture_default_str();
  app.add_option("--rounds", options.rounds, "so many disturbances instead");
  app.add_option("--seed", options.seed, "of all that is drawn")->capture_default_str();
  app.add_option("--mission", options.mission, "this one alone");
  app.footer("Ends with 1 where something is violated, and with 2 where it cannot be said.");
}

class Soak {
 public:
  explicit Soak(const Options& options) : options_(options) {}

  /// True if nothing was violated.
  bool run() {
    if (options_.mission) {
      run_mission(*options_.mission);
    } else {
      run_all();
    }
    print_table();
    return violations_ == 0;
  }

 private:
  void run_all() {
    keep_long([&] { long_.emplace(options_.place, options_.seed); });
    for (std::uint64_t k = 0; !is_over(); ++k) run_mission(k);
    std::printf("\n");
    keep_long([&] {
      while (!long_->is_warm()) long_->drive(kLongPoses);
      long_->end();
    });
  }

  bool is_over() const {
    if (violations_ >= kMostViolations) return true;
    if (options_.rounds > 0) return rounds_ >= options_.rounds;
    return std::chrono::duration<double>(Clock::now() - begin_).count() > 60.0 * options_.minutes;
  }

  void run_mission(std::uint64_t number) {
    std::optional<Mission> mission;
    try {
      mission.emplace(options_.place, options_.seed * 1'000'003 + number, tally_);
      for (int k = 0; k < kRounds && !is_over(); ++k) {
        mission->round();
        ++rounds_;
        keep_long([&] { long_->drive(kLongPoses); });
        show_progress();
      }
      mission->end();
    } catch (const Violated& violated) {
      report(std::string("cairn online ") + violated.what() +
                 "\n  after: " + (mission ? mission->what_it_did() : "its start"),
             " --mission " + std::to_string(number));
      ++rounds_;  // so that there is an end
    }
  }

  /// Calls what concerns the long session, if there is one still.
  template <class Call>
  void keep_long(const Call& call) {
    if (options_.mission || long_lost_) return;
    try {
      call();
    } catch (const Violated& violated) {
      report(violated.what(), "");
      long_lost_ = true;
    }
  }

  void report(const std::string& what, const std::string& which) {
    ++violations_;
    std::printf("\nviolation: %s\n  ./dev soak %g --seed %llu%s\n", what.c_str(), options_.minutes,
                static_cast<unsigned long long>(options_.seed), which.c_str());
    std::fflush(stdout);
  }

  void show_progress() {
    const bool terminal = ::isatty(STDOUT_FILENO) == 1;
    const auto interval = std::chrono::seconds(terminal ? 1 : 60);
    if (Clock::now() - shown_ < interval) return;
    shown_ = Clock::now();
    std::printf("%s%.1f minutes: %ld disturbances in %ld sessions, %ld lines, %ld violations%s",
                terminal ? "\r" : "", std::chrono::duration<double>(shown_ - begin_).count() / 60.0,
                rounds_, tally_.missions, tally_.lines, violations_, terminal ? "" : "\n");
    std::fflush(stdout);
  }

  void print_table() const {
    const auto row = [](const char* what, long count) {
      std::printf("%-34s %10ld\n", what, count);
    };
    std::printf("\n");
    row("sessions", tally_.missions);
    row("lines acknowledged", tally_.lines);
    for (int k = 0; k < kDisturbances; ++k)
      row(name_of(static_cast<Disturbance>(k)), tally_.times[static_cast<std::size_t>(k)]);
    row("restored from the journal", tally_.restorations);
    row("lines in the longest of these", tally_.longest);
    row("lines sent again after that", tally_.sent_again);
    row("estimates and maps compared", tally_.comparisons);
    row("NAME.PID-N.part left", tally_.parts);
    row("journals of which a part was cut", tally_.cuts);
    if (long_) {
      row("the long session: lines", long_->lines());
      row("its memory after 1000 poses [kB]", long_->warm());
      row("the most that it had [kB]", long_->most());
    }
    row("violations", violations_);
  }

  const Options& options_;
  Tally tally_;
  std::optional<LongSession> long_;
  bool long_lost_ = false;
  long rounds_ = 0, violations_ = 0;
  Clock::time_point begin_ = Clock::now(), shown_ = begin_;
};

}  // namespace
}  // namespace cairn::soak

int main(int argc, char** argv) {
  CLI::App app("Robots that never stop talk to cairn online, while much goes wrong.");
  cairn::soak::Options options;
  cairn::soak::add_options(app, options);
  try {
    app.parse(argc, argv);
    for (std::filesystem::path* path :
         {&options.place.program, &options.place.library, &options.place.folder})
      *path = std::filesystem::absolute(*path);
    std::signal(SIGPIPE, SIG_IGN);  // processes that are written to end
    return cairn::soak::Soak(options).run() ? 0 : 1;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cairn_soak: %s\n", error.what());
    return 2;
  }
}
