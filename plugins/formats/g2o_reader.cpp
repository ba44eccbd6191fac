// SPDX-License-Identifier: BSD-3-Clause
// g2o text. Each line is a tag, ids, the numbers of the state or measurement, and the upper
// triangle of the information row by row. Tags are those of the types on offer, so that a third
// party's types work in files; only FIX, PARAMS_… and the factors that refer to parameters are
// known here by name.

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <span>
#include <unordered_set>
#include <utility>

#include <fmt/core.h>

#include "cairn/runtime/error.hpp"
#include "readers.hpp"
#include "sensor_offset.hpp"
#include "tag_lines.hpp"

namespace cairn::formats {
namespace {

constexpr std::string_view kOffset = "PARAMS_SE3OFFSET";
constexpr std::string_view kPointSeen = "EDGE_SE3_TRACKXYZ";  // pose, point, parameter, x y z
constexpr std::string_view kPrior = "EDGE_SE3_PRIOR";         // pose, parameter, pose
constexpr std::string_view kOwnPrior = "EDGE_PRIOR_SE3:QUAT";

// Positions of poses as g2o and programs that use it write them, beside the tags of the types here.
constexpr std::string_view kPosition = "EDGE_SE3_PRIORXYZ";        // pose, x y z
constexpr std::string_view kPlanarPosition = "EDGE_PRIOR_SE2_XY";  // pose, x y
constexpr std::string_view kPointPrior = "EDGE_PRIOR_TRACKXYZ";    // point, x y z
constexpr std::string_view kHorizontal = "EDGE_SE3_PRIORXY";       // pose, x y
constexpr std::string_view kXyzPrior = "EDGE_SE3_XYZ_PRIOR";       // pose, (parameter,) x y z
constexpr std::string_view kXyzOfEither = "EDGE_POINTXYZ_PRIOR";   // pose or point, x y z
constexpr std::string_view kPlanarPriorXy = "EDGE_SE2_PRIORXY";    // pose, x y
constexpr std::array kPositionTags{kHorizontal, kXyzPrior, kXyzOfEither, kPlanarPriorXy};

/// I11 I12 I22 of x and y: none on z.
const Arrangement kHorizontalRows{
    .to_rows = [](std::span<const double> in, std::span<double> rows) {
      std::ranges::copy(std::array{in[0], in[1], 0.0, in[2], 0.0, 0.0}, rows.begin());
    }};
/// I11 I12 I21 I22, symmetric.
const Arrangement kWholeMatrix{.to_rows = [](std::span<const double> in, std::span<double> rows) {
  std::ranges::copy(std::array{in[0], in[1], in[3]}, rows.begin());
}};

/// g2o has parameters of many kinds, all called PARAMS_ and a word in capitals.
bool is_parameter_tag(std::string_view tag) {
  return tag.starts_with("PARAMS_") &&
         tag.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") == std::string_view::npos;
}

struct Offset {
  SensorOffset value;
  std::array<double, 7> numbers;  ///< as they stand
  std::int64_t line;
};
using Offsets = std::map<Id, Offset>;

class G2oReader {
 public:
  G2oReader(std::string_view text, const std::string& name, Registry& types,
            const ReadOptions& options, ReadReport& report)
      : types_(types),
        options_(options),
        scanner_(text, name),
        draft_(name, "g2o", types, options, report) {
    tags_.add("FIX", read_fix);
    tags_.add(std::string(kOffset), [this](Scanner&, Draft&) { read_offset(); });
    tags_.add(std::string(kPointSeen), [this](Scanner&, Draft&) { read_point_seen(); });
    tags_.add(std::string(kPrior), [this](Scanner&, Draft&) { read_prior(); });
  }

  Graph read() {
    while (scanner_.next_line()) read_line();
    find_positions_of_poses();
    apply_offsets();
    note_unused_parameters();
    return draft_.build();
  }

