// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz/mutations.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <random>

namespace cairn::test {
namespace {

using Fields = std::vector<std::string>;

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::string part;
  for (const char c : text) {
    if (c == separator) {
      parts.push_back(part);
      part.clear();
    } else {
      part += c;
    }
  }
  if (!part.empty()) parts.push_back(part);
  return parts;
}

std::string join(const std::vector<std::string>& parts, const std::string& separator) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) text += (i ? separator : "") + parts[i];
  return text;
}

/// What the fields of a line are, by tag.
struct Shape {
  bool tag;          ///< the first field is a tag
  int ids;           ///< after the tag; a parameter's id among them
  int variable_ids;  ///< those of them that name a variable
  bool edge;         ///< names variables that stand elsewhere
  int information;   ///< numbers at the end
};

Shape shape_of(const Seed& seed, const Fields& fields) {
  const std::string& tag = fields[0];
  if (std::isalpha(static_cast<unsigned char>(tag[0])) == 0) {
    if (seed.format == "bal" && fields.size() == 3) return {false, 3, 0, false, 0};  // its header
    if (seed.format == "bal" && fields.size() == 4) return {false, 2, 0, true, 0};
    return {false, seed.name == "table" ? 1 : 0, 0, false, 0};
  }
  if (tag == "FIX") return {true, 1, 1, true, 0};
  if (tag.starts_with("PARAMS")) return {true, 1, 0, false, 0};
  if (tag.starts_with("VERTEX")) return {true, 1, 1, false, 0};
  const int fields_after_tag = static_cast<int>(fields.size()) - 1;
  if (tag == "EDGE_SE3_TRACKXYZ") return {true, 3, 2, true, 6};
  if (tag == "EDGE_PRIOR_SE2") return {true, 1, 1, true, 6};
  if (tag == "EDGE_SE2_XY") return {true, 2, 2, true, 3};
  if (tag == "LANDMARK") return {true, 2, 2, true, fields_after_tag == 7 ? 3 : 6};
  return {true, 2, 2, true, fields_after_tag > 20 ? 21 : 6};
}

/// Collects mutants of one line.
class LineMutator {
 public:
  LineMutator(const Seed& seed, const std::vector<std::string>& lines, std::size_t line,
              std::vector<Mutant>& out)
      : seed_(seed),
        lines_(lines),
        line_(line),
        fields_(split(lines[line], ' ')),
        out_(out),
        shape_(shape_of(seed, fields_)) {}

  void run() {
    change_counts();
    if (shape_.tag) change_tags();
    for (std::size_t f = shape_.tag ? 1 : 0; f < fields_.size(); ++f) garble(f);
    for (int k = 0; k < shape_.ids; ++k)
      change_id(static_cast<std::size_t>(k) + (shape_.tag ? 1 : 0));
    if (shape_.edge) change_ends();
    if (shape_.information > 0) spoil_information();
    // A parameter may be given again as it is.
    if (!shape_.edge && shape_.variable_ids == 1) repeat_line();
    spoil_rotation();
  }

 private:
  void add(const std::string& what, const std::string& text) {
    std::vector<std::string> changed = lines_;
    changed[line_] = text;
    out_.push_back({seed_.name + ", line " + std::to_string(line_ + 1) + ": " + what,
                    join(changed, "\n") + "\n", static_cast<int>(line_) + 1});
  }
  void add_field(const std::string& what, std::size_t field, const std::string& value) {
    Fields changed = fields_;
    changed[field] = value;
    add(what + " in field " + std::to_string(field), join(changed, " "));
  }

  void change_counts() {
    if (fields_[0] == "FIX") {  // takes any number of ids but none
      add("no ids", "FIX");
      return;
    }
    const std::size_t first = shape_.tag ? 1 : 0;
    // A row of a table has 3 or 4 fields, by the first row.
    const bool either_count = seed_.format == "table";
    for (std::size_t f = first; f < fields_.size(); ++f) {
      if (either_count) break;
      if (fields_.size() == 1) break;  // an empty line is allowed
      Fields dropped = fields_;
      dropped.erase(dropped.begin() + static_cast<std::ptrdiff_t>(f));
      add("field " + std::to_string(f) + " dropped", join(dropped, " "));
    }
    for (const std::size_t f : {first, fields_.size() - 1}) {
      Fields doubled = fields_;
      doubled.insert(doubled.begin() + static_cast<std::ptrdiff_t>(f), fields_[f]);
      add("field " + std::to_string(f) + " doubled", join(doubled, " "));
    }
    // Down to the tag alone; a row without a tag would be an empty line, which is allowed.
    for (std::size_t left = 1; left + 1 < fields_.size(); left += 3) {
      if (either_count && left == 3) continue;
      add("cut after field " + std::to_string(left - 1),
          join(Fields(fields_.begin(), fields_.begin() + static_cast<std::ptrdiff_t>(left)), " "));
    }
    add("two lines joined", lines_[line_] + " " + lines_[line_]);
  }

