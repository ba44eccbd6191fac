// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/plugin/registry.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "cairn/plugin/plugin_search.hpp"
#include "cairn/plugin/unknown_name.hpp"
#include "cairn/runtime/error.hpp"
#include "cairn/runtime/plugin_call.hpp"
#include "cairn/text/spelling.hpp"
#include "plugin_loader.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Key = std::pair<std::string, std::string>;  // kind and name

Error plugin_error(const std::string& message) { return {ErrorCode::plugin, message}; }

/// "linear solver 'cholmod'"
std::string in_words(std::string_view kind, std::string_view name) {
  std::string words(kind);
  std::ranges::replace(words, '_', ' ');
  return fmt::format("{} '{}'", words, name);
}

const char* const kThisProgram = "this program";

/// Where a name comes from, for messages: a shared object, or this program.
std::string origin(const Sidecar& sidecar) {
  return sidecar.library.empty() ? kThisProgram : sidecar.library.string();
}

}  // namespace

/// What the plugin being registered has added so far.
struct Registrar::Target {
  struct Component {
    OptionTable table;
    Factory<cairn::Component> factory;
  };
  struct Types {
    OptionTable table;
    std::function<TypeSet(const Options&)> factory;
  };
  std::map<Key, Component> components;
  std::map<std::string, Types> types;
};

void Registrar::add_component(std::string_view kind, std::string name, OptionTable table,
                              Factory<Component> factory) {
  const auto [it, added] = target_->components.emplace(
      Key(kind, name), Target::Component{std::move(table), std::move(factory)});
  if (!added) throw plugin_error(fmt::format("it adds {} twice", in_words(kind, name)));
}

void Registrar::add_types(std::string name, OptionTable table,
                          std::function<TypeSet(const Options&)> factory) {
  const auto [it, added] =
      target_->types.emplace(name, Target::Types{std::move(table), std::move(factory)});
  if (!added) throw plugin_error(fmt::format("it adds {} twice", in_words("types", name)));
}

struct Registry::Impl {
  /// One plugin found.
  struct Plugin {
    Sidecar sidecar;
    enum class State { found, loaded } state = State::found;
    bool optimized = true;  // known once it is loaded
    Registrar::Target target;
    OptionValues type_options;
    bool types_made = false;
  };

  /// Held during every call. Recursive: factories make components from the registry.
  mutable std::recursive_mutex mutex;
  std::vector<std::unique_ptr<Plugin>> plugins;
  std::map<Key, std::vector<Plugin*>, std::less<>> index;
  std::vector<PluginProblem> problems;
  std::map<std::string, std::shared_ptr<const VariableType>, std::less<>> variable_types;
  std::map<std::string, std::shared_ptr<const FactorType>, std::less<>> factor_types;

  Plugin& add_plugin(Sidecar sidecar) {
    auto plugin = std::make_unique<Plugin>();
    plugin->sidecar = std::move(sidecar);
    for (const Sidecar::Offered& offer : plugin->sidecar.offers) {
      std::vector<Plugin*>& owners = index[{offer.kind, offer.name}];
      owners.push_back(plugin.get());
      if (owners.size() > 1) {
        problems.push_back({plugin->sidecar.library, conflict(offer.kind, offer.name, owners)});
      }
    }
    plugins.push_back(std::move(plugin));
    return *plugins.back();
  }

