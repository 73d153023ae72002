#include "control_law_fixture.hpp"

#include <cmath>
#include <vector>

#include "decompositions.hpp"

namespace quasilpv::testing {
namespace {

void integrate(const Eigen::VectorXd& error, double gain, const Eigen::VectorXd& commanded,
               const Eigen::VectorXd& applied, Eigen::VectorXd& integral) {
  for (Eigen::Index j = 0; j < error.size(); ++j) {
    if ((commanded(j) - applied(j)) * gain * error(j) <= 0.0) {
      integral(j) += kSamplePeriod * error(j);
    }
  }
}

}  // namespace

Eigen::VectorXd WrittenOutDobAcceleration::step(const Sample& s) {
  const double T = kSamplePeriod;
  const double q = std::exp(-T / 1e-3);
  if (!started) {
    th = s.angle;
    w = a_d = j_d = d_f = Eigen::VectorXd::Zero(arm.joints);
    started = true;
  }
  const Eigen::VectorXd innovation = s.angle - th;
  th += 0.9 * innovation;
  w += 550.0 * innovation;
  a_d += 150000.0 * innovation;
  j_d += 1.6e7 * innovation;
  d_f = q * d_f + (1.0 - q) * a_d;
  disturbance = a_d;
  const Eigen::MatrixXd M = arm.inertia(s.angle);
  const Eigen::VectorXd G = arm.gravity(s.angle);
  const Eigen::VectorXd a_cmd = s.reference_acceleration - compensation * d_f - 4800.0 * (th - s.reference) -
                                120.0 * (w - s.reference_speed) - 64000.0 * integral;
  const Eigen::VectorXd commanded = M * a_cmd + G;
  const Eigen::VectorXd applied = output.apply(commanded);
  integrate(s.angle - s.reference, -64000.0, commanded, applied, integral);
  const Eigen::VectorXd a_app = inverse(M) * (applied - G) + a_d;
  th += T * w + T * T / 2.0 * a_app + T * T * T / 6.0 * j_d;
  w += T * a_app + T * T / 2.0 * j_d;
  a_d += T * j_d;
  return commanded;
}

namespace {

struct WrittenOutDobTorque : WrittenOutLaw {
  using WrittenOutLaw::WrittenOutLaw;
  Eigen::VectorXd x, d_f;  // x = [th, w, d, dd]

  // The correction as the linear equation it solves, x = x_hat + T L (y - C x); the prediction as the exponential of
  // the nilpotent chain.
  Eigen::VectorXd step(const Sample& s) override {
    const double T = kSamplePeriod;
    const double q = std::exp(-T / 1e-3);
    const Eigen::Index n = arm.joints;
    if (!started) {
      x = Eigen::VectorXd::Zero(4 * n);
      x.head(n) = s.angle;
      d_f = Eigen::VectorXd::Zero(n);
      started = true;
    }
    const Eigen::VectorXd z = arm.premises(s.angle);
    const Eigen::MatrixXd M = arm.inertia(s.angle);
    const Eigen::VectorXd G = arm.gravity(s.angle);
    const Eigen::MatrixXd L = arm.observer(z);
    Eigen::MatrixXd implicit = Eigen::MatrixXd::Identity(4 * n, 4 * n);
    implicit.leftCols(n) += T * L;
    x = solution(implicit, x + T * L * s.angle);
    disturbance = x.segment(2 * n, n);
    d_f = q * d_f + (1.0 - q) * disturbance;
    Eigen::VectorXd error(3 * n);
    error << x.head(n) - s.reference, x.segment(n, n) - s.reference_speed, integral;
    const Eigen::VectorXd commanded = M * s.reference_acceleration - d_f + arm.feedback(z) * error + G;
    const Eigen::VectorXd applied = output.apply(commanded);
    integrate(s.angle - s.reference, -1.0, commanded, applied, integral);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(4 * n, 4 * n);
    A.block(0, n, n, n).setIdentity();
    A.block(n, 2 * n, n, n) = inverse(M);
    A.block(2 * n, 3 * n, n, n).setIdentity();
    const Eigen::MatrixXd transition =
        Eigen::MatrixXd::Identity(4 * n, 4 * n) + T * A + T * T / 2.0 * A * A + T * T * T / 6.0 * A * A * A;
    const Eigen::VectorXd acceleration = inverse(M) * (applied - G);
    x = (transition * x).eval();
    x.head(n) += T * T / 2.0 * acceleration;
    x.segment(n, n) += T * acceleration;
    return commanded;
  }
};

/// The filtered speed of the laws that read speeds.
struct WrittenOutVelocityLaw : WrittenOutLaw {
  using WrittenOutLaw::WrittenOutLaw;
  Eigen::VectorXd w;