  /// What the text says, if it is line `number` of a stream: parameters come before what refers to
  /// them, and are remembered. `other_words`: the commands that stand in a stream beside tags.
  StreamLine read_stream(std::string_view text, const std::string& name, std::int64_t number,
                         const ReadOptions& options, std::span<const std::string> other_words) {
    scanner_ = Scanner(text, name, number);
    draft_.start_again(name, options);
    options_ = options;
    other_words_ = other_words;
    references_.clear();
    of_pose_or_point_.clear();
    unused_parameters_.clear();
    while (scanner_.next_line()) read_line();
    apply_offsets();
    refuse_without_effect();
    draft_.write_notes();
    StreamLine line;
    for (const Draft::Variable& v : draft_.variables()) {
      const Draft::VariableKind& kind = draft_.variable(v.kind);
      Variable variable{kind.type, v.id, {}, false};
      for (std::size_t k = 0; k < static_cast<std::size_t>(kind.size); ++k)
        variable.state.push_back(draft_.number(v.numbers + k));
      line.variables.push_back(std::move(variable));
    }
    for (const Draft::Factor& f : draft_.factors()) {
      const Draft::FactorSlots slots = draft_.slots(f);
      line.factors.push_back({draft_.factor(f.kind).type,
                              {slots.ids.begin(), slots.ids.end()},
                              {slots.measurement.begin(), slots.measurement.end()},
                              {slots.information.begin(), slots.information.end()}});
    }
    for (const Draft::Held& held : draft_.held()) line.held.push_back(held.id);
    return line;
  }

 private:
  /// A factor that refers to a parameter, which may stand further down in the file.
  struct Reference {
    std::size_t factor;
    Id parameter;
  };

  void read_line() {
    const std::string_view tag = scanner_.tag();
    if (const LineReader* reader = tags_.find(tag)) return (*reader)(scanner_, draft_);
    if (add_position_tag(tag)) return (*tags_.find(tag))(scanner_, draft_);
    if (types_.has("variable", tag)) {
      add_variable_tag(tag);
    } else if (types_.has("factor", tag)) {
      add_factor_tag(tag);
    } else if (is_parameter_tag(tag)) {
      ++unused_parameters_[shown(tag)];
      return;
    } else {
      return unknown_tag(
          scanner_, draft_, options_, [this] { return tags_on_offer(); }, other_words_);
    }
    (*tags_.find(tag))(scanner_, draft_);
  }
  void add_variable_tag(std::string_view tag) {
    tags_.add(std::string(tag), [kind = draft_.variable_kind(tag)](Scanner& scanner, Draft& draft) {
      read_variable(scanner, draft, kind);
    });
  }
  void add_factor_tag(std::string_view tag) {
    tags_.add(std::string(tag), [kind = draft_.factor_kind(tag)](Scanner& scanner, Draft& draft) {
      read_factor(scanner, draft, kind);
    });
  }
  std::vector<std::string> tags_on_offer() const {
    std::vector<std::string> names = types_.names("variable");
    const std::vector<std::string> factors = types_.names("factor");
    names.insert(names.end(), factors.begin(), factors.end());
    names.insert(names.end(), {"FIX", std::string(kOffset), std::string(kPrior)});
    for (const std::string_view tag : kPositionTags) {
      if (types_.has("factor", own_position(tag))) names.emplace_back(tag);
    }
    return names;
  }

  void read_offset() {
    scanner_.expect({1, 7, 0});
    const Id id = scanner_.read_id();
    Offset offset{{}, {}, scanner_.line()};
    scanner_.read_numbers(offset.numbers);
    scanner_.end_line();
    if (const std::string problem = offset.value.set(offset.numbers); !problem.empty()) {
      scanner_.fail(fmt::format("{} {}: {}", kOffset, id, problem));
    }
    draft_.check_quaternion(offset.numbers, scanner_.line(), fmt::format("{} {}", kOffset, id));
    // Files that were put together from others give the same parameter again and again.
    const auto [place, added] = offsets_.emplace(id, offset);
    if (!added && place->second.numbers != offset.numbers) {
      scanner_.fail(fmt::format(
          "{} {}: line {} gives other numbers for this id; expected the same, or another id",
          kOffset, id, place->second.line));
    }
  }

