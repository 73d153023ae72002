#include "quasilpv/block_polytope.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <random>

#include "artifact_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::refusal;
using ::quasilpv::testing::TestArm;
using ::testing::HasSubstr;

constexpr int kRows = 3;
constexpr int kColumns = 2;
using Matrix = Eigen::Matrix<double, kRows, kColumns>;

// X(z) = X_0 + sum_p z_p X_p over a box, and its vertices for any partition, from the definition:
// X_c = X(z_c) + G sum over the block of (c_p - z_c,p) X_p.
struct AffineMatrix {
  Matrix constant;
  std::vector<Matrix> slopes;
  std::vector<double> lower, upper, centre;

  AffineMatrix(int premises, std::mt19937_64& random) : constant(random_matrix(random)) {
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    for (int p = 0; p < premises; ++p) {
      slopes.push_back(random_matrix(random));
      lower.push_back(-3.0 + 4.0 * uniform(random));
      upper.push_back(lower.back() + 0.1 + 3.0 * uniform(random));
      centre.push_back(lower.back() + uniform(random) * (upper.back() - lower.back()));
    }
  }

  static Matrix random_matrix(std::mt19937_64& random) {
    std::uniform_real_distribution<double> uniform(-5.0, 5.0);
    return Matrix::NullaryExpr([&] { return uniform(random); });
  }

  Matrix at(const std::vector<double>& z) const {
    Matrix value = constant;
    for (std::size_t p = 0; p < slopes.size(); ++p) {
      value += z[p] * slopes[p];
    }
    return value;
  }

  std::vector<double> random_point(std::mt19937_64& random) const {
    std::vector<double> z;
    for (std::size_t p = 0; p < slopes.size(); ++p) {
      z.push_back(std::uniform_real_distribution<double>(lower[p], upper[p])(random));
    }
    return z;
  }

  Json table(const std::vector<std::vector<int>>& partition) const {
    Json blocks = Json::array();
    for (const std::vector<int>& group : partition) {
      Json vertices = Json::array();
      for (unsigned corner = 0; corner < 1u << group.size(); ++corner) {
        Matrix vertex = at(centre);
        for (std::size_t k = 0; k < group.size(); ++k) {
          const auto p = static_cast<std::size_t>(group[k]);
          const bool at_upper = (corner >> (group.size() - 1 - k) & 1u) != 0;
          vertex += static_cast<double>(partition.size()) * ((at_upper ? upper : lower)[p] - centre[p]) * slopes[p];
        }
        vertices.push_back(TestArm::rows(vertex));
      }
      blocks.push_back({{"kind", "box"}, {"premises", group}, {"vertices", vertices}});
    }
    return {{"premises", slopes.size()}, {"lower", lower}, {"upper", upper}, {"centre", centre}, {"blocks", blocks}};
  }
};

std::vector<std::vector<int>> random_partition(int premises, std::mt19937_64& random) {
  std::vector<int> order(static_cast<std::size_t>(premises));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  std::vector<std::vector<int>> partition;
  for (const int premise : order) {
    if (partition.empty() || random() % 2 == 0) {
      partition.emplace_back();
    }
    partition.back().push_back(premise);
  }
  return partition;
}

std::vector<std::vector<int>> singles(int premises) {
  std::vector<std::vector<int>> partition;
  for (int p = 0; p < premises; ++p) {
    partition.push_back({p});
  }
  return partition;
}

BlockPolytope parse(const Json& table) {
  return BlockPolytope::parse(Field(table, "test", "inertia"), kRows, kColumns);
}

TEST(BlockPolytope, reproduces_random_affine_matrices_for_random_partitions) {
  std::mt19937_64 random(17);
  int collapsed = 0;
  for (int i = 0; i < 200; ++i) {
    const int premises = 1 + i % 6;
    const AffineMatrix affine(premises, random);
    const BlockPolytope polytope =
        parse(affine.table(i % 3 == 0 ? singles(premises) : random_partition(premises, random)));
    collapsed += polytope.is_affine() ? 1 : 0;
    for (int k = 0; k < 10; ++k) {
      std::vector<double> z = affine.random_point(random);
      const Matrix expected = affine.at(z);
      Matrix value;
      EXPECT_FALSE(polytope.evaluate(z.data(), value));
      EXPECT_LT((value - expected).cwiseAbs().maxCoeff(), 1e-12 * 100.0);
    }
  }
  EXPECT_GT(collapsed, 60);
  EXPECT_LT(collapsed, 190);
}

