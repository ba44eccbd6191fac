// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <concepts>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/plugin/option_fields.hpp"
#include "cairn/plugin/options.hpp"
#include "cairn/runtime/api.hpp"
#include "cairn/runtime/component.hpp"
#include "cairn/types/factor_type.hpp"
#include "cairn/types/variable_type.hpp"

namespace cairn {

class Registry;
struct Offer;  // these three: plugin_search.hpp
struct PluginProblem;
struct PluginSearch;

/// Variable and factor types that a types plugin makes, given its options.
struct TypeSet {
  std::vector<std::shared_ptr<const VariableType>> variables;
  std::vector<std::shared_ptr<const FactorType>> factors;
};

/// What a plugin's `register_plugin` function is given: it adds what the plugin's manifest
/// declares. Adding what the manifest does not name, or leaving out what it names, is an error of
/// the plugin.
class CAIRN_API Registrar {
 public:
  template <class Interface>
  using Factory = std::function<std::unique_ptr<Interface>(const Options&, Registry&)>;

  /// Adds a component of kind `Interface::kKind`. The factory is given checked options; if its
  /// component needs others, it makes them from the registry at once (a component must not keep the
  /// registry).
  template <class Interface>
  void add(std::string name, OptionTable table, Factory<Interface> factory) {
    add_component(Interface::kKind, std::move(name), std::move(table),
                  [factory = std::move(factory)](const Options& options, Registry& registry)
                      -> std::unique_ptr<Component> { return factory(options, registry); });
  }

  /// Adds a component whose options are a struct (`OptionFields`), which the factory is given:
  /// called as `factory(options, registry)`, or `factory(options)` if it takes no registry.
  template <class Interface, OptionStruct Struct, class MakeComponent>
  void add(std::string name, MakeComponent factory) {
    add_component(Interface::kKind, std::move(name), Struct::fields().table(),
                  [factory = std::move(factory)](const Options& options,
                                                 Registry& registry) -> std::unique_ptr<Component> {
                    const Struct chosen = Struct::fields().read(options);
                    std::unique_ptr<Interface> made;
                    if constexpr (std::invocable<const MakeComponent&, const Struct&, Registry&>) {
                      made = factory(chosen, registry);
                    } else {
                      made = factory(chosen);
                    }
                    return made;
                  });
  }

  /// Adds a set of types under the name of the plugin (kind "types"); options of it are given with
  /// `Registry::set_type_options`. Their tags are the manifest's "variable" and "factor" offers.
  void add_types(std::string name, OptionTable table,
                 std::function<TypeSet(const Options&)> factory);
  /// Likewise with options that are a struct.
  template <OptionStruct Struct>
  void add_types(std::string name, std::function<TypeSet(const Struct&)> factory) {
    add_types(std::move(name), Struct::fields().table(),
              [factory = std::move(factory)](const Options& options) {
                return factory(Struct::fields().read(options));
              });
  }

 private:
  friend class Registry;
  struct Target;
  explicit Registrar(Target& target) : target_(&target) {}
  void add_component(std::string_view kind, std::string name, OptionTable table,
                     Factory<Component> factory);
  Target* target_;
};

/// Finds plugins and makes components by kind and name.
///
/// The constructor reads the small JSON file beside each shared object and opens none of them (only
/// those named by file are opened, since a user who names one wants to know at once). A plugin is
/// loaded when one of its names is asked for, and never unloaded: its objects may outlive the
/// registry. A program adds components and types of its own with `add` and `add_types`: these need
/// no shared object. A name that is offered twice is an error, with both origins, when it is asked
/// for; other names are not affected. All errors are `Error` (plugin or usage) and say what is on
/// offer.
///
/// Thread-safe: calls wait for each other, also while a factory makes a component. What was made is
/// not guarded by the registry any more.
class CAIRN_API Registry {
 public:
  /// Of the plugins that are found where `PluginSearch` looks by default.
  Registry();
  explicit Registry(const PluginSearch& search);
  Registry(const Registry&) = delete;
  Registry& operator=(const Registry&) = delete;
  ~Registry();

