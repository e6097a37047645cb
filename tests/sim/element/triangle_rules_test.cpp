// The compiled-in triangle rules, the table they were written to, and the generator that made both.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "sim/core/error.h"
#include "sim/element/quadrature.h"
#include "tests/support/paths.h"
#include "tools/rules/triangle_rule_search.h"

namespace rhytid {
namespace {

using rules::DerivedPoint;
using rules::Quad;

// ∫ u^a v^b over the reference triangle = a! b! / (a + b + 2)!
Quad exact_moment(int a, int b) {
  Quad value = 1;
  for (int k = 1; k <= a; ++k) value *= k;
  for (int k = 1; k <= b; ++k) value *= k;
  for (int k = 1; k <= a + b + 2; ++k) value /= k;
  return value;
}

double largest_moment_error(const std::vector<DerivedPoint>& points, int degree) {
  double largest = 0;
  for (int a = 0; a <= degree; ++a) {
    for (int b = 0; a + b <= degree; ++b) {
      Quad sum = 0;
      for (const DerivedPoint& point : points) {
        Quad term = point.weight;
        for (int k = 0; k < a; ++k) term *= point.u;
        for (int k = 0; k < b; ++k) term *= point.v;
        sum += term;
      }
      largest = std::max(largest, std::abs(static_cast<double>(sum - exact_moment(a, b))));
    }
  }
  return largest;
}

std::vector<DerivedPoint> widened(const TriangleRule& rule) {
  std::vector<DerivedPoint> points;
  for (const TrianglePoint& point : rule.points) points.push_back({point.u, point.v, point.weight});
  return points;
}

// "0.ddd" without the rounding of a double.
Quad parse_decimal(const std::string& text) {
  Quad value = 0, scale = 1;
  for (std::size_t k = 2; k < text.size(); ++k) value += (text[k] - '0') * (scale /= 10);
  return value;
}

struct TableRule {
  std::string name;
  std::vector<DerivedPoint> points;
};

std::map<int, TableRule> read_table() {
  std::ifstream file(source_dir() + "/data/quadrature/triangle_rules.csv");
  std::map<int, TableRule> table;
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "degree,name,u,v,w");
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string degree, name, u, v, w;
    std::getline(fields, degree, ',');
    std::getline(fields, name, ',');
    std::getline(fields, u, ',');
    std::getline(fields, v, ',');
    std::getline(fields, w, ',');
    EXPECT_GE(u.size(), 35u);  // "0." and 33 digits
    TableRule& rule = table[std::stoi(degree)];
    rule.name = name;
    rule.points.push_back({parse_decimal(u), parse_decimal(v), parse_decimal(w)});
  }
  return table;
}

TEST(TriangleRules, IntegrateAllMomentsUpToTheirDegree) {
  for (int degree = 1; degree <= 12; ++degree) {
    const TriangleRule& rule = triangle_rule(degree);
    EXPECT_GE(rule.degree, degree);
    EXPECT_LE(largest_moment_error(widened(rule), rule.degree), 1e-15) << rule.name;
    EXPECT_GT(largest_moment_error(widened(rule), rule.degree + 1), 1e-9) << rule.name;
    EXPECT_EQ(rule.name, "tri" + std::to_string(rule.degree) + "-" + std::to_string(rule.points.size()));
  }
}

TEST(TriangleRules, ArePositiveAndInside) {
  for (int degree = 1; degree <= 12; ++degree) {
    for (const auto& [u, v, weight] : triangle_rule(degree).points) {
      EXPECT_GT(weight, 0);
      EXPECT_GT(std::min({u, v, 1 - u - v}), 1e-3);
    }
  }
}

TEST(TriangleRules, AreSymmetricUnderThePermutationsOfTheCorners) {
  for (int degree = 1; degree <= 12; ++degree) {
    const TriangleRule& rule = triangle_rule(degree);
    for (const TrianglePoint& point : rule.points) {
      const double t = 1 - point.u - point.v;
      const double images[][2] = {{point.v, point.u}, {t, point.v}, {point.u, t}, {point.v, t}, {t, point.u}};
      for (const auto& image : images) {
        EXPECT_TRUE(std::any_of(rule.points.begin(), rule.points.end(),
                                [&](const TrianglePoint& other) {
                                  return std::abs(other.u - image[0]) < 1e-15 &&
                                         std::abs(other.v - image[1]) < 1e-15 && other.weight == point.weight;
                                }))
            << rule.name << " " << point.u << " " << point.v;
      }
    }
  }
}

TEST(TriangleRules, HaveTheKnownNumbersOfPoints) {
  const std::map<int, int> expected{{1, 1},  {2, 3},  {3, 6},  {4, 6},   {5, 7},   {6, 12},
                                    {7, 15}, {8, 16}, {9, 19}, {10, 25}, {11, 28}, {12, 33}};
  for (const auto& [degree, points] : expected)
    EXPECT_EQ(static_cast<int>(triangle_rule(degree).points.size()), points) << degree;
  EXPECT_EQ(triangle_rule(3).name, "tri4-6");
}

TEST(TriangleRules, RefuseOtherDegrees) {
  EXPECT_THROW(triangle_rule(0), ContractError);
  EXPECT_THROW(triangle_rule(13), ContractError);
}

TEST(TriangleRules, TableHoldsThemToThirtyDigits) {
  const auto table = read_table();
  ASSERT_EQ(table.size(), 11u);
  for (const auto& [degree, stored] : table) {
    EXPECT_LE(largest_moment_error(stored.points, degree), 1e-31) << stored.name;
    const TriangleRule& rule = triangle_rule(degree);
    ASSERT_EQ(rule.name, stored.name);
    ASSERT_EQ(rule.points.size(), stored.points.size());
    for (std::size_t i = 0; i < rule.points.size(); ++i) {
      EXPECT_DOUBLE_EQ(rule.points[i].u, static_cast<double>(stored.points[i].u));
      EXPECT_DOUBLE_EQ(rule.points[i].v, static_cast<double>(stored.points[i].v));
      EXPECT_DOUBLE_EQ(rule.points[i].weight, static_cast<double>(stored.points[i].weight));
    }
  }
}

TEST(TriangleRules, GeneratorDerivesLowDegreesFromAnotherSeed) {
  rules::SearchOptions options;
  options.seed = 20;
  for (int degree = 1; degree <= 6; ++degree) {
    const auto rule = rules::derive_triangle_rule(degree, options);
    ASSERT_TRUE(rule) << degree;
    EXPECT_LE(largest_moment_error(rule->points, degree), 1e-31) << rule->name();
    EXPECT_GT(rule->margin, 1e-3);
    for (const DerivedPoint& point : rule->points) EXPECT_TRUE(point.weight > 0);
    EXPECT_EQ(rule->points.size(), triangle_rule(degree).points.size());
  }
}

TEST(TriangleRules, GeneratorSaysWhenItFindsNone) {
  rules::SearchOptions options;
  options.max_points = 11;  // degree 6 needs 12
  options.starts = 20;
  EXPECT_FALSE(rules::derive_triangle_rule(6, options));
}

TEST(TriangleRules, DecimalsRoundToNearest) {
  EXPECT_EQ(rules::to_decimal(Quad(1) / 8, 2), "0.13");
  EXPECT_EQ(rules::to_decimal(Quad(2) / 3, 30), "0.666666666666666666666666666667");
}

}  // namespace
}  // namespace rhytid
