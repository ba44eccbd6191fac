// SPDX-License-Identifier: BSD-3-Clause
// Journals: the input is a list of lines, and what was done to each (sealed in its place, sealed as
// if another stood before it, damaged, without its end). Compared with a reading of the format that
// is written down again here; what is accepted goes on, and is restored into a session.
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "cairn/online/conversation.hpp"
#include "cairn/online/journal.hpp"
#include "cairn/runtime/error.hpp"
#include "fuzz/targets/sessions.hpp"
#include "fuzz/targets/target.hpp"

namespace cairn::fuzz {
namespace {

constexpr const char* kIdentity = "robot";

std::uint32_t crc(std::string_view text) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size())));
}

// A file from an input ---------------------------------------------------------------------------

/// How a line of the input is put into the file; its first byte chooses.
enum class Put : std::uint8_t {
  sealed,     ///< with the checksum of its place
  verbatim,   ///< as it is
  misplaced,  ///< with a checksum as if it came first
  twice,      ///< sealed, and the same bytes again
};

/// Makes files, each line with the checksum that it is to have.
class Forger {
 public:
  explicit Forger(bool chained) : chained_(chained) {}

  void put(Put how, std::string_view line) {
    if (how == Put::verbatim) {
      text_ += fmt::format("{}\n", line);
      return;
    }
    if (how == Put::misplaced) chain_ = 0;
    const std::string line_sealed = sealed(line);
    text_ += line_sealed;
    if (how == Put::twice) text_ += line_sealed;
  }
  void header(std::string_view identity) {
    text_ += (chained_ ? "cairn-journal 2 " : "cairn-journal 1 ") + sealed(identity);
  }
  void cut(std::size_t bytes) { text_.resize(text_.size() - std::min(bytes, text_.size())); }
  const std::string& text() const { return text_; }

 private:
  std::string sealed(std::string_view rest) {
    chain_ = crc(chained_ ? fmt::format("{:08x}{}", chain_, rest) : std::string(rest));
    return fmt::format("{:08x} {}\n", chain_, rest);
  }
  bool chained_;
  std::uint32_t chain_ = 0;
  std::string text_;
};

/// The first byte: bit 0 the format, bit 1 no header, bit 2 another identity, from bit 3 on how
/// many bytes are missing at the end. Then lines.
std::string file_of(Source& source) {
  const int choice = source.byte();
  Forger forger((choice & 1) == 0);
  if ((choice & 2) == 0) forger.header((choice & 4) == 0 ? kIdentity : "ship");
  for (std::string_view rest = text_of(source.rest()); !rest.empty();) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    if (end > 0) forger.put(static_cast<Put>(rest[0] & 3), rest.substr(1, end - 1));
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  forger.cut(static_cast<std::size_t>(choice >> 3));
  return forger.text();
}

// What the format means --------------------------------------------------------------------------

struct Expected {
  bool accepted = true;
  std::vector<Journal::Record> records;
  std::size_t whole = 0;  ///< bytes up to the end of the last whole line
};

/// "checksum rest" with the right checksum, which becomes `chain`.
std::optional<std::string_view> unsealed(std::string_view line, bool chained,
                                         std::uint32_t& chain) {
  if (line.size() < 9 || line[8] != ' ') return std::nullopt;
  const std::string_view rest = line.substr(9), digits = line.substr(0, 8);
  const std::uint32_t wanted =
      crc(chained ? fmt::format("{:08x}{}", chain, rest) : std::string(rest));
  // Capital digits are the same number.
  std::string lower(digits);
  for (char& c : lower) c = c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
  if (lower != fmt::format("{:08x}", wanted)) return std::nullopt;
  chain = wanted;
  return rest;
}

std::optional<Journal::Record> record_of(std::string_view rest) {
  Journal::Record record;
  const std::size_t space = rest.find(' ');
  if (space == std::string_view::npos) return std::nullopt;
  const char* const end = rest.data() + space;
  const auto [at, problem] = std::from_chars(rest.data(), end, record.number);
  if (problem != std::errc{} || at != end) return std::nullopt;
  record.text = rest.substr(space + 1);
  return record;
}

Expected expected_of(std::string_view text) {
  constexpr std::string_view kChained = "cairn-journal 2 ", kUnchained = "cairn-journal 1 ";
  const Expected refused{.accepted = false, .records = {}};
  const bool chained = !text.starts_with(kUnchained);
  const std::size_t header_end = text.find('\n');
  if (header_end == std::string_view::npos) {  // nothing, or a header that was being written
    const std::string_view magic = chained ? kChained : kUnchained;
    const std::size_t both = std::min(magic.size(), text.size());
    return text.substr(0, both) == magic.substr(0, both) ? Expected{} : refused;
  }
  if (chained && !text.starts_with(kChained)) return refused;
  std::uint32_t chain = 0;
  const auto owner =
      unsealed(text.substr(kChained.size(), header_end - kChained.size()), chained, chain);
  if (!owner || *owner != kIdentity) return refused;
  Expected expected;
  std::size_t begin = header_end + 1;
  for (std::size_t end; (end = text.find('\n', begin)) != std::string_view::npos; begin = end + 1) {
    const auto rest = unsealed(text.substr(begin, end - begin), chained, chain);
    auto record = rest ? record_of(*rest) : std::nullopt;
    if (!record) return refused;
    if (!expected.records.empty() && record->number <= expected.records.back().number)
      return refused;
    expected.records.push_back(std::move(*record));
  }
  expected.whole = begin;
  return expected;
}

// The journal ------------------------------------------------------------------------------------