  void change_tags() {
    add_field("tag of nobody", 0, "NOBODY");
    add_field("tag in lower case", 0, [&] {
      std::string tag = fields_[0];
      for (char& c : tag) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      return tag;
    }());
    add_field("tag with a byte too many", 0, fields_[0] + "\x01");
    const bool all_ids =
        std::all_of(fields_.begin() + 1, fields_.end(), [](const std::string& field) {
          return field.find_first_not_of("0123456789") == std::string::npos;
        });
    if (!all_ids) add_field("another tag", 0, "FIX");
    add("no tag", join(Fields(fields_.begin() + 1, fields_.end()), " "));
  }

  void garble(std::size_t f) {
    for (const char* bad :
         {"nan", "-inf", "1e999", "x", "0x10", "1,5", "1.5.5", "--1", "1e", "\xff\xfe", "1_0"}) {
      add_field(std::string("'") + bad + "'", f, bad);
    }
    add_field("a zero byte", f, std::string(1, '\0'));
    add_field("a letter at the end", f, fields_[f] + "f");
  }

  void change_id(std::size_t f) {
    for (const char* bad : {"-1", "1.5", "1e0", "9223372036854775808", "0.0"})
      add_field(bad, f, bad);
  }

  /// Only where the file has vertices is an edge to another id certainly wrong.
  void change_ends() {
    if (!seed_.vertices) return;
    for (int k = 0; k < shape_.ids; ++k) {
      add_field("an id of nothing", static_cast<std::size_t>(k) + (shape_.tag ? 1 : 0),
                "987654321");
    }
    if (shape_.variable_ids == 2) add_field("an edge to itself", 2, fields_[1]);
  }

  void spoil_information() {
    const std::size_t first = fields_.size() - static_cast<std::size_t>(shape_.information);
    const bool root = seed_.format == "isam";
    // The first diagonal entry, in every format. A negative root squares to the same.
    // A zero is no fault where the rest of the row is zero too: the information is semidefinite.
    if (!root && fields_[first + 1] != "0") add_field("zero information", first, "0");
    if (!root) add_field("negative information", first, "-5");
    // Of a factor without any information no line is at fault: it has no effect.
    if (!root) add_field("a large entry beside the diagonal", first + 1, "1e6");
  }

  /// A vertex given twice: the copy is what is wrong.
  void repeat_line() {
    std::vector<std::string> changed = lines_;
    changed.insert(changed.begin() + static_cast<std::ptrdiff_t>(line_) + 1, lines_[line_]);
    out_.push_back({seed_.name + ", line " + std::to_string(line_ + 1) + ": repeated",
                    join(changed, "\n") + "\n", static_cast<int>(line_) + 2});
  }

  void spoil_rotation() {
    const bool spatial = fields_[0] == "VERTEX_SE3:QUAT" || fields_[0] == "EDGE_SE3:QUAT" ||
                         fields_[0] == "PARAMS_SE3OFFSET";
    if (spatial || seed_.format == "tum") {
      const std::size_t q =
          seed_.format == "tum" ? 4 : static_cast<std::size_t>(1 + shape_.ids + 3);
      Fields zero = fields_;
      std::fill_n(zero.begin() + static_cast<std::ptrdiff_t>(q), 4, "0");
      add("a quaternion of zeros", join(zero, " "));
    }
    if (seed_.format == "kitti") {
      add_field("no rotation", 0, "7");
      add_field("no rotation", 5, "-0.5");
    }
  }

  const Seed& seed_;
  const std::vector<std::string>& lines_;
  std::size_t line_;
  Fields fields_;
  std::vector<Mutant>& out_;
  Shape shape_;
};

}  // namespace

