// SPDX-License-Identifier: BSD-3-Clause
#include "manual_page.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "cairn/program/table.hpp"
#include "cairn/runtime/version.hpp"
#include "help.hpp"
#include "option_parser.hpp"

namespace cairn::app {
namespace {

/// The code point that begins at `k`, which is moved to its last byte. Precondition: valid UTF-8.
std::uint32_t code_point(std::string_view text, std::size_t& k) {
  const auto lead = static_cast<unsigned char>(text[k]);
  const int more = lead >= 0xf0 ? 3 : lead >= 0xe0 ? 2 : 1;
  std::uint32_t point = lead & (0x3fU >> more);
  for (int n = 0; n < more && k + 1 < text.size(); ++n)
    point = point << 6U | (static_cast<unsigned char>(text[++k]) & 0x3fU);
  return point;
}

/// The text as roff prints it: no character stands for anything but itself, and what is copied from
/// the page can be typed.
std::string roff(std::string_view text) {
  std::string out;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    switch (c) {
      case '\\':
        out += "\\(rs";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      case '"':
        out += "\\(dq";
        break;
      case ',':  // a line may end there: what is typed is long and has no blanks
        out += ",\\:";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x80U)
          out += c;
        else
          out += fmt::format("\\[u{:04X}]", code_point(text, k));
    }
  }
  return out.starts_with('.') ? "\\&" + out : out;
}

std::string strong(std::string_view text) { return "\\fB" + roff(text) + "\\fR"; }
std::string slanted(std::string_view text) { return "\\fI" + roff(text) + "\\fR"; }

/// "-o, --output OUT", or "GRAPH" of a positional argument.
std::string head(const OptionSpec& option) {
  if (option.form.positional) return slanted(value_name(option));
  const std::string letter = short_name(option);
  const std::string text =
      (letter.empty() ? "" : strong(letter) + ", ") + strong(long_name(option));
  return is_flag(option) ? text : text + " " + slanted(value_name(option));
}

/// The line of a table as a sentence.
std::string sentence(std::string text) {
  if (text.empty()) return text;
  const bool is_name = text.starts_with("cairn ");
  if (!is_name) text.front() = static_cast<char>(std::toupper(text.front()));
  return std::string_view(".!?").find(text.back()) != std::string_view::npos ? text : text + ".";
}

/// What is known of its value besides: the default, the choices, the kinds of component.
std::string about_value(const OptionSpec& option) {
  std::string text;
  if (const std::string value = shown_default(option); !value.empty())
    text += "Default: " + strong(value) + ".\n";
  const bool is_component = option.type == OptionType::component;
  if (!is_component && !option.choices.empty()) {
    std::vector<std::string> choices;
    for (const std::string& choice : option.choices) choices.push_back(strong(choice));
    text += "One of " + joined(choices, ", ") + ".\n";
  }
  for (const std::string& kind : is_component ? option.choices : std::vector<std::string>()) {
    std::string in_words = kind;
    std::ranges::replace(in_words, '_', ' ');
    text += "Names of kind " + roff(in_words) + ": " + strong("cairn plugins") + ".\n";
  }
  return text;
}

std::string item(const OptionSpec& option) {
  return ".TP\n" + head(option) + "\n" + roff(sentence(option.help)) + "\n" + about_value(option);
}

std::string arguments(const CommandEntry& command) {
  std::string text;
  for (const OptionSpec& option : command.options()) {
    if (option.form.positional) text += item(option);
  }
  return text;
}

std::string options(const CommandEntry& command) {
  std::string text;
  for (const OptionSpec& option : command.options()) {
    if (!option.form.positional) text += item(option);
  }
  return text;
}

std::string section(const std::string& title, const std::string& text) {
  return text.empty() ? "" : ".SH " + title + "\n" + text;
}

/// The footer of the help: paragraphs, and below "Example:" commands, indented, with notes.
struct Footer {
  std::string notes;
  std::string examples;
};

Footer parts_of(const std::string& footer) {
  Footer parts;
  bool in_example = false;
  bool was_code = false;
  std::istringstream lines(footer);
  for (std::string line; std::getline(lines, line);) {
    if (line == "Example:") {
      in_example = true;
      continue;
    }
    std::string& text = in_example ? parts.examples : parts.notes;
    const bool is_code = line.starts_with("  ");
    if (is_code && !was_code) text += ".PP\n.nf\n.RS 4\n";
    if (!is_code && was_code) text += ".RE\n.fi\n.PP\n";
    was_code = is_code;
    if (line.empty())
      text += ".PP\n";
    else
      text += roff(line.substr(is_code ? 2 : 0)) + "\n";
  }
  if (was_code) (in_example ? parts.examples : parts.notes) += ".RE\n.fi\n";
  while (parts.notes.ends_with(".PP\n")) parts.notes.resize(parts.notes.size() - 4);
  return parts;
}

