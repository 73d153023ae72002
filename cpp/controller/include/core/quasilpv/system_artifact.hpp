// The controller of a general system as data: an immutable, validated artifact (docs/reference/formats.md).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "quasilpv/block_polytope.hpp"
#include "quasilpv/program.hpp"
#include "quasilpv/system_observer.hpp"

namespace quasilpv {

class Field;

inline constexpr int kMaxStates = 32;
inline constexpr int kMaxInputs = 7;
inline constexpr int kMaxSignals = 128;

/// A named signal. Bounds are those of its deviation from `trim`; infinite where nothing bounds it.
struct SystemSignal {
  std::string name;
  double low = 0.0;
  double high = 0.0;
  double trim = 0.0;
  bool known = true;  ///< of a parameter: whether the law is told its value
};

/// A validated artifact of a general system: u = K(z) x_d in the region x_d' P^-1 x_d <= 1, with an observer where
/// states are not measured. Immutable, self-contained.
/// Signals are numbered: states (differential ones first), inputs, parameters; in programs of the plant the rates of
/// the states after them.
class SystemArtifact {
 public:
  /// Loads either twin. INIT-ONLY. Throws InputError like Artifact::load.
  static SystemArtifact load(const std::string& path);
  /// The same from bytes; `source` names them in errors. INIT-ONLY. Throws InputError.
  static SystemArtifact parse(std::string_view bytes, const std::string& source);
  /// Whether a file says that it is one, whatever else is in it. INIT-ONLY. Throws InputError if it is no document.
  static bool is_in(const std::string& path);

  const std::string& name() const noexcept { return name_; }
  const std::string& hash() const noexcept { return hash_; }
  std::int64_t hash_prefix() const noexcept { return hash_prefix_; }  ///< the first eight bytes, big endian
  double sample_period_s() const noexcept { return sample_period_s_; }

  const std::vector<SystemSignal>& states() const noexcept { return states_; }
  const std::vector<SystemSignal>& inputs() const noexcept { return inputs_; }
  const std::vector<SystemSignal>& parameters() const noexcept { return parameters_; }
  int differential() const noexcept { return differential_; }  ///< the first states
  int signals() const noexcept { return static_cast<int>(states_.size() + inputs_.size() + parameters_.size()); }

  const Program& schedule() const noexcept { return schedule_; }
  const BlockPolytope& gain() const noexcept { return gain_; }
  /// For so long a premise may be outside its box, clamped, before that is a fault; 0: at once; infinite: always.
  double premise_fault_s() const noexcept { return premise_fault_s_; }
  const Eigen::MatrixXd& lyapunov_inverse() const noexcept { return lyapunov_inverse_; }  ///< P^-1

  /// Estimates the states that are not measured; none: the law is told all of them.
  const std::optional<SystemObserverParameters>& observer() const noexcept { return observer_; }
  /// Whether a state is told to the law.
  bool is_measured(std::size_t state) const noexcept { return !observer_ || observer_->is_measured[state]; }

  /// F(x', x, u, p) of all signals and rates.
  const Program& residual() const noexcept { return residual_; }
  /// Row i: dF_i/dx' of every state, then dF_i/dx.
  const std::vector<Program>& jacobian() const noexcept { return jacobian_; }

 private:
  void parse_signals(const Field& field);
  void parse_observer(const Field& field, const Field& model);
  void parse_plant(const Field& field);

  std::string name_;
  std::string hash_;
  std::int64_t hash_prefix_ = 0;
  double sample_period_s_ = 0.0;
  std::vector<SystemSignal> states_;
  std::vector<SystemSignal> inputs_;
  std::vector<SystemSignal> parameters_;
  int differential_ = 0;
  Program schedule_;
  BlockPolytope gain_;
  double premise_fault_s_ = 1.0;  // of version 1
  Eigen::MatrixXd lyapunov_inverse_;
  std::optional<SystemObserverParameters> observer_;
  Program residual_;
  std::vector<Program> jacobian_;
};

}  // namespace quasilpv
