// State feedback with a memory of the premises: the laws of Theorems II.7 and II.8.
#include "laws/common/descriptor_gain.hpp"
#include "laws/common/law_table.hpp"
#include "laws/common/moving_window.hpp"
#include "laws/common/stabilising_law.hpp"

namespace quasilpv {
namespace {

constexpr int kMaxDelayedVertices = 16;
constexpr int kMinWindowSamples = 5;
constexpr int kMaxWindowSamples = 4096;

/// u = F E(z)^-T P(varpi)^-1 x, F = sum_jkm w_j(z) varpi_k w_m(z_d) F_jkm, with varpi the mean of the weights w over
/// the last tau = N T seconds and z_d what z was tau ago; without E if `descriptor` is false.
struct DelayedFeedbackParameters final : StabilisingParameters {
  BlockPolytope lyapunov;                   ///< P, 2n x 2n, symmetric positive definite vertices; gives the weights
  std::vector<Eigen::MatrixXd> numerators;  ///< F_jkm, n x 2n, m fastest
  int window_samples = 0;                   ///< N; 0: the limit tau -> 0, varpi = w(z) and z_d = z
  bool descriptor = false;                  ///< false: without E(z)

  std::unique_ptr<ControlLaw> make_law(const LawSettings& settings) const override;
};

/// With the weights w of the schedule's vertices, their mean varpi over the last tau = N T seconds and their values w_d
/// tau seconds ago,
///
///     Gamma = F E(z)^-T P(varpi)^-1 x, limited,   P = sum_k varpi_k P_k,   F = sum_jkm w_j varpi_k (w_d)_m F_jkm
///
/// with x = (y - r, w - r') and E = diag(I, M_n), or E = I. Before the first sample the weights count as constant. N =
/// 0 is the limit tau -> 0: varpi = w_d = w. Source: Dehak 2022, (II.49) (E = I) and (II.69).
template <int N>
class DelayedFeedbackLaw final : public StabilisingLaw<N> {
 public:
  DelayedFeedbackLaw(const DelayedFeedbackParameters& parameters, const LawSettings& settings)
      : StabilisingLaw<N>(parameters, settings),
        lyapunov_(parameters.lyapunov),
        numerators_(parameters.numerators.begin(), parameters.numerators.end()),
        window_(parameters.window_samples, parameters.lyapunov.vertices()),
        descriptor_(parameters.descriptor) {}

 private:
  using WeightArray = std::array<double, kMaxDelayedVertices>;

  void start(const typename VelocityLaw<N>::Sample& /*sample*/, const ModelSample<N>& /*model*/,
             const JointVector<N>& /*in_force*/) noexcept override {
    starting_ = true;
  }

  JointVector<N> feedback(const StateError<N>& state, std::array<double, kMaxPremises>& premise,
                          const ModelSample<N>& model, StepReport& report) noexcept override {
    if (lyapunov_.clamp(premise.data())) {
      report.flags |= kPremiseOutsideBox;
    }
    WeightArray weight{};
    lyapunov_.weights(premise.data(), weight.data());
    if (starting_) {
      window_.reset(weight.data());
      starting_ = false;
    } else {
      window_.push(weight.data());
    }
    StateGain<N> numerator = numerator_at(weight);
    if (descriptor_) {
      divide_by_descriptor(model, numerator);
    }
    const JointVector<N> torque = numerator * solve_positive_definite<2 * N>(lyapunov_at(window_.mean()), state);
    if (!torque.allFinite()) {
      report.flags |= kModelInvalid;
    }
    return torque;
  }

  Eigen::Matrix<double, 2 * N, 2 * N> lyapunov_at(const double* mean) const noexcept {
    using State = Eigen::Matrix<double, 2 * N, 2 * N>;
    State value = State::Zero();
    for (int k = 0; k < lyapunov_.vertices(); ++k) {
      value += mean[k] * Eigen::Map<const State>(lyapunov_.vertex(k).data());
    }
    return value;
  }

  StateGain<N> numerator_at(const WeightArray& weight) const noexcept {
    const auto count = static_cast<std::size_t>(lyapunov_.vertices());
    const double* const mean = window_.mean();
    const double* const delayed = window_.beginning();
    StateGain<N> value = StateGain<N>::Zero();
    for (std::size_t j = 0; j < count; ++j) {
      for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t m = 0; m < count; ++m) {
          value += weight[j] * mean[k] * delayed[m] * numerators_[(j * count + k) * count + m];
        }
      }
    }
    return value;
  }

  BlockPolytope lyapunov_;
  std::vector<StateGain<N>> numerators_;
  MovingWindow window_;
  bool descriptor_;
  bool starting_ = true;
};

std::unique_ptr<ControlLaw> DelayedFeedbackParameters::make_law(const LawSettings& settings) const {
  return make_law_of_size<DelayedFeedbackLaw>(*this, settings);
}

void take_lyapunov(const Field& field, int joints, DelayedFeedbackParameters& parameters) {
  parameters.lyapunov = read_lyapunov_polytope(field, 2 * joints);
  if (parameters.lyapunov.vertices() > kMaxDelayedVertices) {
    field.fail(std::to_string(parameters.lyapunov.vertices()) + " vertices",
               "at most " + std::to_string(kMaxDelayedVertices));
  }
}

void take_numerators(const Field& field, int joints, DelayedFeedbackParameters& parameters) {
  const auto vertices = static_cast<std::size_t>(parameters.lyapunov.vertices());
  const std::size_t count = vertices * vertices * vertices;
  if (field.size() != count) {
    field.fail(std::to_string(field.size()) + " matrices",
               std::to_string(count) + ", the cube of the number of vertices");
  }
  for (std::size_t i = 0; i < count; ++i) {
    parameters.numerators.push_back(parse_matrix(field.at(i), joints, 2 * joints));
  }
}

// A window shorter than a few samples has no mean to speak of: it is 0, and the artifact says so, or long enough.
void take_window(const Field& field, int /*joints*/, DelayedFeedbackParameters& parameters) {
  const auto samples = static_cast<int>(field.integer(0, kMaxWindowSamples));
  if (samples > 0 && samples < kMinWindowSamples) {
    field.fail(std::to_string(samples),
               "0 (the limit of a short window) or at least " + std::to_string(kMinWindowSamples) + " sample periods");
  }
  parameters.window_samples = samples;
}

}  // namespace

namespace laws {

LawKind delayed_feedback() {
  using P = DelayedFeedbackParameters;
  LawTable<P> law("delayed-feedback");
  law.add({"lyapunov", "polytope"}, take_lyapunov);
  law.add({"numerators", "matrices"}, take_numerators);
  law.add({"window_samples", "integer"}, take_window);
  law.boolean("descriptor", &P::descriptor);
  law.non_negative("velocity_filter_time_constant_s", &P::velocity_filter_time_constant_s);
  law.schedule(&P::schedule, &P::lyapunov);
  return law.kind();
}

}  // namespace laws
}  // namespace quasilpv
