// SPDX-License-Identifier: BSD-3-Clause
#include "printed_digits.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <vector>

#include "scanner.hpp"

namespace cairn::formats {
namespace {

constexpr int kFewestDigits = 4, kMostDigits = 17;

/// How a number stands in the text.
struct Spelling {
  bool has_point = false, has_exponent = false;
  int decimals = 0;     ///< digits after the point
  int significant = 0;  ///< digits from the first that is not zero
  int leading = 0;      ///< the number is below 10^(leading + 1), and not below 10^leading
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

Spelling spelling_of(std::string_view field) {
  Spelling s;
  int before_point = 0, zeros = 0;  // digits from the first other than zero; zeros at the end
  for (std::size_t k = 0; k < field.size(); ++k) {
    const char c = field[k];
    if (c == '.') {
      s.has_point = true;
    } else if (is_digit(c)) {
      s.decimals += s.has_point;
      if (s.significant == 0 && c == '0') {
        before_point -= s.has_point;
        continue;
      }
      ++s.significant;
      zeros = c == '0' ? zeros + 1 : 0;
      before_point += !s.has_point;
    } else if (c == 'e' || c == 'E') {
      s.has_exponent = true;
      const std::size_t sign = k + 1 < field.size() && field[k + 1] == '+' ? 1 : 0;
      std::from_chars(field.data() + k + 1 + sign, field.data() + field.size(), s.leading);
      break;
    }
  }
  s.leading += before_point - 1;
  if (!s.has_point) s.significant -= zeros;  // 16800000 may have been 1.68e7
  return s;
}

bool have_common_decimals(std::span<const Spelling> spellings) {
  const Spelling& first = spellings.front();
  const bool common = std::ranges::all_of(spellings, [&](const Spelling& s) {
    return s.has_point == first.has_point && !s.has_exponent && s.decimals == first.decimals;
  });
  // Whole numbers of few digits were written by hand.
  return common &&
         (first.has_point ||
          std::ranges::max(spellings, {}, &Spelling::significant).significant > kFewestDigits);
}

}  // namespace

void printed_rounding(std::span<const std::string_view> fields, std::span<double> rounding) {
  std::vector<Spelling> spellings;
  for (const std::string_view field : fields) spellings.push_back(spelling_of(field));
  const bool fixed = have_common_decimals(spellings);
  int digits = kFewestDigits;
  for (const Spelling& s : spellings) digits = std::clamp(s.significant, digits, kMostDigits);
  for (std::size_t k = 0; k < rounding.size(); ++k) {
    const Spelling& s = spellings[k];
    const int unit = fixed ? -s.decimals : s.leading - digits + 1;
    rounding[k] = !fixed && s.significant == 0 ? 0.0 : 0.5 * std::pow(10.0, unit);
  }
}

bool are_texts_of_floats(std::span<const std::string_view> fields) {
  return std::ranges::all_of(fields, [](std::string_view field) {
    double number = 0.0;
    if (!parse_number(field, number) || std::abs(number) > std::numeric_limits<float>::max())
      return false;
    const Spelling s = spelling_of(field);
    const int unit = s.has_point && !s.has_exponent ? -s.decimals : s.leading - s.significant + 1;
    constexpr double kHalf = 0.5 + 1e-3;  // ties, too
    return std::abs(static_cast<float>(number) - number) <= kHalf * std::pow(10.0, unit);
  });
}

}  // namespace cairn::formats