const std::vector<Seed>& seeds() {
  static const std::vector<Seed> all = {
      {"planar", "g2o",
       "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0.5 0.25\nVERTEX_SE2 2 2 0.5 -3\nVERTEX_XY 3 1 1\n"
       "EDGE_SE2 0 1 1 0.5 0.25 10 1 2 20 3 30\nEDGE_SE2 2 1 -1 0.1 3 10 0 0 10 0 10\n"
       "EDGE_SE2_XY 0 3 1 1 4 1 4\nEDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1\nFIX 0\n",
       true},
      {"spatial", "g2o",
       "PARAMS_SE3OFFSET 0 0.1 0.2 0.3 0 0 0.6 0.8\n"
       "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0.6 0.8\nVERTEX_TRACKXYZ 2 1 "
       "2 3\n"
       "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0.6 0.8 9 1 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9\n"
       "EDGE_SE3_TRACKXYZ 1 2 0 1 2 3 5 1 0 5 0 5\n",
       true},
      {"edges only", "g2o",
       "EDGE_SE2 0 1 1 0.5 0.25 10 1 2 20 3 30\nEDGE_SE2 1 2 1 0 0.25 10 1 2 20 3 30\n", false},
      {"toro", "toro",
       "VERTEX2 0 0 0 0\nVERTEX2 1 1 0 0\nEDGE2 0 1 1 0 0 50 1 60 70 2 3\nEDGE2 1 0 -1 0 0 50 0 60 "
       "70 0 0\n",
       true},
      {"toro spatial", "toro",
       "VERTEX3 0 0 0 0 0 0 0\nVERTEX3 1 1 0 0 0.1 0.2 0.3\n"
       "EDGE3 0 1 1 0 0 0.1 0.2 0.3 9 1 0 0 0 0 9 0 0 0 0 9 0 0 0 9 0 0 9 0 9\n",
       true},
      {"slam++", "toro",
       "VERTEX2 0 0 0 0\nODOMETRY 1 0 -1 0 0 100 0 500 500 0 0\nVERTEX2 1 1 0 0\n"
       "LANDMARK 2 1 5 -0.5 0 100 0 1000 0 0 99999\nVERTEX2 2 5.4 -2.4 0\n",
       true},
      {"isam planar", "isam",
       "ODOMETRY 0 1 1 0 0 50 1 2 50 3 100\nEDGE2 1 2 1 0 0 50 0 0 50 0 100\nLANDMARK 1 7 2 3 10 1 "
       "10\n",
       false},
      {"isam spatial", "isam",
       "EDGE3 0 1 1 0 0 0.1 0.2 0.3 10 0 0 0 0 0 10 0 0 0 0 10 0 0 0 100 0 0 100 0 25\n"
       "EDGE3 1 2 1 0 0 0.1 0.2 0.3 10 0 0 0 0 0 10 0 0 0 0 10 0 0 0 100 0 0 100 0 25\n",
       false},
      {"bal", "bal",
       "2 2 3\n0 0 -10.5 20.25\n1 0 3 4\n1 1 -5 1e1\n0.1\n-0.2\n0.3\n1\n2\n-3\n500\n-1e-2\n0.5\n"
       "0\n0\n0\n0.5\n0.25\n-2\n600\n0\n0\n1.5\n-2\n-30\n0.1\n0.2\n-9.5\n",
       true},
      {"tum", "tum", "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0.6 0.8\n2 1.5 2 3 0 0 0 1\n", false},
      {"kitti", "kitti", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 7 1 0 0 8 0 0 1 9\n", false},
      {"table", "table", "0 1 2 0.5\n1 2 2 0.5\n2 3 2 0.5\n", false},
  };
  return all;
}

std::vector<Mutant> mutants(const Seed& seed) {
  std::vector<Mutant> out;
  const std::vector<std::string> lines = split(seed.text, '\n');
  for (std::size_t line = 0; line < lines.size(); ++line) LineMutator(seed, lines, line, out).run();
  return out;
}

std::vector<std::string> scrambled(const Seed& seed, int count) {
  std::vector<std::string> texts;
  std::mt19937_64 engine(20060131);
  const auto below = [&engine](std::size_t n) { return static_cast<std::size_t>(engine() % n); };
  const std::vector<std::string> words = {
      "nan",      "-1", "1e308", "VERTEX2", "EDGE_SE2", "EDGE3", "FIX",
      "#",        "\r", "\n",    "\n\n",    "0",        "-0",    "9223372036854775807",
      "LANDMARK", " ",  "\t",    "+"};
  for (int i = 0; i < count; ++i) {
    std::string text = seed.text;
    for (std::size_t n = 1 + below(4); n > 0 && !text.empty(); --n) {
      const std::size_t at = below(text.size()), length = 1 + below(20);
      switch (below(5)) {
        case 0:
          text[at] = static_cast<char>(below(256));
          break;
        case 1:
          text.erase(at, length);
          break;
        case 2:
          text.insert(below(text.size()), text.substr(at, length));
          break;
        case 3:
          text.insert(at, words[below(words.size())]);
          break;
        default:
          text.resize(at);
          break;
      }
    }
    texts.push_back(std::move(text));
  }
  return texts;
}

}  // namespace cairn::test