  /// A factor line with the id of a parameter after those of the variables.
  void read_with_parameter(std::int32_t kind) {
    const Draft::FactorKind& k = draft_.factor(kind);
    scanner_.expect({k.arity + 1, k.measurement, k.information});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    for (Id& id : slots.ids) id = scanner_.read_id();
    references_.push_back({draft_.factors().size() - 1, scanner_.read_id()});
    scanner_.read_numbers(slots.measurement);
    read_information(scanner_, draft_);
  }
  void read_point_seen() { read_with_parameter(draft_.factor_kind(kPointSeen)); }
  void read_prior() { read_with_parameter(draft_.factor_kind(kOwnPrior, kPrior)); }

  /// The type of such a line; empty for another tag.
  static std::string_view own_position(std::string_view tag) {
    if (tag == kHorizontal || tag == kXyzPrior) return kPosition;
    if (tag == kPlanarPriorXy || tag == kPlanarPosition) return kPlanarPosition;
    return tag == kXyzOfEither ? kPointPrior : std::string_view();
  }
  bool add_position_tag(std::string_view tag) {
    const std::string_view own = own_position(tag);
    if (own.empty() || !types_.has("factor", own)) return false;
    const std::int32_t kind = draft_.factor_kind(own, tag);
    tags_.add(std::string(tag), [this, kind, own](Scanner&, Draft&) {
      if (own == kPosition) return read_position(kind);
      if (own == kPlanarPosition) return read_planar_position(kind);
      of_pose_or_point_.push_back(draft_.factors().size());
      read_factor(scanner_, draft_, kind);
    });
    return true;
  }
  void read_position(std::int32_t kind) {
    if (draft_.factor(kind).name == kHorizontal) return read_horizontal_position(kind);
    // g2o has the id of a parameter after that of the pose, some who write its tag have none.
    if (fields_of_line() == 1 + 3 + 6) {
      read_factor(scanner_, draft_, kind);
    } else {
      read_with_parameter(kind);
    }
  }
  /// After the tag, before the line is read.
  int fields_of_line() const { return scanner_.count_fields() - 1; }
  /// x and y alone: no information on z.
  void read_horizontal_position(std::int32_t kind) {
    scanner_.expect({1, 2, 3});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    slots.ids[0] = scanner_.read_id();
    scanner_.read_numbers(slots.measurement.first<2>());
    slots.measurement[2] = 0.0;
    read_information(scanner_, draft_, kHorizontalRows);
    slots.information.back() = 0.0;  // where it is taken as unit, too
  }
  /// g2o reads the upper triangle, and has long written the whole matrix.
  void read_planar_position(std::int32_t kind) {
    if (fields_of_line() != 1 + 2 + 4) {
      read_factor(scanner_, draft_, kind);
      return;
    }
    scanner_.expect({1, 2, 4});
    const Draft::FactorSlots slots = draft_.add_factor(kind, scanner_.line());
    slots.ids[0] = scanner_.read_id();
    scanner_.read_numbers(slots.measurement);
    std::array<double, 4> information;
    scanner_.read_numbers(information);
    scanner_.end_line();
    const auto& [xx, xy, yx, yy] = information;
    if (xy != yx) {
      scanner_.fail(
          fmt::format("the information is not symmetric ({} and {}); expected I11 I12 "
                      "I22, or I11 I12 I12 I22",
                      xy, yx));
    }
    kWholeMatrix.to_rows(information, slots.information);
    draft_.finish_factor(scanner_, kWholeMatrix);
  }
  /// The tag of g2o's prior on a point is that of a position where others put a pose.
  void find_positions_of_poses() {
    if (of_pose_or_point_.empty()) return;
    const std::int32_t position = draft_.factor_kind(kPosition, kXyzOfEither);
    std::unordered_set<Id> poses;
    for (const Draft::Variable& v : draft_.variables()) {
      if (v.kind == draft_.factor(position).variable_kinds[0]) poses.insert(v.id);
    }
    for (const std::size_t at : of_pose_or_point_) {
      Draft::Factor& factor = draft_.factors()[at];
      if (poses.contains(draft_.slots(factor).ids[0])) factor.kind = position;
    }
  }

