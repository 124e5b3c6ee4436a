#include "base/decimal.h"

#include <clocale>
#include <cmath>
#include <cstring>
#include <iomanip>
#include <limits>
#include <locale>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

namespace dccd {
namespace {

TEST(DecimalNumber, IsWholeOrNone) {
  const std::pair<const char*, double> good[] = {{"0", 0},
                                                 {"-0.5", -0.5},
                                                 {".5", 0.5},
                                                 {"5.", 5},
                                                 {"+5e-3", 5e-3},
                                                 {"1E3", 1000},
                                                 {"1e+03", 1000},
                                                 {"007", 7},
                                                 {"4.9e-324", std::numeric_limits<double>::denorm_min()},
                                                 {"1e-999", 0},
                                                 {"1.7976931348623157e308", std::numeric_limits<double>::max()}};
  for (const auto& [word, value] : good) EXPECT_EQ(decimalNumber(word), value) << word;
  for (const char* word : {"",       " 1",    "1 ",      "+",         "-",    ".",     "e5",       "1e",
                           "1e+",    "1.0-1", "1.0+1",   "1.0D-2",    "1d0",  "0,5",   "1.2.3",    "0x10",
                           "0x1p3",  "1f",    "1_0",     "--1",       "+-1",  "1e5.0", "1e999",    "-1e999",
                           "nan(1)", "in",    "infinit", "infinityx", "inf1", "1#INF", "\xd9\xa1", "\342\210\2221"}) {
    EXPECT_EQ(decimalNumber(word), std::nullopt) << word;
  }
  EXPECT_EQ(decimalNumber(std::string("1\0", 2)), std::nullopt);
  for (const char* word : {"nan", "NaN", "-nan", "+NAN"}) EXPECT_TRUE(std::isnan(decimalNumber(word).value())) << word;
  for (const char* word : {"inf", "+INF", "Infinity"}) EXPECT_EQ(decimalNumber(word), HUGE_VAL) << word;
  EXPECT_EQ(decimalNumber("-inf"), -HUGE_VAL);
}

TEST(DecimalNumber, IsTheNearestDoubleInEveryLocale) {
  const std::string before = std::setlocale(LC_ALL, nullptr);
  for (const char* locale : {"C", "de_DE.UTF-8", "fr_FR.UTF-8"}) {
    if (!std::setlocale(LC_ALL, locale)) continue;  // not installed
    std::mt19937_64 random(1);
    for (int i = 0; i < 1000; ++i) {
      double value;
      const std::uint64_t bits = random();
      std::memcpy(&value, &bits, sizeof value);
      if (!std::isfinite(value)) continue;
      std::ostringstream text;
      text.imbue(std::locale::classic());
      text << std::setprecision(17) << value;
      EXPECT_EQ(decimalNumber(text.str()), value) << text.str();
    }
    EXPECT_EQ(decimalNumber("0,5"), std::nullopt) << locale;
  }
  std::setlocale(LC_ALL, before.c_str());
}

TEST(DecimalInteger, IsWholeOrNone) {
  const std::pair<const char*, std::int64_t> good[] = {
      {"0", 0}, {"-7", -7}, {"+7", 7}, {"010", 10}, {"9223372036854775807", std::numeric_limits<std::int64_t>::max()}};
  for (const auto& [word, value] : good) EXPECT_EQ(decimalInteger(word), value) << word;
  for (const char* word :
       {"", "+", "-", "+-1", "--1", "1.0", "1e0", "0x10", "1_0", " 1", "1 ", "9223372036854775808", "one"}) {
    EXPECT_EQ(decimalInteger(word), std::nullopt) << word;
  }
  for (const char* word : {"010", "-010", "+00"}) EXPECT_TRUE(looksOctal(word)) << word;
  for (const char* word : {"", "0", "-0", "10", "0.5", "x0"}) EXPECT_FALSE(looksOctal(word)) << word;
}

}  // namespace
}  // namespace dccd
