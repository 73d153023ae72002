#include "document/document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <random>

#include "artifact_fixture.hpp"
#include "quasilpv/artifact.hpp"
#include "quasilpv/errors.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::cbor_twin;
using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::refusal;
using ::quasilpv::testing::with_hash;
using ::testing::HasSubstr;

double from_bits(std::uint64_t bits) {
  double value = 0.0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

std::string hex(const std::string& bytes) {
  std::string text;
  for (const char byte : bytes) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[static_cast<unsigned char>(byte) >> 4];
    text += kDigits[static_cast<unsigned char>(byte) & 15];
  }
  return text;
}

std::string repeated(const std::string& text, std::size_t count) {
  std::string result;
  for (std::size_t i = 0; i < count; ++i) {
    result += text;
  }
  return result;
}

// FIPS 180-4 examples (NIST), and lengths around the block and padding boundaries from GNU coreutils' sha256sum.
TEST(Sha256, agrees_with_published_vectors) {
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_hex("abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqr"
                       "lmnopqrsmnopqrstnopqrstu"),
            "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1");
  EXPECT_EQ(sha256_hex(std::string(1000000, 'a')), "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  EXPECT_EQ(sha256_hex(std::string(55, 'a')), "9f4390f8d30c2dd92ec9f095b65e2b9ae9b0a925a5258e241c9f1e910f734318");
  EXPECT_EQ(sha256_hex(std::string(56, 'a')), "b35439a4ac6f0948b6d6f9e3c6af0f5f590ce20f1bde7090ef7970686ec6738a");
  EXPECT_EQ(sha256_hex(std::string(63, 'a')), "7d3e74a05d7db15bce4ad9ec0658ea98e3f06eeecf16b4c6fff2da457ddc2f34");
  EXPECT_EQ(sha256_hex(std::string(64, 'a')), "ffe054fe7ae0cb6dc65c3af9b61d5209f439851db43d0ba5997337df154668eb");
  EXPECT_EQ(sha256_hex(std::string(119, 'a')), "31eba51c313a5c08226adf18d4a359cfdfd8d2e816b13f4af952f7ea6584dcfb");
  EXPECT_EQ(sha256_hex(std::string(120, 'a')), "2f3d335432c70b580af0e8e1b3674a7c020d683aa5f73aaaedfdc55af904c21c");
}

// RFC 8785, appendix B.
TEST(CanonicalNumber, agrees_with_rfc_8785_appendix_b) {
  const std::vector<std::pair<std::uint64_t, std::string>> table = {
      {0x0000000000000000, "0"},
      {0x8000000000000000, "0"},
      {0x0000000000000001, "5e-324"},
      {0x8000000000000001, "-5e-324"},
      {0x7fefffffffffffff, "1.7976931348623157e+308"},
      {0xffefffffffffffff, "-1.7976931348623157e+308"},
      {0x4340000000000000, "9007199254740992"},
      {0xc340000000000000, "-9007199254740992"},
      {0x4430000000000000, "295147905179352830000"},
      {0x44b52d02c7e14af5, "9.999999999999997e+22"},
      {0x44b52d02c7e14af6, "1e+23"},
      {0x44b52d02c7e14af7, "1.0000000000000001e+23"},
      {0x444b1ae4d6e2ef4e, "999999999999999700000"},
      {0x444b1ae4d6e2ef4f, "999999999999999900000"},
      {0x444b1ae4d6e2ef50, "1e+21"},
      {0x3eb0c6f7a0b5ed8c, "9.999999999999997e-7"},
      {0x3eb0c6f7a0b5ed8d, "0.000001"},
      {0x41b3de4355555553, "333333333.3333332"},
      {0x41b3de4355555554, "333333333.33333325"},
      {0x41b3de4355555555, "333333333.3333333"},
      {0x41b3de4355555556, "333333333.3333334"},
      {0x41b3de4355555557, "333333333.33333343"},
      {0xbecbf647612f3696, "-0.0000033333333333333333"},
      {0x43143ff3c1cb0959, "1424953923781206.2"},
  };
  for (const auto& [bits, text] : table) {
    EXPECT_EQ(canonical_number(from_bits(bits)), text);
  }
}

TEST(CanonicalNumber, round_trips_random_doubles) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 20000; ++i) {
    const double value = from_bits(random());
    if (std::isfinite(value)) {
      EXPECT_EQ(std::strtod(canonical_number(value).c_str(), nullptr), value);
    }
  }
}