  /// All names on offer, sorted by kind and name.
  std::vector<Offer> offers() const;
  /// Names of one kind, sorted.
  std::vector<std::string> names(std::string_view kind) const;
  std::vector<PluginProblem> problems() const;

  // What this program adds
  // -------------------------------------------------------------------------
  /// Adds a component of kind `Interface::kKind`; `factory` as for `Registrar::add`. `summary` is a
  /// line for listings. Throws `Error` (usage) if this program has added that name before.
  ///
  ///     registry.add<LinearSolver>("mine", {}, [](const Options&, Registry&) {
  ///       return std::make_unique<Mine>();
  ///     });
  template <class Interface>
  void add(std::string name, OptionTable table, Registrar::Factory<Interface> factory,
           std::string summary = {}) {
    add_component(
        Interface::kKind, std::move(name), std::move(table),
        [factory = std::move(factory)](const Options& options, Registry& registry)
            -> std::unique_ptr<Component> { return factory(options, registry); },
        std::move(summary));
  }
  /// Adds one type under its tag, also for reading files that hold it:
  /// add(define_factor<Range>()). Throws `Error` (usage) for null, or a tag that this program has
  /// added before.
  void add(std::shared_ptr<const VariableType> type, std::string summary = {});
  void add(std::shared_ptr<const FactorType> type, std::string summary = {});
  /// Adds types that take options (`set_type_options`) under the name of their set. `factory` is
  /// called with the defaults at once, for the tags, and again when the first type is asked for.
  void add_types(std::string name, OptionTable table,
                 std::function<TypeSet(const Options&)> factory, std::string summary = {});

  /// Makes a component: `make<LinearSolver>("cholmod:ordering=metis")`.
  template <class Interface>
  std::unique_ptr<Interface> make(std::string_view spec) {
    return make<Interface>(parse_component(spec));
  }
  template <class Interface>
  std::unique_ptr<Interface> make(const ComponentSpec& spec) {
    return std::unique_ptr<Interface>(
        static_cast<Interface*>(make_component(Interface::kKind, spec).release()));
  }
  /// `make<Optimizer>("dogleg", DoglegOptions{.initial_radius = 10.0})`; every option has the
  /// value that the struct has.
  template <class Interface, OptionStruct Struct>
  std::unique_ptr<Interface> make(std::string_view name, const Struct& options) {
    return make<Interface>(to_spec(name, options));
  }

  /// A component of any kind, for what is done with all alike.
  std::unique_ptr<Component> make_any(std::string_view kind, const ComponentSpec& spec) {
    return make_component(kind, spec);
  }

  /// The options that a name takes; loads its plugin.
  const OptionTable& options(std::string_view kind, std::string_view name);

  /// Options of a types plugin (`slam3d:metric=g2o`). Throws if its types were already handed out.
  void set_type_options(const ComponentSpec& spec);
  /// The type with that tag. Throws `Error` (plugin) with the tags on offer.
  std::shared_ptr<const VariableType> variable_type(std::string_view tag);
  std::shared_ptr<const FactorType> factor_type(std::string_view tag);
  /// Whether some plugin offers that name.
  bool has(std::string_view kind, std::string_view name) const;

  /// Names of the plugins loaded so far whose code was compiled without optimisation: right, but
  /// many times slower.
  std::vector<std::string> unoptimized() const;

  /// Loads every plugin on offer, for listings of options and for conformance tests.
  void load_all();

 private:
  std::unique_ptr<Component> make_component(std::string_view kind, const ComponentSpec& spec);
  void add_component(std::string_view kind, std::string name, OptionTable table,
                     Registrar::Factory<Component> factory, std::string summary);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The registry that short forms such as `optimize` use: one for the process, with the plugins that
/// are found where `PluginSearch` looks by default, made when it is first asked for. Global,
/// because what is installed is a property of the process, and because graphs, files and estimators
/// fit together only if their types come from one registry. A program that wants another passes it
/// on.
CAIRN_API Registry& default_registry();

}  // namespace cairn