  /// What this program adds in one call, as a plugin that is loaded already.
  void add_own(std::vector<Sidecar::Offered> offers, Registrar::Target target) {
    std::set<Key> keys;
    for (const Sidecar::Offered& offer : offers) {
      const auto owners = index.find(Key(offer.kind, offer.name));
      const bool before =
          owners != index.end() && std::ranges::any_of(owners->second, [](const Plugin* owner) {
            return owner->sidecar.library.empty();
          });
      if (before || !keys.emplace(offer.kind, offer.name).second) {
        throw Error(ErrorCode::usage,
                    fmt::format("this program adds {} twice", in_words(offer.kind, offer.name)));
      }
    }
    Sidecar own;
    own.name = kThisProgram;
    own.offers = std::move(offers);
    Plugin& plugin = add_plugin(std::move(own));
    plugin.target = std::move(target);
    plugin.state = Plugin::State::loaded;
    for (const auto& [kind, tag] : keys) {  // a plugin's of that name is handed out no more
      if (kind == "variable") variable_types.erase(tag);
      if (kind == "factor") factor_types.erase(tag);
    }
  }

  static std::string conflict(std::string_view kind, std::string_view name,
                              const std::vector<Plugin*>& owners) {
    std::vector<std::string> files;
    bool own = false;
    for (const Plugin* owner : owners) {
      files.push_back(origin(owner->sidecar));
      own = own || owner->sidecar.library.empty();
    }
    if (own) {
      return fmt::format("{} is offered by {}; give that of this program another name",
                         in_words(kind, name), fmt::join(files, " and by "));
    }
    return fmt::format(
        "{} plugins offer {}: {}; remove one, or take its folder off the search path",
        owners.size(), in_words(kind, name), fmt::join(files, " and "));
  }

  std::vector<std::string> names(std::string_view kind) const {
    std::vector<std::string> result;
    for (const auto& [key, owners] : index) {
      if (key.first == kind) result.push_back(key.second);
    }
    return result;
  }

  Plugin& find(std::string_view kind, std::string_view name) {
    const auto it = index.find(Key(kind, name));
    if (it == index.end()) {
      std::string message = fmt::format("there is no {}{}", in_words(kind, name),
                                        what_is_on_offer(name, names(kind)));
      if (const std::string package = debian_package_with(kind, name); !package.empty())
        message += fmt::format("\n  it is in the Debian package {}", package);
      for (const PluginProblem& problem : problems)
        message += fmt::format("\n  note: {}", problem.message);
      throw UnknownName(message);
    }
    if (it->second.size() > 1) throw plugin_error(conflict(kind, name, it->second));
    return *it->second.front();
  }

  Plugin& load(std::string_view kind, std::string_view name) {
    Plugin& plugin = find(kind, name);
    load(plugin, in_words(kind, name), kind);
    return plugin;
  }

  void load(Plugin& plugin, const std::string& wanted, std::string_view kind) {
    if (plugin.state == Plugin::State::loaded) return;
    const fs::path& library = plugin.sidecar.library;
    if (!fs::exists(library)) {
      std::string others;
      for (const std::string& other : names(kind)) {
        const Plugin& owner = *index.find(Key(kind, other))->second.front();
        const bool there = owner.sidecar.library.empty() || fs::exists(owner.sidecar.library);
        if (&owner != &plugin && there) others += (others.empty() ? "" : ", ") + other;
      }
      throw plugin_error(fmt::format(
          "{} is not available: the shared object {} is missing; build or install plugin "
          "'{}'{}",
          wanted, library.string(), plugin.sidecar.name,
          others.empty() ? "" : ", or choose from what is there: " + others));
    }
    const PluginManifest& manifest = load_plugin(library);
    Registrar::Target target;
    try {
      Registrar registrar(target);
      manifest.register_plugin(registrar);
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      throw plugin_error(fmt::format("{}: plugin '{}' failed while registering: {}",
                                     library.string(), manifest.name, error.what()));
    } catch (...) {
      throw plugin_error(
          fmt::format("{}: plugin '{}' failed while registering", library.string(), manifest.name));
    }
    check_promises(plugin, manifest, target);
    plugin.target = std::move(target);
    plugin.optimized = manifest.optimized;
    plugin.state = Plugin::State::loaded;
  }