TEST(BlockPolytope, F9_has_weights_that_are_not_negative_and_sum_to_one_over_the_blocks_in_each_block) {
  std::mt19937_64 random(19);
  for (int i = 0; i < 100; ++i) {
    const int premises = 1 + i % 5;
    const AffineMatrix affine(premises, random);
    const std::vector<std::vector<int>> partition = random_partition(premises, random);
    const BlockPolytope polytope = parse(affine.table(partition));
    std::vector<double> weight(static_cast<std::size_t>(polytope.vertices()));
    const std::vector<double> point = affine.random_point(random);
    polytope.weights(point.data(), weight.data());
    EXPECT_NEAR(polytope.weight_sum(point.data()), std::accumulate(weight.begin(), weight.end(), 0.0), 1e-15);
    auto next = weight.begin();
    for (const std::vector<int>& group : partition) {
      const auto end = next + (1 << group.size());
      EXPECT_GE(*std::min_element(next, end), 0.0);
      EXPECT_NEAR(std::accumulate(next, end, 0.0), 1.0 / static_cast<double>(partition.size()), 1e-15);
      next = end;
    }
    EXPECT_EQ(next, weight.end());
  }
}

TEST(BlockPolytope, takes_the_first_listed_premise_as_the_most_significant_bit) {
  std::mt19937_64 random(23);
  const AffineMatrix affine(2, random);
  const BlockPolytope polytope = parse(affine.table({{1, 0}}));
  std::vector<double> weight(4);
  const std::vector<double> corner = {affine.lower[0], affine.upper[1]};  // bits of (premise 1, premise 0): 1, 0
  polytope.weights(corner.data(), weight.data());
  EXPECT_THAT(weight, ::testing::ElementsAre(0.0, 0.0, 1.0, 0.0));
}

// Adding T_b - (1/G) sum T_b' to every vertex of block b leaves X(z) unchanged (Dehak 2022, II.11).
TEST(BlockPolytope, is_unchanged_by_a_slack_shift) {
  std::mt19937_64 random(29);
  const AffineMatrix affine(2, random);
  Json table = affine.table(singles(2));
  const Matrix shift = AffineMatrix::random_matrix(random);
  for (std::size_t b = 0; b < 2; ++b) {
    for (Json& vertex : table["blocks"][b]["vertices"]) {
      for (std::size_t i = 0; i < kRows; ++i) {
        for (std::size_t j = 0; j < kColumns; ++j) {
          const double change = shift(static_cast<int>(i), static_cast<int>(j)) * (b == 0 ? 0.5 : -0.5);
          vertex[i][j] = vertex[i][j].get<double>() + change;
        }
      }
    }
  }
  std::vector<double> z = affine.random_point(random);
  Matrix value;
  parse(table).evaluate(z.data(), value);
  EXPECT_LT((value - affine.at(z)).cwiseAbs().maxCoeff(), 1e-12 * 100.0);
}

TEST(BlockPolytope, F9_when_a_premise_is_outside_the_box_expect_it_clamped_and_reported) {
  std::mt19937_64 random(31);
  const AffineMatrix affine(2, random);
  for (const auto& partition : {singles(2), std::vector<std::vector<int>>{{0, 1}}}) {
    const BlockPolytope polytope = parse(affine.table(partition));
    std::vector<double> z = {affine.upper[0] + 1.0, affine.lower[1] - 1.0};
    Matrix value;
    EXPECT_TRUE(polytope.evaluate(z.data(), value));
    EXPECT_THAT(z, ::testing::ElementsAre(affine.upper[0], affine.lower[1]));
    EXPECT_LT((value - affine.at(z)).cwiseAbs().maxCoeff(), 1e-12 * 100.0);
    EXPECT_FALSE(polytope.evaluate(z.data(), value)) << "bounds belong to the box";
  }
}