  void filter(const Eigen::VectorXd& speed) {
    const double a = std::exp(-kSamplePeriod / 2e-3);
    w = started ? Eigen::VectorXd(a * w + (1.0 - a) * speed) : speed;
    started = true;
  }
};

struct WrittenOutHinfTracking : WrittenOutVelocityLaw {
  using WrittenOutVelocityLaw::WrittenOutVelocityLaw;

  Eigen::VectorXd step(const Sample& s) override {
    filter(s.speed);
    const Eigen::Index n = arm.joints;
    Eigen::MatrixXd E = Eigen::MatrixXd::Identity(3 * n, 3 * n);
    E.block(n, n, n, n) = arm.inertia(s.angle);
    const Eigen::MatrixXd K = arm.numerator(arm.premises(s.angle)) * inverse(E.transpose()) * inverse(arm.lyapunov());
    const Eigen::VectorXd e = s.angle - s.reference;
    Eigen::VectorXd state(3 * n);
    state << e, w - s.reference_speed, -integral;
    const Eigen::VectorXd commanded = K * state;
    const Eigen::VectorXd applied = output.apply(commanded);
    for (Eigen::Index j = 0; j < n; ++j) {
      if ((commanded(j) - applied(j)) * K(j, 2 * n + j) * e(j) <= 0.0) {
        integral(j) -= kSamplePeriod * e(j);
      }
    }
    return commanded;
  }
};

/// x = (y - r, w - r') of the laws that stabilise, and the sum of vertices with the weights of their schedule.
struct WrittenOutStabilisingLaw : WrittenOutVelocityLaw {
  using WrittenOutVelocityLaw::WrittenOutVelocityLaw;

  Eigen::VectorXd state(const Sample& s) const {
    Eigen::VectorXd x(2 * arm.joints);
    x << s.angle - s.reference, w - s.reference_speed;
    return x;
  }

  template <class Matrix>
  static Eigen::MatrixXd weighted(const std::vector<double>& weights, const Matrix& matrix) {
    Eigen::MatrixXd sum = weights[0] * matrix(0);
    for (std::size_t i = 1; i < weights.size(); ++i) {
      sum += weights[i] * matrix(static_cast<int>(i));
    }
    return sum;
  }

  Eigen::MatrixXd descriptor(const Eigen::VectorXd& angle) const {
    Eigen::MatrixXd E = Eigen::MatrixXd::Identity(2 * arm.joints, 2 * arm.joints);
    E.bottomRightCorner(arm.joints, arm.joints) = arm.inertia(angle);
    return E;
  }
};

struct WrittenOutStateFeedback : WrittenOutStabilisingLaw {
  using WrittenOutStabilisingLaw::WrittenOutStabilisingLaw;

  Eigen::VectorXd step(const Sample& s) override {
    filter(s.speed);
    const auto gain = [this](int i) { return arm.state_gain(i); };
    const Eigen::VectorXd commanded = weighted(arm.schedule_weights(s.angle, w), gain) * state(s);
    output.apply(commanded);
    return commanded;
  }
};

struct WrittenOutDescriptorFeedback : WrittenOutStabilisingLaw {
  using WrittenOutStabilisingLaw::WrittenOutStabilisingLaw;

  Eigen::VectorXd step(const Sample& s) override {
    filter(s.speed);
    const auto gain = [this](int i) { return arm.state_gain(i); };
    const Eigen::MatrixXd F = weighted(arm.schedule_weights(s.angle, w), gain);
    const Eigen::VectorXd commanded =
        F * inverse(descriptor(s.angle).transpose()) * inverse(arm.state_lyapunov(0)) * state(s);
    output.apply(commanded);
    return commanded;
  }
};

/// The whole past is kept, and the mean taken over it by the trapezoidal rule at every sample.
struct WrittenOutDelayedFeedback : WrittenOutStabilisingLaw {
  using WrittenOutStabilisingLaw::WrittenOutStabilisingLaw;
  static constexpr std::size_t kWindow = 7;
  std::vector<std::vector<double>> past;

  std::vector<double> at(std::size_t age) const { return past.size() > age ? past[past.size() - 1 - age] : past[0]; }

