// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/policy/saved_thresholds.hpp"

#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <boost/json/parse.hpp>
#include <boost/json/serialize.hpp>

#include "cairn/io/format.hpp"
#include "cairn/runtime/error.hpp"

namespace cairn {

namespace json = boost::json;

SavedThresholds read_thresholds(const std::string& file, const std::string& policy) {
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
    SavedThresholds thresholds;
    for (const auto& [name, option] : all.at("options").as_object())
      thresholds.options[name] = std::string(option.as_string());
    if (const json::value* poses = all.if_contains("poses")) {
      const std::int64_t* count = poses->if_int64();
      if (!count || *count < 0) {
        throw Error(ErrorCode::input,
                    fmt::format("{}: poses is {}, expected the number of those in "
                                "which the thresholds were found",
                                file, json::serialize(*poses)));
      }
      thresholds.poses = *count;
    }
    return thresholds;
  } catch (const Error&) {
    throw;
  } catch (const std::exception&) {
    throw Error(ErrorCode::input,
                fmt::format("{}: no thresholds; expected what --save-thresholds writes, "
                            "{{\"policy\": \"{}\", \"options\": {{\"range\": \"2.5\", …}}}}",
                            file, policy));
  }
}

}  // namespace cairn
