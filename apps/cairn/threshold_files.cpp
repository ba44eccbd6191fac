// SPDX-License-Identifier: BSD-3-Clause
#include "threshold_files.hpp"

#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"
#include "json_text.hpp"

namespace cairn::app {

namespace json = boost::json;

OptionValues read_thresholds(const std::string& file, const std::string& policy) {
  const std::string text = read_file(file);
  try {
    const json::value value = json::parse(text);
    const json::object& all = value.as_object();
    if (const json::value* command = all.if_contains("command"); command && all.contains("cairn")) {
      throw Error(
          ErrorCode::input,
          fmt::format("{}: this is the report of a run of cairn {} (--json), not thresholds; "
                      "give a file that cairn compact --save-thresholds has written",
                      file, std::string_view(command->as_string())));
    }
    if (const auto& name = all.at("policy").as_string(); name != policy) {
      throw Error(ErrorCode::input, fmt::format("{}: thresholds of policy '{}', not of '{}'", file,
                                                std::string_view(name), policy));
    }
    OptionValues values;
    for (const auto& [name, option] : all.at("options").as_object())
      values[name] = std::string(option.as_string());
    return values;
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    throw Error(ErrorCode::input,
                fmt::format("{}: no thresholds; expected what --save-thresholds writes, "
                            "{{\"policy\": \"{}\", \"options\": {{\"range\": \"2.5\", …}}}}",
                            file, policy));
  }
}

void write_thresholds(const std::string& file, const std::string& policy,
                      const OptionValues& options) {
  json::object all;
  for (const auto& [name, value] : options) all[name] = value;
  write_file(file, json_text(json::object{{"policy", policy}, {"options", std::move(all)}}) + "\n");
}

}  // namespace cairn::app