  std::vector<double> mean() const {
    std::vector<double> sum(TestArm::kScheduleVertices, 0.0);
    for (std::size_t age = 0; age <= kWindow; ++age) {
      for (std::size_t i = 0; i < sum.size(); ++i) {
        sum[i] += (age == 0 || age == kWindow ? 0.5 : 1.0) * at(age)[i] / static_cast<double>(kWindow);
      }
    }
    return sum;
  }

  Eigen::VectorXd step(const Sample& s) override {
    filter(s.speed);
    past.push_back(arm.schedule_weights(s.angle, w));
    const std::vector<double> varpi = mean();
    const auto numerator = [&](int j) {
      return weighted(varpi, [&](int k) {
        return weighted(at(kWindow), [&](int m) { return arm.state_gain((4 * j + k) * 4 + m); });
      });
    };
    const Eigen::MatrixXd P = weighted(varpi, [this](int k) { return arm.state_lyapunov(k); });
    const Eigen::VectorXd commanded =
        weighted(at(0), numerator) * inverse(descriptor(s.angle).transpose()) * inverse(P) * state(s);
    output.apply(commanded);
    return commanded;
  }
};

struct WrittenOutPid : WrittenOutVelocityLaw {
  using WrittenOutVelocityLaw::WrittenOutVelocityLaw;

  Eigen::VectorXd step(const Sample& s) override {
    filter(s.speed);
    const Eigen::VectorXd e = s.reference - s.angle;
    const Eigen::VectorXd commanded = 4000.0 * e + 300.0 * (s.reference_speed - w) + 9000.0 * integral +
                                      arm.inertia(s.angle) * s.reference_acceleration +
                                      arm.coriolis(s.angle, w, s.reference_speed) + arm.gravity(s.angle);
    integrate(e, 9000.0, commanded, output.apply(commanded), integral);
    return commanded;
  }
};

struct WrittenOutComputedTorque : WrittenOutLaw {
  double bandwidth;
  Eigen::VectorXd w, previous_w, previous_known, a_hat;

  WrittenOutComputedTorque(TestArm test_arm, OutputStage stage, double c)
      : WrittenOutLaw(test_arm, std::move(stage)), bandwidth(c), a_hat(Eigen::VectorXd::Zero(test_arm.joints)) {}

  // The observer in its other form: over a period, a = (w+ - w)/T - f is what the model does not explain, and the
  // estimate follows it with the pole q.
  Eigen::VectorXd step(const Sample& s) override {
    const double T = kSamplePeriod;
    const double q = std::exp(-bandwidth * T);
    const double a = std::exp(-T / 2e-3);
    w = started ? Eigen::VectorXd(a * w + (1.0 - a) * s.speed) : s.speed;
    if (started) {
      a_hat = q * a_hat + (1.0 - q) * ((w - previous_w) / T - previous_known);
    }
    started = true;
    const Eigen::MatrixXd M = arm.inertia(s.angle);
    const Eigen::VectorXd bias = arm.coriolis(s.angle, w, w) + arm.gravity(s.angle);
    const Eigen::VectorXd e = s.reference - s.angle;
    const Eigen::VectorXd commanded =
        M * (s.reference_acceleration + 1200.0 * e + 60.0 * (s.reference_speed - w) + 8000.0 * integral - a_hat) + bias;
    disturbance = M * a_hat;
    const Eigen::VectorXd applied = output.apply(commanded);
    integrate(e, 8000.0, commanded, applied, integral);
    previous_w = w;
    previous_known = inverse(M) * (applied - bias);
    return commanded;
  }
};

}  // namespace

std::unique_ptr<WrittenOutLaw> written_out(const std::string& kind, const TestArm& arm, const OutputStage& output) {
  if (kind == "dob-acceleration") {
    return std::make_unique<WrittenOutDobAcceleration>(arm, output);
  }
  if (kind == "dob-torque") {
    return std::make_unique<WrittenOutDobTorque>(arm, output);
  }
  if (kind == "hinf-tracking") {
    return std::make_unique<WrittenOutHinfTracking>(arm, output);
  }
  if (kind == "state-feedback") {
    return std::make_unique<WrittenOutStateFeedback>(arm, output);
  }
  if (kind == "descriptor-feedback") {
    return std::make_unique<WrittenOutDescriptorFeedback>(arm, output);
  }
  if (kind == "delayed-feedback") {
    return std::make_unique<WrittenOutDelayedFeedback>(arm, output);
  }
  if (kind == "pid") {
    return std::make_unique<WrittenOutPid>(arm, output);
  }
  return std::make_unique<WrittenOutComputedTorque>(arm, output, kind == "ctc-dob" ? 50.0 : 0.0);
}

}  // namespace quasilpv::testing
