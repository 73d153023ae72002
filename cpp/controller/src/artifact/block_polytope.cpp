#include "quasilpv/block_polytope.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "document/document.hpp"
#include "quasilpv/step.hpp"

namespace quasilpv {
namespace {

constexpr std::size_t kMaxBlockPremises = 12;  // 4096 vertices: bounds the time of one evaluation
constexpr double kCollapseTolerance = 1e-9;    // relative to the largest entry of the vertices

// Premises of one block, marked in `seen`.
std::vector<int> parse_block_premises(const Field& field, std::vector<bool>& seen) {
  if (field.size() > kMaxBlockPremises || (field.size() == 0 && !seen.empty())) {
    field.fail(std::to_string(field.size()) + " premises", "1 to " + std::to_string(kMaxBlockPremises));
  }
  std::vector<int> premises;
  for (std::size_t k = 0; k < field.size(); ++k) {
    const auto premise = static_cast<std::size_t>(field.at(k).integer(0, static_cast<std::int64_t>(seen.size()) - 1));
    if (seen[premise]) {
      field.at(k).fail("premise " + std::to_string(premise) + " again", "every premise in exactly one block");
    }
    seen[premise] = true;
    premises.push_back(static_cast<int>(premise));
  }
  return premises;
}

}  // namespace

Eigen::MatrixXd parse_matrix(const Field& field, int rows, int columns) {
  if (field.size() != static_cast<std::size_t>(rows)) {
    field.fail(std::to_string(field.size()) + " rows", std::to_string(rows));
  }
  Eigen::MatrixXd matrix(rows, columns);
  for (int i = 0; i < rows; ++i) {
    const std::vector<double> row = field.at(static_cast<std::size_t>(i)).numbers(static_cast<std::size_t>(columns));
    matrix.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), columns);
  }
  return matrix;
}

BlockPolytope BlockPolytope::parse(const Field& field, int rows, int columns) {
  field.only({"premises", "lower", "upper", "centre", "blocks"});
  BlockPolytope polytope;
  polytope.parse_box(field);
  polytope.parse_blocks(field["blocks"], rows, columns);
  polytope.is_affine_ = std::all_of(polytope.blocks_.begin(), polytope.blocks_.end(),
                                    [](const Block& block) { return block.premises.size() <= 1; });
  if (polytope.is_affine_) {
    polytope.collapse(field);
  }
  return polytope;
}

void BlockPolytope::parse_box(const Field& field) {
  const auto premises = static_cast<std::size_t>(field["premises"].integer(0, kMaxPremises));
  lower_ = field["lower"].numbers(premises);
  upper_ = field["upper"].numbers(premises);
  centre_ = field["centre"].numbers(premises);
  for (std::size_t p = 0; p < premises; ++p) {
    if (lower_[p] >= upper_[p]) {
      field["upper"].at(p).fail(canonical_number(upper_[p]),
                                "more than the lower bound " + canonical_number(lower_[p]));
    }
    if (centre_[p] < lower_[p] || centre_[p] > upper_[p]) {
      field["centre"].at(p).fail(canonical_number(centre_[p]), "a point of the box");
    }
  }
}

void BlockPolytope::parse_blocks(const Field& field, int rows, int columns) {
  std::vector<bool> seen(centre_.size(), false);
  for (std::size_t b = 0; b < field.size(); ++b) {
    const Field block = field.at(b);
    block.only({"kind", "premises", "vertices"});
    block["kind"].expect_text("box");
    blocks_.push_back({parse_block_premises(block["premises"], seen), vertices_.size()});

    const Field vertices = block["vertices"];
    const std::size_t corners = std::size_t{1} << blocks_.back().premises.size();
    if (vertices.size() != corners) {
      vertices.fail(std::to_string(vertices.size()) + " vertices", std::to_string(corners));
    }
    for (std::size_t c = 0; c < corners; ++c) {
      vertices_.push_back(parse_matrix(vertices.at(c), rows, columns));
    }
  }
  const auto missing = std::find(seen.begin(), seen.end(), false);
  if (missing != seen.end()) {
    field.fail("no block for premise " + std::to_string(missing - seen.begin()), "every premise in exactly one block");
  }
  if (centre_.empty() && blocks_.size() != 1) {
    field.fail(std::to_string(blocks_.size()) + " blocks", "one block when there are no premises");
  }
}

bool BlockPolytope::is_scheduled_like(const BlockPolytope& other) const {
  const auto same_premises = [](const Block& mine, const Block& theirs) { return mine.premises == theirs.premises; };
  return lower_ == other.lower_ && upper_ == other.upper_ && centre_ == other.centre_ &&
         std::equal(blocks_.begin(), blocks_.end(), other.blocks_.begin(), other.blocks_.end(), same_premises);
}