  /// Manifest, sidecar and what was really registered must agree. Variables and factors are checked
  /// when the types are made.
  static void check_promises(const Plugin& plugin, const PluginManifest& manifest,
                             const Registrar::Target& target) {
    std::set<Key> promised, announced, kept;
    for (int k = 0; k < manifest.offer_count; ++k)
      promised.emplace(manifest.offers[k].kind, manifest.offers[k].name);
    for (const Sidecar::Offered& offer : plugin.sidecar.offers)
      announced.emplace(offer.kind, offer.name);
    for (const auto& [key, component] : target.components) kept.insert(key);
    for (const auto& [name, types] : target.types) kept.emplace("types", name);
    const std::string file = plugin.sidecar.library.string();
    if (promised != announced) {
      throw plugin_error(
          fmt::format("{}: the file beside it ({}.json) is not of this build: they offer different "
                      "names; build the plugin again",
                      file, plugin.sidecar.library.stem().string()));
    }
    for (const Key& key : promised) {
      if (key.first != "variable" && key.first != "factor" && !kept.contains(key)) {
        throw plugin_error(fmt::format("{}: the plugin offers {} but does not register it", file,
                                       in_words(key.first, key.second)));
      }
    }
    for (const Key& key : kept) {
      if (!promised.contains(key)) {
        throw plugin_error(
            fmt::format("{}: the plugin registers {}, which its manifest does not offer", file,
                        in_words(key.first, key.second)));
      }
    }
  }

  /// Makes all types of a plugin at once, so that they share their options.
  void make_types(Plugin& plugin) {
    if (plugin.types_made) return;
    for (const auto& [name, types] : plugin.target.types) {
      const std::string component = fmt::format("{}: types '{}'", origin(plugin.sidecar), name);
      const Options options(types.table, plugin.type_options, name);
      TypeSet set = call_plugin([&] { return component; },
                                [&, &make = types.factory] { return make(options); });
      for (auto& type : set.variables) {
        check_type_offered(plugin, "variable", type->tag());
        if (!contested("variable", type->tag()))
          variable_types.emplace(type->tag(), std::move(type));
      }
      for (auto& type : set.factors) {
        check_type_offered(plugin, "factor", type->tag());
        if (!contested("factor", type->tag())) factor_types.emplace(type->tag(), std::move(type));
      }
    }
    plugin.types_made = true;
  }

  /// Whether several offer that name; asking for it is then an error.
  bool contested(std::string_view kind, std::string_view name) const {
    const auto it = index.find(Key(kind, name));
    return it != index.end() && it->second.size() > 1;
  }

  void check_type_offered(const Plugin& plugin, std::string_view kind, std::string_view tag) {
    const auto it = index.find(Key(kind, tag));
    if (it == index.end() || std::ranges::find(it->second, &plugin) == it->second.end()) {
      throw plugin_error(fmt::format("{}: the plugin makes {}, which its manifest does not offer",
                                     origin(plugin.sidecar), in_words(kind, tag)));
    }
  }

  template <class Type>
  std::shared_ptr<const Type> type_of(
      std::string_view kind, std::string_view tag,
      std::map<std::string, std::shared_ptr<const Type>, std::less<>>& made) {
    if (const auto it = made.find(tag); it != made.end()) return it->second;
    Plugin& plugin = load(kind, tag);
    make_types(plugin);
    const auto it = made.find(tag);
    if (it == made.end()) {
      throw plugin_error(fmt::format("{}: the plugin offers {} but does not make it",
                                     origin(plugin.sidecar), in_words(kind, tag)));
    }
    return it->second;
  }

  void add_own_type(std::string_view kind, std::string_view tag, const TypeSet& set,
                    std::string summary) {
    const std::lock_guard lock(mutex);
    Registrar::Target target;
    target.types.emplace(tag, Registrar::Target::Types{{}, [set](const Options&) { return set; }});
    add_own({{std::string(kind), std::string(tag), std::move(summary)}}, std::move(target));
  }
};

Registry::Registry() : Registry(PluginSearch{}) {}