void write(const std::string& file, std::string_view bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

std::string read(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void expect_records(const std::vector<Journal::Record>& got,
                    const std::vector<Journal::Record>& wanted) {
  expect(got.size() == wanted.size(),
         [&] { return fmt::format("{} records, and the file has {}", got.size(), wanted.size()); });
  for (std::size_t k = 0; k < got.size(); ++k) {
    expect(got[k].number == wanted[k].number && got[k].text == wanted[k].text, [&] {
      return fmt::format("record {} is {} '{}', and the file has {} '{}'", k, got[k].number,
                         got[k].text, wanted[k].number, wanted[k].text);
    });
  }
}

/// Opens the file; null where it is refused.
std::unique_ptr<Journal> open(const std::string& file) {
  try {
    return std::make_unique<Journal>(file, kIdentity, Journal::Sync::none);
  } catch (const Error&) {
    return nullptr;
  }
}

/// The file is accepted, and these records come first.
void expect_begins_with(const std::string& file, const std::vector<Journal::Record>& records) {
  const std::unique_ptr<Journal> journal = open(file);
  expect(journal != nullptr, [&] { return "refused after a record was added:\n" + read(file); });
  std::vector<Journal::Record> all = journal->take_records();
  all.resize(std::min(all.size(), records.size()));
  expect_records(all, records);
}

/// As `cairn online` goes on with a journal: the records are lines that the session takes again, or
/// the journal is refused. A line more is in it when it is opened once more.
void converse(const std::string& file, std::int64_t last) {
  OwnedSession session(session_settings(0));
  const std::unique_ptr<Journal> journal = open(file);
  Conversation conversation(session.lines(), journal.get());
  try {
    conversation.restore();
  } catch (const Error&) {
    return;
  }
  const LineSession::Reply reply = conversation.take("SOLVE");
  expect(!reply.text.empty(), [] { return "no answer to SOLVE"; });
  conversation.finish();
  expect(!reply.changes || last < std::numeric_limits<std::int64_t>::max(),
         [] { return "a line was taken for which there is no number"; });
}

void run(Bytes bytes) {
  Source source(bytes);
  const std::string text = file_of(source), file = scratch_folder() + "/journal";
  write(file, text);
  ::unlink((file + ".cut").c_str());
  const Expected expected = expected_of(text);
  std::vector<Journal::Record> records;
  {
    const std::unique_ptr<Journal> journal = open(file);
    expect((journal != nullptr) == expected.accepted, [&] {
      return fmt::format("{} though it {} in order:\n{}", journal ? "accepted" : "refused",
                         journal ? "is not" : "is", text);
    });
    if (!journal) {
      expect(read(file) == text, [] { return "a journal that was refused has changed"; });
      return;
    }
    records = journal->take_records();
    expect_records(records, expected.records);
    if (expected.whole > 0 && expected.whole < text.size()) {
      expect(read(file + ".cut") == text.substr(expected.whole) + "\n",
             [] { return "what was cut off was not kept"; });
    }
    const std::int64_t last = records.empty() ? 0 : records.back().number;
    if (last < std::numeric_limits<std::int64_t>::max()) {
      journal->append(last + 1, "SOLVE");
      records.push_back({last + 1, "SOLVE"});
    }
    journal->commit();
  }
  expect_begins_with(file, records);
  if (std::ranges::any_of(records, [](const auto& record) { return writes_a_file(record.text); }))
    return;
  converse(file, records.empty() ? 0 : records.back().number);
  expect_begins_with(file, records);
}

std::vector<std::string> seeds() {
  const std::string sealed(1, static_cast<char>(Put::sealed)),
      verbatim(1, static_cast<char>(Put::verbatim)),
      misplaced(1, static_cast<char>(Put::misplaced)), twice(1, static_cast<char>(Put::twice));
  const std::string three = sealed + "1 VERTEX_SE2 0 0 0 0\n" + sealed + "2 NEW VERTEX_SE2 1\n" +
                            sealed + "4 EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n";
  std::vector<std::string> all;
  for (const char choice : {0, 1, 2, 4, 8, 9, 40}) all.push_back(std::string(1, choice) + three);
  for (const char format : {0, 1}) {
    const std::string first(1, format);
    all.push_back(first + three + twice + "5 SOLVE\n");
    all.push_back(first + three + misplaced + "5 SOLVE\n");
    all.push_back(first + three + sealed + "3 SOLVE\n");
    all.push_back(first + three + verbatim + "00000000 5 SOLVE\n");
    all.push_back(first + sealed + "9223372036854775807 SOLVE\n");
    all.push_back(first + sealed + "-1 \n" + sealed + "0 FULL\n");
  }
  all.push_back(std::string(1, 2) + verbatim + "cairn-journal 2 00000000 robot\n");
  for (const std::string& lines : conversations()) {
    std::string numbered(1, '\0');
    int number = 0;
    for (std::size_t at = 0; at < lines.size();) {
      const std::size_t end = lines.find('\n', at);
      numbered += sealed + fmt::format("{} {}\n", ++number, lines.substr(at, end - at));
      at = end + 1;
    }
    all.push_back(numbered);
  }
  return all;
}

std::vector<std::string> words() {
  std::vector<std::string> all = protocol_words();
  all.insert(all.end(), {"cairn-journal 2 ", "cairn-journal 1 ", "robot", "9223372036854775807 "});
  return all;
}

}  // namespace

Target journal() { return {"journal", &run, &seeds, &words, session_needs({}), 1024}; }

}  // namespace cairn::fuzz