// The vertices are the source of truth: the collapsed form is compared with their weighted sum at each of them, which
// is the point of the box where the premise of the block sits at a bound and the others at the centre.
void BlockPolytope::collapse(const Field& field) {
  const double block_weight = 1.0 / static_cast<double>(blocks_.size());
  slopes_.resize(centre_.size());
  for (const Block& block : blocks_) {
    for (const int premise : block.premises) {
      const auto p = static_cast<std::size_t>(premise);
      slopes_[p] = (vertices_[block.first_vertex + 1] - vertices_[block.first_vertex]) *
                   (block_weight / (upper_[p] - lower_[p]));
    }
  }
  centre_value_ = vertex_sum(centre_.data());

  double scale = 0.0;
  for (const Eigen::MatrixXd& vertex : vertices_) {
    scale = std::max(scale, vertex.cwiseAbs().maxCoeff());
  }
  for (std::size_t p = 0; p < centre_.size(); ++p) {
    for (const double bound : {lower_[p], upper_[p]}) {
      std::vector<double> corner = centre_;
      corner[p] = bound;
      const Eigen::MatrixXd collapsed = centre_value_ + (bound - centre_[p]) * slopes_[p];
      const double error = (collapsed - vertex_sum(corner.data())).cwiseAbs().maxCoeff();
      if (!(error <= kCollapseTolerance * scale)) {
        field.fail("a collapsed form that is off by " + Json(error).dump() + " where premise " + std::to_string(p) +
                       " is " + canonical_number(bound),
                   "the weighted sum of the vertices");
      }
    }
  }
}

Eigen::MatrixXd BlockPolytope::vertex_sum(const double* premise) const {
  std::vector<double> weight(vertices_.size());
  weights(premise, weight.data());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(vertices_.front().rows(), vertices_.front().cols());
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    sum += weight[i] * vertices_[i];
  }
  return sum;
}

void BlockPolytope::weights(const double* premise, double* weight) const noexcept {
  for (const Block& block : blocks_) {
    const std::size_t corners = std::size_t{1} << block.premises.size();
    for (std::size_t corner = 0; corner < corners; ++corner) {
      weight[block.first_vertex + corner] = corner_weight(block, corner, premise);
    }
  }
}

double BlockPolytope::weight_sum(const double* premise) const noexcept {
  double sum = 0.0;
  for (const Block& block : blocks_) {
    const std::size_t corners = std::size_t{1} << block.premises.size();
    for (std::size_t corner = 0; corner < corners; ++corner) {
      sum += corner_weight(block, corner, premise);
    }
  }
  return sum;
}

double BlockPolytope::excess(const double* premise) const noexcept {
  double largest = 0.0;
  for (std::size_t p = 0; p < centre_.size(); ++p) {
    if (!std::isfinite(premise[p])) {
      return std::numeric_limits<double>::infinity();
    }
    largest = std::max(largest, std::max(lower_[p] - premise[p], premise[p] - upper_[p]) / (upper_[p] - lower_[p]));
  }
  return largest;
}

// The first listed premise is the most significant bit of the corner.
double BlockPolytope::corner_weight(const Block& block, std::size_t corner, const double* premise) const noexcept {
  double weight = 1.0 / static_cast<double>(blocks_.size());
  const std::size_t size = block.premises.size();
  for (std::size_t k = 0; k < size; ++k) {
    const auto p = static_cast<std::size_t>(block.premises[k]);
    const double omega = (premise[p] - lower_[p]) / (upper_[p] - lower_[p]);
    weight *= ((corner >> (size - 1 - k)) & 1u) != 0 ? omega : 1.0 - omega;
  }
  return weight;
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): Eigen passes writable references by value.
bool BlockPolytope::evaluate_sized(double* premise, Eigen::Ref<Eigen::MatrixXd> value) const noexcept {
  const bool outside = clamp(premise);
  if (is_affine_) {
    value = centre_value_;
    for (std::size_t p = 0; p < slopes_.size(); ++p) {
      value += (premise[p] - centre_[p]) * slopes_[p];
    }
    return outside;
  }
  value.setZero();
  for (const Block& block : blocks_) {
    const std::size_t corners = std::size_t{1} << block.premises.size();
    for (std::size_t corner = 0; corner < corners; ++corner) {
      value += corner_weight(block, corner, premise) * vertices_[block.first_vertex + corner];
    }
  }
  return outside;
}

bool BlockPolytope::clamp(double* premise) const noexcept {
  bool outside = false;
  for (std::size_t p = 0; p < centre_.size(); ++p) {
    const double inside = std::isfinite(premise[p]) ? std::clamp(premise[p], lower_[p], upper_[p]) : centre_[p];
    outside = outside || !(inside == premise[p]);
    premise[p] = inside;
  }
  return outside;
}

}  // namespace quasilpv
