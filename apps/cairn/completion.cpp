// SPDX-License-Identifier: BSD-3-Clause
#include "completion.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/registry.hpp"
#include "cairn/program/table.hpp"
#include "cairn/runtime/error.hpp"
#include "option_parser.hpp"

namespace cairn::app {
namespace {

/// Placeholders of values that are files.
constexpr std::array<std::string_view, 11> kFiles{
    "FILE", "GRAPH", "IN", "OUT", "MAP", "FLOOR", "LOG", "PAGE", "PICTURE", "ESTIMATE", "TRUTH"};

/// Collects what begins with what has been typed. `before` is put before each word: the part of the
/// typed word that stays.
class Collector {
 public:
  explicit Collector(std::string typed) : typed_(std::move(typed)) {}

  void add(const std::string& word, const std::string& description) {
    if (word.starts_with(typed_)) completion_.candidates.push_back({word, description});
  }
  void allow_files() { completion_.files = true; }
  const std::string& typed() const { return typed_; }
  Completion result() { return std::move(completion_); }

 private:
  std::string typed_;
  Completion completion_;
};

// Components --------------------------------------------------------------------------------------

bool is_of(const Offer& offer, const std::vector<std::string>& kinds) {
  return kinds.empty() || std::ranges::find(kinds, offer.kind) != kinds.end();
}

void add_names(Collector& collector, const std::string& before,
               const std::vector<std::string>& kinds, const Registry& registry) {
  for (const Offer& offer : registry.offers()) {
    if (is_of(offer, kinds)) collector.add(before + offer.name, offer.summary);
  }
}

/// What may stand for the value of a component's option, after "key=".
void add_values(Collector& collector, const std::string& before, const OptionSpec& spec,
                const Registry& registry) {
  if (spec.type == OptionType::component) add_names(collector, before, spec.choices, registry);
  if (spec.type == OptionType::boolean) {
    for (const char* value : {"true", "false"}) collector.add(before + value, spec.help);
  }
  if (spec.type != OptionType::choice) return;
  for (const std::string& choice : spec.choices) collector.add(before + choice, spec.help);
}

/// Options of the component: keys, or values of the key that is there.
void add_options(Collector& collector, const std::string& before, const std::string& rest,
                 const std::string& name, const std::vector<std::string>& kinds,
                 Registry& registry) {
  for (const Offer& offer : registry.offers()) {
    if (offer.name != name || !is_of(offer, kinds)) continue;
    for (const OptionSpec& spec : registry.options(offer.kind, name).specs()) {
      const std::string key = spec.name + "=";
      if (rest.starts_with(key)) add_values(collector, before + key, spec, registry);
      if (!rest.starts_with(key)) collector.add(before + key, spec.help);
    }
  }
}

/// "NAME", "NAME:key=value,key=value", and in a list several of these with commas between them.
void add_components(Collector& collector, std::size_t begin, const std::vector<std::string>& kinds,
                    bool several, Registry& registry) {
  const std::string& typed = collector.typed();
  std::string name;  // whose options may stand at `part`
  std::size_t part = begin;
  for (std::size_t end; (end = typed.find(',', part)) != std::string::npos; part = end + 1) {
    const std::string whole = typed.substr(part, end - part);
    const std::size_t colon = whole.find(':');
    if (colon != std::string::npos) name = whole.substr(0, colon);
    if (colon == std::string::npos && whole.find('=') == std::string::npos) name.clear();
  }
  const std::size_t colon = typed.find(':', part);
  if (colon != std::string::npos) {
    name = typed.substr(part, colon - part);
    part = colon + 1;
  } else if (part == begin || several) {
    add_names(collector, typed.substr(0, part), kinds, registry);
  }
  if (!name.empty())
    add_options(collector, typed.substr(0, part), typed.substr(part), name, kinds, registry);
}

// Arguments ---------------------------------------------------------------------------------------

/// The value of an argument, which begins at `begin` of the typed word.
void add_value(Collector& collector, std::size_t begin, const OptionSpec& option,
               const std::function<Registry&()>& registry) {
  const std::string before = collector.typed().substr(0, begin);
  if (option.type == OptionType::component) {
    add_components(collector, begin, option.choices, option.components, registry());
  } else {
    for (const std::string& choice : option.choices) collector.add(before + choice, option.help);
  }
  if (!option.form.generators.empty() && collector.typed().substr(begin).starts_with('@')) {
    add_components(collector, begin + 1, option.form.generators, false, registry());
  } else if (std::ranges::find(kFiles, value_name(option)) != kFiles.end()) {
    collector.allow_files();
  }
}

/// What has been typed before the last word: the command that it chose, and what comes next.
class Place {
 public:
  explicit Place(const Program& program) : program_(program), command_(&program.self) {}

