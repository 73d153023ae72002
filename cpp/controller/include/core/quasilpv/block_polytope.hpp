// The block polytope at run time: a matrix affine (or multilinear) in measured premises, from its vertices.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace quasilpv {

class Field;

/// An array of `rows` rows of `columns` numbers. INIT-ONLY. Throws InputError for another shape.
Eigen::MatrixXd parse_matrix(const Field& field, int rows, int columns);

/// A matrix X(z) given by vertices: X(z) = sum over blocks b and corners c of w_bc(z) X_bc, with
/// w_bc(z) = (1/G) prod_p omega_p^{c_p}(z_p) >= 0 and sum_c w_bc = 1/G for each of the G blocks.
///
/// If every block has one premise, X is affine in z and is collapsed at load to X(z_c) + sum_p (z_p - z_c,p) X_p:
/// p + 1 small matrices per evaluation instead of 2p. Blocks of several premises keep the vertex sum. Immutable.
/// Source: Dehak 2022, (II.6)-(II.10); format: docs/reference/formats.md, "Block polytope".
class BlockPolytope {
 public:
  /// Matrices of any size known at load.
  /// INIT-ONLY. Throws InputError for a malformed field and for a collapse that does not reproduce every vertex.
  static BlockPolytope parse(const Field& field, int rows, int columns);

  /// Clamps z to the box in place, see clamp(), and stores X(z).
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  /// \param[in,out] premise `premises()` values.
  /// \param[out] value X(z); Rows x Columns must be the size given to parse().
  /// \returns whether a premise was outside its interval.
  template <int Rows, int Columns>
  bool evaluate(double* premise, Eigen::Matrix<double, Rows, Columns>& value) const noexcept;

  /// The same for a matrix whose size is known at load only; `value` has it already.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  bool evaluate_sized(double* premise, Eigen::Ref<Eigen::MatrixXd> value) const noexcept;

  /// Clamps z to the box in place; a premise that is not finite becomes the centre.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  /// \param[in,out] premise `premises()` values.
  /// \returns whether a premise was outside its interval.
  bool clamp(double* premise) const noexcept;

  /// Weight of every vertex, block by block, for z inside the box. RT-SAFE (bounded, no allocation, no lock, no throw).
  /// \param[out] weight `vertices()` values, each >= 0.
  void weights(const double* premise, double* weight) const noexcept;

  /// Sum of the weights of all vertices, for z inside the box: 1 up to rounding.
  /// RT-SAFE (bounded, no allocation, no lock, no throw).
  double weight_sum(const double* premise) const noexcept;

  /// How far z is outside the box, in widths of the box: max_p max(lower_p - z_p, z_p - upper_p, 0) / (upper_p -
  /// lower_p); infinite if a premise is not finite. RT-SAFE (bounded, no allocation, no lock, no throw).
  double excess(const double* premise) const noexcept;

  int premises() const noexcept { return static_cast<int>(centre_.size()); }
  int vertices() const noexcept { return static_cast<int>(vertices_.size()); }
  /// Whether the other has the same box, centre and partition, so that one premise vector has the same weights in both.
  bool is_scheduled_like(const BlockPolytope& other) const;
  /// Whether the collapsed form is in use.
  bool is_affine() const noexcept { return is_affine_; }
  /// X at the centre of the box. INIT-ONLY.
  Eigen::MatrixXd at_centre() const { return vertex_sum(centre_.data()); }
  const Eigen::MatrixXd& vertex(int index) const { return vertices_[static_cast<std::size_t>(index)]; }

 private:
  /// A box block: its premises, and where its 2^size vertices start.
  struct Block {
    std::vector<int> premises;
    std::size_t first_vertex;
  };

  void parse_box(const Field& field);
  void parse_blocks(const Field& field, int rows, int columns);
  void collapse(const Field& field);
  Eigen::MatrixXd vertex_sum(const double* premise) const;
  double corner_weight(const Block& block, std::size_t corner, const double* premise) const noexcept;
  std::vector<double> lower_;
  std::vector<double> upper_;
  std::vector<double> centre_;
  std::vector<Block> blocks_;
  std::vector<Eigen::MatrixXd> vertices_;
  bool is_affine_ = false;
  Eigen::MatrixXd centre_value_;         ///< X(z_c)
  std::vector<Eigen::MatrixXd> slopes_;  ///< X_p
};

template <int Rows, int Columns>
bool BlockPolytope::evaluate(double* premise, Eigen::Matrix<double, Rows, Columns>& value) const noexcept {
  using Fixed = Eigen::Map<const Eigen::Matrix<double, Rows, Columns>>;
  const bool outside = clamp(premise);
  if (is_affine_) {
    value = Fixed(centre_value_.data());
    for (std::size_t p = 0; p < slopes_.size(); ++p) {
      value += (premise[p] - centre_[p]) * Fixed(slopes_[p].data());
    }
    return outside;
  }
  value.setZero();
  for (const Block& block : blocks_) {
    const std::size_t corners = std::size_t{1} << block.premises.size();
    for (std::size_t corner = 0; corner < corners; ++corner) {
      value += corner_weight(block, corner, premise) * Fixed(vertices_[block.first_vertex + corner].data());
    }
  }
  return outside;
}

}  // namespace quasilpv