// RFC 8785, section 3.2.2.
TEST(CanonicalJson, agrees_with_the_example_of_rfc_8785) {
  const Json document = Json::parse(R"({
    "numbers": [333333333.33333329, 1E30, 4.50, 2e-3, 0.000000000000000000000000001],
    "string": "\u20ac$\u000F\u000aA'\u0042\u0022\u005c\\\"\/",
    "literals": [null, true, false]
  })");
  EXPECT_EQ(canonical_json(document),
            "{\"literals\":[null,true,false],\"numbers\":[333333333.3333333,1e+30,4.5,0.002,1e-27],"
            "\"string\":\"\xe2\x82\xac$\\u000f\\nA'B\\\"\\\\\\\\\\\"/\"}");
}

TEST(CanonicalJson, refuses_what_the_data_model_does_not_know) {
  EXPECT_THAT(refusal([] { canonical_json(std::nan("")); }), HasSubstr("NaN or Inf"));
  EXPECT_THAT(refusal([] { canonical_json({{"\xc3\xbc", 1}}); }), HasSubstr("outside ASCII"));
  EXPECT_THAT(refusal([] { canonical_json("\xff"); }), HasSubstr("not UTF-8"));
  EXPECT_THAT(refusal([] { canonical_cbor(Json::binary({1, 2})); }), HasSubstr("byte string"));
}

// RFC 8949, appendix A, for values whose encoding the profile does not change.
TEST(CanonicalCbor, agrees_with_rfc_8949_appendix_a) {
  const std::vector<std::pair<Json, std::string>> table = {
      {0, "00"},
      {23, "17"},
      {24, "1818"},
      {100, "1864"},
      {1000, "1903e8"},
      {1000000, "1a000f4240"},
      {1000000000000, "1b000000e8d4a51000"},
      {-1, "20"},
      {-100, "3863"},
      {-1000, "3903e7"},
      {1.1, "fb3ff199999999999a"},
      {1.5, "f93e00"},
      {3.4028234663852886e+38, "fa7f7fffff"},
      {1.0e+300, "fb7e37e43c8800759c"},
      {5.960464477539063e-8, "f90001"},
      {0.00006103515625, "f90400"},
      {-4.1, "fbc010666666666666"},
      {false, "f4"},
      {true, "f5"},
      {nullptr, "f6"},
      {"", "60"},
      {"IETF", "6449455446"},
      {"\xc3\xbc", "62c3bc"},
      {Json::array(), "80"},
      {Json::parse("[1,[2,3],[4,5]]"), "8301820203820405"},
      {Json::object(), "a0"},
      {Json::parse(R"({"a":1,"b":[2,3]})"), "a26161016162820203"},
  };
  for (const auto& [value, bytes] : table) {
    EXPECT_EQ(hex(canonical_cbor(value)), bytes) << value;
  }
}

TEST(CanonicalCbor, writes_integral_numbers_as_integers_and_minus_zero_as_zero) {
  EXPECT_EQ(hex(canonical_cbor(1.0)), "01");
  EXPECT_EQ(hex(canonical_cbor(-0.0)), "00");
  EXPECT_EQ(hex(canonical_cbor(9007199254740991.0)), "1b001fffffffffffff");
  EXPECT_EQ(hex(canonical_cbor(-9007199254740991.0)), "3b001ffffffffffffe");
  EXPECT_EQ(hex(canonical_cbor(9007199254740992.0)), "fa5a000000");  // 2^53: the shortest float
}

TEST(CanonicalCbor, orders_keys_by_their_encoding_and_json_by_their_text) {
  const Json document = {{"b", 1}, {"aa", 2}};
  EXPECT_EQ(hex(canonical_cbor(document)), "a261620162616102");
  EXPECT_EQ(canonical_json(document), R"({"aa":2,"b":1})");
}

TEST(CanonicalCbor, keeps_every_half_precision_number_that_is_not_an_integer_in_half_precision) {
  int checked = 0;
  for (unsigned bits = 0; bits < 0x10000; ++bits) {
    const std::vector<std::uint8_t> half = {0xf9, static_cast<std::uint8_t>(bits >> 8),
                                            static_cast<std::uint8_t>(bits & 0xff)};
    const auto value = Json::from_cbor(half).get<double>();
    if (std::isfinite(value) && value != std::floor(value)) {
      EXPECT_EQ(hex(canonical_cbor(value)), hex(std::string(half.begin(), half.end())));
      ++checked;
    }
  }
  EXPECT_GT(checked, 40000);
}

TEST(CanonicalCbor, round_trips_random_numbers_through_an_independent_decoder) {
  std::mt19937_64 random(11);
  for (int i = 0; i < 20000; ++i) {
    double value = from_bits(random());
    value = i % 3 == 0 ? static_cast<float>(value) : value;
    if (std::isfinite(value)) {
      EXPECT_EQ(Json::from_cbor(canonical_cbor(value)).get<double>(), value);
    }
  }
}