  void pass(const std::string& word) {
    if (pending_) {
      pending_ = nullptr;
    } else if (word == "--" && !only_positionals_) {
      only_positionals_ = true;
    } else if (word.size() > 1 && word.front() == '-' && !only_positionals_) {
      const OptionSpec* option = find(word.substr(0, word.find('=')));
      if (option && !is_flag(*option) && word.find('=') == std::string::npos) pending_ = option;
    } else if (!descend(word)) {
      ++positionals_;
    }
  }

  /// The option whose value comes next, or null.
  const OptionSpec* pending() const { return pending_; }
  bool options_may_follow() const { return !only_positionals_; }
  std::vector<const CommandEntry*> commands() const { return program_.below(*command_); }

  /// All that may be given here by a name, with the options of every command.
  std::vector<const OptionSpec*> options() const {
    std::vector<const OptionSpec*> all = all_options(program_, *command_);
    if (program_.is_self(*command_)) all.insert(all.begin(), &version_flag());
    all.insert(all.begin(), &help_flag());
    std::erase_if(all, [](const OptionSpec* option) { return option_names(*option).empty(); });
    return all;
  }

  const OptionSpec* find(const std::string& name) const {
    for (const OptionSpec* option : options()) {
      const std::vector<std::string> names = option_names(*option);
      if (std::ranges::find(names, name) != names.end()) return option;
    }
    return nullptr;
  }

  /// The positional argument that comes next, or null.
  const OptionSpec* positional() const {
    int before = positionals_;
    for (const OptionSpec& option : command_->options()) {
      if (!option.form.positional) continue;
      if (before == 0 || option.list) return &option;
      --before;
    }
    return nullptr;
  }

 private:
  bool descend(const std::string& word) {
    for (const CommandEntry* command : commands()) {
      if (own_name(*command) != word) continue;
      command_ = command;
      positionals_ = 0;
      return true;
    }
    return false;
  }

  const Program& program_;
  const CommandEntry* command_;
  const OptionSpec* pending_ = nullptr;
  int positionals_ = 0;
  bool only_positionals_ = false;
};

}  // namespace

Completion complete(const Program& program, const std::vector<std::string>& words,
                    const std::function<Registry&()>& registry) {
  Place place(program);
  if (words.empty()) return {};
  for (std::size_t k = 0; k + 1 < words.size(); ++k) place.pass(words[k]);
  Collector collector(words.back());
  const std::string& typed = collector.typed();
  if (place.pending()) {
    add_value(collector, 0, *place.pending(), registry);
  } else if (typed.starts_with('-') && place.options_may_follow()) {
    const std::size_t equals = typed.find('=');
    const OptionSpec* option = place.find(typed.substr(0, equals));
    if (equals != std::string::npos && option) add_value(collector, equals + 1, *option, registry);
    for (const OptionSpec* each : place.options()) {
      for (const std::string& name : option_names(*each)) collector.add(name, each->help);
    }
  } else {
    for (const CommandEntry* command : place.commands())
      collector.add(own_name(*command), command->summary());
    if (const OptionSpec* argument = place.positional())
      add_value(collector, 0, *argument, registry);
  }
  return collector.result();
}

std::string completion_text(const Completion& completion) {
  std::string text;
  for (const Candidate& candidate : completion.candidates)
    text += printable(candidate.word) + "\t" + printable(candidate.description) + "\n";
  if (completion.files) text += "\tfiles\n";
  return text;
}

}  // namespace cairn::app