  void apply_offsets() {
    for (const Reference& reference : references_) {
      const Draft::Factor& factor = draft_.factors()[reference.factor];
      const Draft::FactorKind& kind = draft_.factor(factor.kind);
      const auto offset = offsets_.find(reference.parameter);
      if (offset == offsets_.end()) {
        draft_.fail(factor.line,
                    fmt::format("{} refers to parameter {}; expected a line '{} {} …' in this file",
                                kind.name, reference.parameter, kOffset, reference.parameter));
      }
      apply(offset->second, factor, kind);
    }
  }
  void apply(const Offset& offset, const Draft::Factor& factor, const Draft::FactorKind& kind) {
    if (offset.value.is_identity) return;
    if (kind.name == kPrior || kind.name == kXyzPrior) {
      // x O ≈ z could be written x ≈ z O⁻¹, but then the residual, and with it the information,
      // would be that of another frame: exact for one metric only.
      draft_.fail(
          factor.line,
          fmt::format(
              "{} with the sensor offset of line {} cannot be expressed exactly; expected an "
              "offset of 0 0 0 0 0 0 1, or a prior on the robot's pose",
              kind.name, offset.line));
    }
    const Draft::FactorSlots slots = draft_.slots(factor);
    offset.value.apply_to_point(slots.measurement.first<3>(), slots.information.first<6>());
  }

  /// A stream has no place for a measurement that measures nothing.
  void refuse_without_effect() {
    for (const Draft::Factor& factor : draft_.factors()) {
      if (factor.has_effect) continue;
      draft_.fail(factor.line, fmt::format("the information of {} is zero: it would have no effect",
                                           draft_.describe(factor)));
    }
  }

  void note_unused_parameters() {
    for (const auto& [tag, lines] : unused_parameters_) {
      draft_.report().notes.push_back(
          fmt::format("{} left aside ({}): no factor in the file refers to such parameters", tag,
                      lines == 1 ? "1 line" : fmt::format("{} lines", lines)));
    }
  }

  Registry& types_;
  ReadOptions options_;
  std::span<const std::string> other_words_;
  Offsets offsets_;
  Scanner scanner_;
  Draft draft_;
  TagTable tags_;
  std::vector<Reference> references_;
  std::vector<std::size_t> of_pose_or_point_;  // factors whose variable says what they are
  std::map<std::string, std::int64_t> unused_parameters_;
};

/// One reader for all lines: it has looked up the types, and remembers the offsets of sensors.
class G2oStream final : public StreamFormat {
 public:
  StreamLine read(std::string_view line, const std::string& name, std::int64_t number,
                  Registry& types, const ReadOptions& options) override {
    report_ = {};
    if (!reader_ || types_ != &types) {
      reader_ = std::make_unique<G2oReader>("", name, types, options, report_);
      types_ = &types;
    }
    StreamLine said = reader_->read_stream(line, name, number, options, other_words());
    said.skipped = !report_.skipped.empty();
    said.notes = std::move(report_.notes);
    return said;
  }

 private:
  ReadReport report_;
  std::unique_ptr<G2oReader> reader_;
  Registry* types_ = nullptr;
};

}  // namespace

std::unique_ptr<StreamFormat> make_g2o_stream() { return std::make_unique<G2oStream>(); }

Graph read_g2o(std::string_view text, const std::string& name, Registry& types,
               const ReadOptions& options, ReadReport& report) {
  return G2oReader(text, name, types, options, report).read();
}

}  // namespace cairn::formats
