// The compiled-in prism rules, the table they were written to, and the generator that made both.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "sim/core/error.h"
#include "sim/element/quadrature.h"
#include "tests/support/paths.h"
#include "tools/rules/prism_rule_search.h"

namespace rhytid {
namespace {

using rules::DerivedPrismPoint;
using rules::Quad;

const std::map<int, int> kKnownPoints{{1, 2}, {4, 11}, {5, 16}, {6, 28}, {8, 46}};

// ∫ u^a v^b w^c over the prism = a! b! / (a + b + 2)! · (2 / (c + 1) for even c, 0 for odd)
Quad exact_moment(int a, int b, int c) {
  if (c % 2 == 1) return 0;
  Quad value = 2;
  for (int k = 1; k <= a; ++k) value *= k;
  for (int k = 1; k <= b; ++k) value *= k;
  for (int k = 1; k <= a + b + 2; ++k) value /= k;
  return value / (c + 1);
}

double largest_moment_error(const std::vector<DerivedPrismPoint>& points, int degree) {
  double largest = 0;
  for (int a = 0; a <= degree; ++a)
    for (int b = 0; a + b <= degree; ++b)
      for (int c = 0; a + b + c <= degree; ++c) {
        Quad sum = 0;
        for (const DerivedPrismPoint& point : points) {
          Quad term = point.weight;
          for (int k = 0; k < a; ++k) term *= point.u;
          for (int k = 0; k < b; ++k) term *= point.v;
          for (int k = 0; k < c; ++k) term *= point.w;
          sum += term;
        }
        largest = std::max(largest, std::abs(static_cast<double>(sum - exact_moment(a, b, c))));
      }
  return largest;
}

std::vector<DerivedPrismPoint> widened(const PrismRule& rule) {
  std::vector<DerivedPrismPoint> points;
  for (const PrismPoint& p : rule.points) points.push_back({p.u, p.v, p.w, p.weight});
  return points;
}

// "-0.ddd" without the rounding of a double.
Quad parse_decimal(const std::string& text) {
  const bool negative = text[0] == '-';
  Quad value = 0, scale = 1;
  for (std::size_t k = negative ? 3 : 2; k < text.size(); ++k) value += (text[k] - '0') * (scale /= 10);
  return negative ? -value : value;
}

TEST(PrismRules, IntegrateAllMomentsUpToTheirDegreeAndNoMore) {
  for (const auto& [degree, count] : kKnownPoints) {
    const PrismRule& rule = prism_rule(degree);
    EXPECT_EQ(rule.degree, degree);
    EXPECT_EQ(static_cast<int>(rule.points.size()), count);
    EXPECT_LE(largest_moment_error(widened(rule), degree), 1e-15) << rule.name;
    EXPECT_GT(largest_moment_error(widened(rule), degree + 1), 1e-9) << rule.name;
  }
}

TEST(PrismRules, ArePositiveInsideAndSymmetric) {
  for (const auto& [degree, count] : kKnownPoints) {
    const PrismRule& rule = prism_rule(degree);
    for (const PrismPoint& p : rule.points) {
      const double t = 1 - p.u - p.v;
      EXPECT_GT(p.weight, 0);
      EXPECT_GT(std::min({p.u, p.v, t, (1 - std::abs(p.w)) / 2}), 1e-3) << rule.name;
      const std::array<double, 3> images[] = {
          {p.v, p.u, p.w}, {t, p.v, p.w}, {p.u, t, p.w}, {p.u, p.v, -p.w}};
      for (const auto& [u, v, w] : images)
        EXPECT_TRUE(std::any_of(rule.points.begin(), rule.points.end(), [&](const PrismPoint& q) {
          return std::abs(q.u - u) < 1e-15 && std::abs(q.v - v) < 1e-15 && std::abs(q.w - w) < 1e-15 &&
                 q.weight == p.weight;
        })) << rule.name;
    }
  }
}

TEST(PrismRules, LowestStoredDegreeThatSuffices) {
  EXPECT_EQ(prism_rule(2).name, prism_rule(4).name);
  EXPECT_EQ(prism_rule(7).name, "prism8-46");
  EXPECT_THROW(prism_rule(0), ContractError);
  EXPECT_THROW(prism_rule(9), ContractError);
}

TEST(PrismRules, TensorRuleIsTheProduct) {
  const PrismRule rule = tensor_rule(triangle_rule(8), 3);
  EXPECT_EQ(rule.points.size(), 48u);
  EXPECT_EQ(rule.name, "tri8-16 x GL3");
  EXPECT_EQ(rule.degree, 5);
  EXPECT_LE(largest_moment_error(widened(rule), 5), 1e-15);
}

TEST(PrismRules, TableHoldsThemToThirtyDigits) {
  std::ifstream file(source_dir() + "/data/quadrature/prism_rules.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "degree,name,u,v,w,weight");
  std::map<int, std::vector<DerivedPrismPoint>> table;
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::array<std::string, 6> cells;
    for (std::string& cell : cells) std::getline(fields, cell, ',');
    EXPECT_EQ(cells[1], prism_rule(std::stoi(cells[0])).name);
    table[std::stoi(cells[0])].push_back(
        {parse_decimal(cells[2]), parse_decimal(cells[3]), parse_decimal(cells[4]), parse_decimal(cells[5])});
  }
  ASSERT_EQ(table.size(), 4u);
  for (const auto& [degree, points] : table) {
    EXPECT_LE(largest_moment_error(points, degree), 1e-31) << degree;
    const PrismRule& rule = prism_rule(degree);
    ASSERT_EQ(rule.points.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_DOUBLE_EQ(rule.points[i].u, static_cast<double>(points[i].u));
      EXPECT_DOUBLE_EQ(rule.points[i].v, static_cast<double>(points[i].v));
      EXPECT_DOUBLE_EQ(rule.points[i].w, static_cast<double>(points[i].w));
      EXPECT_DOUBLE_EQ(rule.points[i].weight, static_cast<double>(points[i].weight));
    }
  }
}

TEST(PrismRules, GeneratorDerivesThemFromAnotherSeed) {
  rules::SearchOptions options;
  options.seed = 20;
  options.starts = 2000;
  options.keep = 1;
  for (const int degree : {4, 5, 6}) {
    const auto rule = rules::derive_prism_rule(degree, options);
    ASSERT_TRUE(rule) << degree;
    EXPECT_LE(largest_moment_error(rule->points, degree), 1e-31) << rule->name();
    EXPECT_EQ(static_cast<int>(rule->points.size()), kKnownPoints.at(degree));
    EXPECT_EQ(rule->structure.points(), kKnownPoints.at(degree));
  }
  EXPECT_FALSE(rules::derive_prism_rule(7, options));  // no structure known to the generator
}

}  // namespace
}  // namespace rhytid