Registry::Registry(const PluginSearch& search) : impl_(std::make_unique<Impl>()) {
  std::set<std::string> seen;  // texts: paths are compared part by part, which takes long
  const auto add = [&](const Sidecar& sidecar) {
    std::error_code error;
    const fs::path canonical = fs::weakly_canonical(sidecar.library, error);
    if (error == std::errc::not_enough_memory) throw std::bad_alloc();
    if (seen.insert(canonical.native()).second) impl_->add_plugin(sidecar);
  };
  for (const fs::path& file : search.files) {
    // Named by the user: opened at once, so that what is wrong with it is said at once.
    const PluginManifest& manifest = load_plugin(file);
    Sidecar sidecar{manifest.name,        manifest.version,    manifest.licence,
                    manifest.description, fs::canonical(file), {}};
    for (int k = 0; k < manifest.offer_count; ++k) {
      sidecar.offers.push_back(
          {manifest.offers[k].kind, manifest.offers[k].name, manifest.offers[k].summary});
    }
    add(sidecar);
  }
  for (const fs::path& folder : plugin_folders(search, impl_->problems)) {
    std::vector<fs::path> files;
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      if (entry.path().extension() == ".json") files.push_back(entry.path());
    }
    if (error == std::errc::not_enough_memory) throw std::bad_alloc();
    std::ranges::sort(files, {}, &fs::path::native);
    for (const fs::path& file : files) {
      try {
        add(read_sidecar(file));
      } catch (const Error& problem) {
        impl_->problems.push_back({file, problem.what()});
      }
    }
  }
  if (search.default_folder && impl_->plugins.empty()) {
    impl_->problems.push_back(
        {default_folder(),
         fmt::format("no plugin was found in {}, nor in the folders of CAIRN_PLUGIN_PATH and in "
                     "$XDG_DATA_HOME/cairn/plugins or ~/.local/share/cairn/plugins",
                     default_folder().string())});
  }
}

Registry::~Registry() = default;

std::vector<Offer> Registry::offers() const {
  const std::lock_guard lock(impl_->mutex);
  std::vector<Offer> result;
  for (const auto& plugin : impl_->plugins) {
    const Sidecar& sidecar = plugin->sidecar;
    for (const Sidecar::Offered& offer : sidecar.offers) {
      result.push_back({.kind = offer.kind,
                        .name = offer.name,
                        .summary = offer.summary,
                        .plugin = sidecar.name,
                        .file = sidecar.library,
                        .licence = sidecar.licence,
                        .version = sidecar.version});
    }
  }
  std::ranges::stable_sort(result, [](const Offer& a, const Offer& b) {
    return std::tie(a.kind, a.name) < std::tie(b.kind, b.name);
  });
  return result;
}

std::vector<std::string> Registry::names(std::string_view kind) const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->names(kind);
}
std::vector<PluginProblem> Registry::problems() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->problems;
}
bool Registry::has(std::string_view kind, std::string_view name) const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->index.contains(Key(kind, name));
}

std::unique_ptr<Component> Registry::make_component(std::string_view kind,
                                                    const ComponentSpec& spec) {
  const std::lock_guard lock(impl_->mutex);
  Impl::Plugin& plugin = impl_->load(kind, spec.name);
  const auto& component = plugin.target.components.at(Key(kind, spec.name));
  const Options options(component.table, spec.values, spec.name);
  std::unique_ptr<Component> made = call_plugin(
      [&] { return plugin.sidecar.library.string() + ": " + in_words(kind, spec.name); },
      [&] { return component.factory(options, *this); });
  if (!made) {
    throw plugin_error(fmt::format("{}: the plugin made nothing for {}", origin(plugin.sidecar),
                                   in_words(kind, spec.name)));
  }
  return made;
}

