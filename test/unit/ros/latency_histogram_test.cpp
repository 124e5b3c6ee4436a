#include "output/latency_histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace dccd {
namespace {

TEST(LatencyHistogram, QuantilesAreNeverTooSmallAndAtMostABinTooLarge) {
  std::mt19937 random(3);
  std::lognormal_distribution<double> seconds(-6, 2);
  LatencyHistogram histogram;
  std::vector<double> all;
  for (int i = 0; i < 20000; ++i) {
    all.push_back(seconds(random));
    histogram.add(all.back());
  }
  std::sort(all.begin(), all.end());
  for (const double q : {0.01, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const double exact = all[static_cast<std::size_t>(std::ceil(q * 20000)) - 1];
    EXPECT_GE(histogram.quantile(q), exact) << q;
    EXPECT_LE(histogram.quantile(q), exact * std::pow(10, 1.0 / LatencyHistogram::BINS_PER_DECADE)) << q;
  }
  EXPECT_EQ(histogram.worst(), all.back());
  EXPECT_EQ(histogram.quantile(1), all.back());
}

TEST(LatencyHistogram, EdgesAndExtremes) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0);
  for (const double s : {-1.0, 0.0, 1e-9, 1e-3, 1e9, std::numeric_limits<double>::infinity()}) histogram.add(s);
  histogram.add(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(histogram.count(), 7u);
  EXPECT_EQ(histogram.quantile(0), 1e-6 * std::pow(10, 0.05)) << "the first bin has what is below it";
  EXPECT_EQ(histogram.worst(), std::numeric_limits<double>::infinity());
}

TEST(LatencyHistogram, AnEdgeItselfBelongsBelowIt) {
  for (std::size_t bin = 0; bin < LatencyHistogram::BINS; ++bin) {
    const double edge_s =
        LatencyHistogram::LEAST_S * std::pow(10.0, static_cast<double>(bin + 1) / LatencyHistogram::BINS_PER_DECADE);
    LatencyHistogram two;
    for (const double s : {edge_s, 1e9}) two.add(s);
    EXPECT_EQ(two.quantile(0.5), edge_s);
  }
}

}  // namespace
}  // namespace dccd