std::string synopsis(const Program& program, const CommandEntry& command) {
  const std::string name = full_name(command);
  if (!program.below(command).empty())
    return strong(name) + " " + slanted("COMMAND") + " [" + slanted("OPTIONS") + "]\n";
  return strong(name) + roff(usage_line(command).substr(name.size())) + "\n";
}

/// The summary that `whatis` and `apropos` search.
std::string summary(const CommandEntry& command) {
  const std::string& text = command.summary();
  return text.starts_with("cairn: ") ? text.substr(7) : text;
}

std::string command_list(const Program& program, const CommandEntry& command) {
  std::string text;
  for (const CommandEntry* each : program.below(command)) {
    text += ".TP\n.BR " + roff(manual_page_name(*each)) + " (1)\n" +
            roff(sentence(each->summary())) + "\n";
  }
  return text;
}

std::string exit_codes() {
  std::string text;
  const std::pair<const char*, const char*> codes[] = {
      {"0", "success"},
      {"2", "usage: the command line cannot be understood"},
      {"3", "input: a file cannot be read or written, or is wrong"},
      {"4", "numerical: not converged, among others"},
      {"5", "plugin: one is missing, unknown or wrong"},
      {"130", "interrupted; the best estimate so far is written, if there is one"}};
  for (const auto& [code, meaning] : codes)
    text += ".TP\n" + strong(code) + "\n" + roff(sentence(meaning)) + "\n";
  return text;
}

std::string environment() {
  return ".TP\n.B CAIRN_PLUGIN_PATH\nFolders of plugins, with colons between them.\n"
         ".TP\n.B XDG_DATA_HOME\nThe user\\(aqs plugins are in the folder cairn/plugins of it; "
         "where it is not set, in \\(ti/.local/share/cairn/plugins.\n"
         ".TP\n.B NO_COLOR\nIf set and not empty, nothing is coloured.\n";
}

/// The page of the command that it belongs to, that of the program, and two that everybody needs.
std::string see_also(const Program& program, const CommandEntry& command) {
  const std::string own = manual_page_name(command);
  std::vector<std::string> names;
  const std::size_t blank = command.name().find(' ');
  if (blank != std::string::npos) names.push_back("cairn-" + command.name().substr(0, blank));
  if (!program.is_self(command)) names.emplace_back("cairn");
  for (const char* name : {"cairn-plugins", "cairn-optimize"}) {
    if (own != name) names.emplace_back(name);
  }
  std::string text;
  for (const std::string& name : names)
    text += ".BR " + roff(name) + " (1)" + (&name == &names.back() ? "" : ",") + "\n";
  return text;
}

}  // namespace

std::string manual_page_name(const CommandEntry& command) {
  std::string name = full_name(command);
  std::ranges::replace(name, ' ', '-');
  return name;
}

std::string manual_page(const Program& program, const CommandEntry& command) {
  const std::string name = manual_page_name(command);
  std::string title = name;
  std::ranges::transform(title, title.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  const bool is_program = program.is_self(command);
  const Footer footer = parts_of(command.footer());
  const std::string own =
      item(help_flag()) + (is_program ? item(version_flag()) : "") + options(command);
  return ".\\\" Written by cairn help --man.\n.TH " + roff(title) +
         " 1 \"\" \"cairn " CAIRN_VERSION "\" \"User Commands\"\n.ad l\n.nh\n" +
         section("NAME", roff(name) + " \\- " + roff(summary(command)) + "\n") +
         section("SYNOPSIS", synopsis(program, command)) +
         section("DESCRIPTION", roff(sentence(summary(command))) + "\n" +
                                    (footer.notes.empty() ? "" : ".PP\n" + footer.notes)) +
         section("COMMANDS", command_list(program, command)) +
         section("ARGUMENTS", arguments(command)) +
         section(is_program ? "OPTIONS OF EVERY COMMAND" : "OPTIONS", own) +
         (is_program ? "" : section("OPTIONS OF EVERY COMMAND", options(program.self))) +
         section("EXIT STATUS", exit_codes()) + section("ENVIRONMENT", environment()) +
         section("EXAMPLES", footer.examples) + section("SEE ALSO", see_also(program, command));
}

}  // namespace cairn::app