TEST(Document, loads_both_twins_to_the_same_object) {
  const Json content = artifact_table("dob-acceleration", 3);
  const Json from_json = parse_document(json_twin(content), "twin.json");
  EXPECT_EQ(from_json, parse_document(cbor_twin(content), "twin.cbor"));
  EXPECT_EQ(from_json, with_hash(content));
}

class EveryTwin : public ::testing::TestWithParam<bool> {
 protected:
  std::string bytes_ =
      GetParam() ? json_twin(artifact_table("dob-acceleration", 3)) : cbor_twin(artifact_table("dob-acceleration", 3));
};

TEST_P(EveryTwin, F8_is_refused_when_truncated_at_any_byte) {
  ASSERT_NO_THROW(Artifact::parse(bytes_, "twin"));
  for (std::size_t size = 0; size < bytes_.size(); ++size) {
    ASSERT_THROW(Artifact::parse(bytes_.substr(0, size), "twin"), InputError) << "truncated to " << size;
  }
}

TEST_P(EveryTwin, F8_is_refused_when_any_bit_is_flipped) {
  std::mt19937_64 random(13);
  std::uniform_int_distribution<std::size_t> bit_of(0, 8 * bytes_.size() - 1);
  for (int i = 0; i < 4000; ++i) {
    const std::size_t bit = bit_of(random);
    std::string damaged = bytes_;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    const std::string message = refusal([&damaged] { Artifact::parse(damaged, "twin"); });
    ASSERT_THAT(message, HasSubstr("twin: ")) << "bit " << bit;
    ASSERT_EQ(message.find('\n'), std::string::npos) << message;
    ASSERT_THAT(message, HasSubstr(", expected "));
  }
}

TEST_P(EveryTwin, is_refused_with_bytes_after_its_end) {
  EXPECT_THROW(Artifact::parse(bytes_ + '\n', "twin"), InputError);
  EXPECT_THROW(Artifact::parse(bytes_ + '\0', "twin"), InputError);
}

INSTANTIATE_TEST_SUITE_P(Document, EveryTwin, ::testing::Values(true, false),
                         [](const auto& twin) { return twin.param ? "json" : "cbor"; });

// Each of these means the same content as a canonical document and is refused for its form alone.
TEST(Document, refuses_json_that_is_not_canonical) {
  const std::string canonical = json_twin({{"a", 1}, {"b", 0}, {"c", "x"}});
  ASSERT_NO_THROW(parse_document(canonical, "x"));
  const auto replaced = [&canonical](const std::string& from, const std::string& to) {
    std::string text = canonical;
    return text.replace(text.find(from), from.size(), to);
  };
  for (const std::string& text :
       {replaced("\"a\":1", "\"a\":1.0"), replaced("\"a\":1", "\"a\":1e0"), replaced("\"a\":1", "\"a\": 1"),
        replaced("\"b\":0", "\"b\":-0"), replaced("\"b\":0", "\"b\":-0.0"), replaced("\"x\"", "\"\\u0078\""),
        replaced("\"a\":1,\"b\":0", "\"b\":0,\"a\":1"), replaced("\"a\":1", "\"a\":1,\"a\":1")}) {
    EXPECT_THROW(parse_document(text, "x"), InputError) << text;
  }
}

TEST(Document, refuses_a_wrong_hash_and_names_the_field) {
  Json document = with_hash({{"a", 1}});
  document["a"] = 2;
  EXPECT_THAT(refusal([&] { parse_document(canonical_json(document), "x.json"); }), HasSubstr("x.json: hash: got "));
  EXPECT_THAT(refusal([&] { parse_document("{\"a\":1}", "x.json"); }), HasSubstr("x.json: hash: got nothing"));
  std::string upper = with_hash({{"a", 1}})["hash"];
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return std::toupper(c); });
  EXPECT_THROW(parse_document(canonical_json(Json{{"a", 1}, {"hash", upper}}), "x"), InputError);
}

