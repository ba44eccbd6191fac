// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/io/packed_array.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <boost/json/parse.hpp>

#include "cairn/runtime/error.hpp"

namespace cairn::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<double> unpacked(const std::string& text) {
  const boost::json::value value = boost::json::parse(text);
  const bool deflate = value.as_object().contains("deflate");
  return unpack_numbers(std::string(value.at("type").as_string()),
                        std::string(value.at(deflate ? "deflate" : "base64").as_string()),
                        deflate ? Packing::deflate : Packing::base64,
                        value.at("count").to_number<std::size_t>(), "test");
}

TEST(PackedArray, IsLittleEndianBase64AsThePageReadsIt) {
  // 1.0f is 00 00 80 3f; checked by hand, since a round trip alone would hide a common mistake.
  EXPECT_EQ(packed_json(std::vector<float>{1.0F}, Packing::base64),
            R"({"type":"f32","count":1,"base64":"AACAPw=="})");
  EXPECT_EQ(packed_json(std::vector<std::uint8_t>{1, 2, 255}, Packing::base64),
            R"({"type":"u8","count":3,"base64":"AQL/"})");
  EXPECT_EQ(packed_json(std::vector<std::int32_t>{}, Packing::base64),
            R"({"type":"i32","count":0,"base64":""})");
}

TEST(PackedArray, ComesBackTheSameForEveryTypePackingAndLength) {
  for (const Packing packing : {Packing::base64, Packing::deflate}) {
    for (int length = 0; length < 9; ++length) {
      std::vector<std::int32_t> indices;
      std::vector<std::int64_t> ids;
      std::vector<float> places;
      std::vector<double> expected_indices, expected_ids, expected_places;
      for (int k = 0; k < length; ++k) {
        expected_indices.push_back(indices.emplace_back(k % 2 ? -1 : 1 << k));
        expected_ids.push_back(static_cast<double>(ids.emplace_back((std::int64_t{1} << 40) + k)));
        expected_places.push_back(places.emplace_back(0.1F * static_cast<float>(k)));
      }
      EXPECT_EQ(unpacked(packed_json(indices, packing)), expected_indices);
      EXPECT_EQ(unpacked(packed_json(ids, packing)), expected_ids);
      EXPECT_EQ(unpacked(packed_json(places, packing)), expected_places);
    }
  }
}

TEST(PackedArray, KeepsWhatIsNotThere) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const std::vector<double> back =
      unpacked(packed_json(std::vector<float>{1, none}, Packing::base64));
  EXPECT_EQ(back[0], 1.0);
  EXPECT_TRUE(std::isnan(back[1]));
}

TEST(PackedArray, PointsInSixteenBitsAreWithinAStepOfTheirBox) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> points{-5, 100, 20, 300, none, none, 0, 150};
  const boost::json::value value = boost::json::parse(packed_points_json(points, 2));
  const std::vector<double> steps = unpacked(packed_points_json(points, 2));
  EXPECT_THAT(steps, ElementsAre(0, 0, 65534, 65534, 65535, 65535, testing::_, testing::_));
  for (std::size_t d = 0; d < 2; ++d) {
    const double low = value.at("min").at(d).to_number<double>();
    const double width = value.at("max").at(d).to_number<double>() - low;
    EXPECT_NEAR(low + steps[6 + d] / 65534 * width, points[6 + d], width / 65534);
  }
}

TEST(PackedArray, RefusesWhatIsDamaged) {
  const auto unpack = [](std::string_view type, std::string_view text, Packing packing,
                         std::size_t count) {
    return [=] { unpack_numbers(type, text, packing, count, "here"); };
  };
  EXPECT_THROW(unpack("f32", "AACAPw==", Packing::base64, 2)(), Error);
  EXPECT_THROW(unpack("f32", "AACA", Packing::base64, 1)(), Error);
  EXPECT_THROW(unpack("f32", "AACAP", Packing::base64, 1)(), Error);
  EXPECT_THROW(unpack("f32", "AA<APw==", Packing::base64, 1)(), Error);
  EXPECT_THROW(unpack("f16", "AACAPw==", Packing::base64, 1)(), Error);
  EXPECT_THROW(unpack("f32", "AACAPw==", Packing::deflate, 1)(), Error);
  // A count that would fill the memory is refused before it does.
  EXPECT_THROW(unpack("f32", "AACAPw==", Packing::deflate, std::size_t{1} << 50)(), Error);
}

TEST(EmbeddableJson, HasNoLessThanWhateverANameHolds) {
  const std::string name = "</script><script>alert('x')</script><!-- \" \\ \n \x01 \xff \xc3";
  const std::string literal = json_string(name);
  EXPECT_THAT(literal, Not(HasSubstr("<")));
  const std::string back(boost::json::parse(literal).as_string());
  EXPECT_THAT(back, HasSubstr("</script><script>alert('x')</script><!-- \" \\ \n \x01 "));
  EXPECT_THAT(back, HasSubstr("\xef\xbf\xbd"));  // for each byte that is not UTF-8
}

TEST(EmbeddableJson, LeavesWhatIsUtf8AsItIs) {
  EXPECT_EQ(valid_utf8("Straße 東京 😀"), "Straße 東京 😀");
  EXPECT_EQ(valid_utf8("\xc0\xaf"), "\xef\xbf\xbd\xef\xbf\xbd");          // overlong '/'
  EXPECT_EQ(valid_utf8("\xed\xa0\x80").find('\xed'), std::string::npos);  // a surrogate
}

TEST(EmbeddableJson, WritesNumbersThatReadBackAndNullForTheRest) {
  EXPECT_EQ(json_number(0.1), "0.1");
  EXPECT_EQ(json_number(std::numeric_limits<double>::infinity()), "null");
  EXPECT_EQ(json_number(std::numeric_limits<double>::quiet_NaN()), "null");
}

}  // namespace
}  // namespace cairn::test