TEST(BlockPolytope, when_a_premise_is_not_finite_expect_the_centre_and_a_report) {
  std::mt19937_64 random(37);
  const AffineMatrix affine(2, random);
  const BlockPolytope polytope = parse(affine.table(singles(2)));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    std::vector<double> z = {bad, affine.upper[1]};
    Matrix value;
    EXPECT_TRUE(polytope.evaluate(z.data(), value));
    EXPECT_EQ(z[0], affine.centre[0]);
    EXPECT_TRUE(value.allFinite());
  }
}

TEST(BlockPolytope, without_premises_is_its_one_vertex) {
  std::mt19937_64 random(41);
  const AffineMatrix affine(0, random);
  const BlockPolytope polytope = parse(affine.table({{}}));
  Matrix value;
  EXPECT_FALSE(polytope.evaluate(nullptr, value));
  EXPECT_EQ(value, affine.constant);
}

TEST(BlockPolytope, refuses_a_collapse_that_does_not_reproduce_the_vertices) {
  std::mt19937_64 random(43);
  Json table = AffineMatrix(1, random).table({{0}});
  table["lower"][0] = -1e100;  // over the widest box the slopes of the smallest vertices are zero in double arithmetic
  table["upper"][0] = 1e100;
  for (Json& vertex : table["blocks"][0]["vertices"]) {
    for (Json& row : vertex) {
      for (Json& entry : row) {
        entry = entry.get<double>() * 1e-250;
      }
    }
  }
  EXPECT_THAT(refusal([&] { parse(table); }), HasSubstr("inertia: got a collapsed form that is off by"));
}

TEST(BlockPolytope, refuses_malformed_tables_and_names_the_field) {
  std::mt19937_64 random(47);
  const Json sound = AffineMatrix(2, random).table({{0}, {1}});
  const auto refused = [&sound](const std::string& pointer, const Json& value) {
    Json table = sound;
    table[Json::json_pointer(pointer)] = value;
    return refusal([&] { parse(table); });
  };
  EXPECT_THAT(refused("/premises", 3), HasSubstr("inertia.lower: got an array of 2, expected an array of 3"));
  EXPECT_THAT(refused("/premises", 33), HasSubstr("integer in [0, 32]"));
  EXPECT_THAT(refused("/upper/0", -100.0), HasSubstr("inertia.upper[0]: got -100"));
  EXPECT_THAT(refused("/centre/1", 100.0), HasSubstr("inertia.centre[1]: got 100"));
  EXPECT_THAT(refused("/blocks/0/kind", "simplex"), HasSubstr("inertia.blocks[0].kind: got \"simplex\""));
  EXPECT_THAT(refused("/blocks/1/premises/0", 0), HasSubstr("inertia.blocks[1].premises[0]: got premise 0 again"));
  EXPECT_THAT(refused("/blocks/1/premises/0", 2), HasSubstr("integer in [0, 1]"));
  EXPECT_THAT(refused("/blocks/1/premises", Json::array()), HasSubstr("inertia.blocks[1].premises: got 0 premises"));
  EXPECT_THAT(refused("/blocks/1/vertices/2", 0), HasSubstr("inertia.blocks[1].vertices: got 3 vertices, expected 2"));
  EXPECT_THAT(refused("/blocks/0/vertices/0/0", {1.0}), HasSubstr("inertia.blocks[0].vertices[0][0]"));
  EXPECT_THAT(refused("/blocks/0/vertices/0/0/1", "x"), HasSubstr("inertia.blocks[0].vertices[0][0][1]: got \"x\""));
  EXPECT_THAT(refused("/extra", 1), HasSubstr("inertia: got the unknown member \"extra\""));
  Json missing = sound;
  missing["blocks"].erase(1);
  EXPECT_THAT(refusal([&] { parse(missing); }), HasSubstr("inertia.blocks: got no block for premise 1"));
}

}  // namespace
}  // namespace quasilpv