TEST(Document, refuses_cbor_outside_the_deterministic_profile) {
  const std::vector<std::pair<std::string, std::string>> table = {
      {"not shortest", std::string("\xa1\x61\x61\x18\x01", 5)},
      {"indefinite map", std::string("\xbf\x61\x61\x01\xff", 5)},
      {"byte string", std::string("\xa1\x61\x61\x41\x01", 5)},
      {"tag", std::string("\xa1\x61\x61\xc1\x01", 5)},
      {"undefined", std::string("\xa1\x61\x61\xf7", 4)},
      {"NaN", std::string("\xa1\x61\x61\xf9\x7e\x00", 6)},
      {"minus zero", std::string("\xa1\x61\x61\xf9\x80\x00", 6)},
      {"one as a float", std::string("\xa1\x61\x61\xf9\x3c\x00", 6)},
      {"integer key", std::string("\xa1\x01\x01", 3)},
      {"duplicate key", std::string("\xa2\x61\x61\x01\x61\x61\x01", 7)},
      {"text that is not UTF-8", std::string("\xa1\x61\x61\x61\xff", 5)},
      {"a text of 2^62 bytes", std::string("\xa1\x61\x61\x7b\x40\x00\x00\x00\x00\x00\x00\x00", 12)},
      {"an array of 2^62", std::string("\xa1\x61\x61\x9b\x40\x00\x00\x00\x00\x00\x00\x00", 12)},
  };
  for (const auto& [what, bytes] : table) {
    EXPECT_THAT(refusal([&bytes = bytes] { parse_document(bytes, "x.cbor"); }), HasSubstr("x.cbor: ")) << what;
  }
}

TEST(Document, allows_32_levels_of_nesting_and_refuses_33) {
  const auto nested = [](std::size_t levels) { return repeated("[", levels) + repeated("]", levels); };
  const Json deepest = {{"a", Json::parse(nested(31))}};
  EXPECT_NO_THROW(parse_document(json_twin(deepest), "x"));
  EXPECT_NO_THROW(parse_document(cbor_twin(deepest), "x"));
  const Json too_deep = {{"a", Json::parse(nested(32))}};
  EXPECT_THAT(refusal([&] { canonical_json(too_deep); }), HasSubstr("more than 32 levels"));
  EXPECT_THAT(refusal([&] { canonical_cbor(too_deep); }), HasSubstr("more than 32 levels"));
  EXPECT_THAT(refusal([&] { parse_document("{\"a\":" + nested(32) + "}", "x"); }), HasSubstr("more than 32 levels"));
}

TEST(Document, refuses_a_million_levels_without_exhausting_the_stack) {
  EXPECT_THROW(parse_document("{\"a\":" + std::string(1000000, '['), "x"), InputError);
  EXPECT_THROW(parse_document("\xa1\x61\x61" + std::string(1000000, '\x81'), "x"), InputError);
}

TEST(StrictJson, F8_refuses_duplicates_zero_bytes_comments_and_numbers_out_of_range) {
  EXPECT_THAT(refusal([] { parse_strict_json(R"({"a":{"b":1,"b":1}})", "s"); }),
              HasSubstr("s: b: got a second member"));
  EXPECT_THAT(refusal([] { parse_strict_json(std::string("{}\0{}", 5), "s"); }), HasSubstr("zero byte"));
  EXPECT_THROW(parse_strict_json("{} // note", "s"), InputError);
  EXPECT_THROW(parse_strict_json("{\"a\":1e999}", "s"), InputError);
  EXPECT_THROW(parse_strict_json("{\"a\":NaN}", "s"), InputError);
  EXPECT_THROW(parse_strict_json("", "s"), InputError);
  EXPECT_EQ(parse_strict_json(" {\"a\" : 1.50}\n", "s"), (Json{{"a", 1.5}}));
}

TEST(Field, names_source_path_got_and_expected) {
  const Json document = Json::parse(R"({"law":{"gains":[1,"two",null],"order":3.7,"wide":1e300}})");
  const Field root(document, "a.json", "");
  const Field gains = root["law"]["gains"];
  EXPECT_EQ(refusal([&] { (void)gains.at(1).number(); }),
            "a.json: law.gains[1]: got \"two\", expected a finite number of at most 1e+100 in magnitude");
  EXPECT_EQ(refusal([&] { (void)root["law"]["order"].integer(0, 9); }),
            "a.json: law.order: got 3.7, expected an integer in [0, 9]");
  EXPECT_EQ(refusal([&] { (void)root["law"]["missing"]; }), "a.json: law.missing: got nothing, expected this member");
  EXPECT_EQ(refusal([&] { (void)gains.numbers(2); }),
            "a.json: law.gains: got an array of 3, expected an array of 2 numbers");
  EXPECT_EQ(refusal([&] {
              root["law"].only({"gains", "order"});
            }),
            "a.json: law: got the unknown member \"wide\", expected only gains, order");
  EXPECT_THROW((void)root["law"]["wide"].integer(0, 9), InputError);
  EXPECT_EQ(root["law"]["gains"].at(0).integer(0, 9), 1);
}

TEST(ReadFile, refuses_what_cannot_be_read) {
  EXPECT_THAT(refusal([] { read_file("/nonexistent/artifact.json"); }),
              HasSubstr("/nonexistent/artifact.json: file: "));
  EXPECT_THROW(read_file("/"), InputError);
}

}  // namespace
}  // namespace quasilpv