const OptionTable& Registry::options(std::string_view kind, std::string_view name) {
  const std::lock_guard lock(impl_->mutex);
  Impl::Plugin& plugin = impl_->load(kind, name);
  if (const auto it = plugin.target.components.find(Key(kind, name));
      it != plugin.target.components.end()) {
    return it->second.table;
  }
  if (const auto it = plugin.target.types.find(std::string(name));
      kind == "types" && it != plugin.target.types.end()) {
    return it->second.table;
  }
  static const OptionTable none;  // a single variable or factor type has no options of its own
  return none;
}

void Registry::set_type_options(const ComponentSpec& spec) {
  const std::lock_guard lock(impl_->mutex);
  Impl::Plugin& plugin = impl_->load("types", spec.name);
  if (plugin.types_made) {
    throw Error(ErrorCode::usage,
                fmt::format("options of types '{}' come too late: its types are in use already",
                            spec.name));
  }
  // Making them checks them.
  [[maybe_unused]] const Options checked(plugin.target.types.at(spec.name).table, spec.values,
                                         spec.name);
  for (const auto& [key, value] : spec.values) plugin.type_options[key] = value;
}

std::shared_ptr<const VariableType> Registry::variable_type(std::string_view tag) {
  const std::lock_guard lock(impl_->mutex);
  return impl_->type_of("variable", tag, impl_->variable_types);
}

std::shared_ptr<const FactorType> Registry::factor_type(std::string_view tag) {
  const std::lock_guard lock(impl_->mutex);
  return impl_->type_of("factor", tag, impl_->factor_types);
}

std::vector<std::string> Registry::unoptimized() const {
  std::vector<std::string> names;
  for (const auto& plugin : impl_->plugins) {
    if (!plugin->optimized) names.push_back(plugin->sidecar.name);
  }
  return names;
}

void Registry::load_all() {
  const std::lock_guard lock(impl_->mutex);
  for (const auto& plugin : impl_->plugins) {
    impl_->load(*plugin, fmt::format("plugin '{}'", plugin->sidecar.name),
                plugin->sidecar.offers.empty() ? "" : plugin->sidecar.offers.front().kind);
  }
}

void Registry::add_component(std::string_view kind, std::string name, OptionTable table,
                             Registrar::Factory<Component> factory, std::string summary) {
  const std::lock_guard lock(impl_->mutex);
  Registrar::Target target;
  target.components.emplace(Key(kind, name),
                            Registrar::Target::Component{std::move(table), std::move(factory)});
  impl_->add_own({{std::string(kind), std::move(name), std::move(summary)}}, std::move(target));
}

void Registry::add(std::shared_ptr<const VariableType> type, std::string summary) {
  if (!type) throw Error(ErrorCode::usage, "there is no variable type to add: it is null");
  impl_->add_own_type("variable", type->tag(), {{type}, {}}, std::move(summary));
}

void Registry::add(std::shared_ptr<const FactorType> type, std::string summary) {
  if (!type) throw Error(ErrorCode::usage, "there is no factor type to add: it is null");
  impl_->add_own_type("factor", type->tag(), {{}, {type}}, std::move(summary));
}

void Registry::add_types(std::string name, OptionTable table,
                         std::function<TypeSet(const Options&)> factory, std::string summary) {
  const std::lock_guard lock(impl_->mutex);
  const TypeSet types = factory(Options(table, {}, name));
  std::vector<Sidecar::Offered> offers = {{"types", name, std::move(summary)}};
  for (const auto& type : types.variables)
    offers.push_back({"variable", std::string(type->tag()), "of types '" + name + "'"});
  for (const auto& type : types.factors)
    offers.push_back({"factor", std::string(type->tag()), "of types '" + name + "'"});
  Registrar::Target target;
  target.types.emplace(std::move(name),
                       Registrar::Target::Types{std::move(table), std::move(factory)});
  impl_->add_own(std::move(offers), std::move(target));
}

Registry& default_registry() {
  static Registry registry;
  return registry;
}

}  // namespace cairn
