#include "quasilpv/program.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "document/field.hpp"

namespace quasilpv {
namespace {

constexpr int kMaxExponent = 16;

// sin(x)/x. Below the threshold the truncated series is exact to rounding: the first term left out is x^8/362880.
double sinc(double x) noexcept {
  if (std::abs(x) < 1e-2) {
    const double x2 = x * x;
    return 1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0));
  }
  return std::sin(x) / x;
}

// (cos x - sinc x)/x. Below the threshold the series: the first term left out is x^9/3991680.
double sinc_slope(double x) noexcept {
  if (std::abs(x) < 0.1) {
    const double x2 = x * x;
    return -x / 3.0 * (1.0 - x2 / 10.0 * (1.0 - x2 / 28.0 * (1.0 - x2 / 54.0)));
  }
  return (std::cos(x) - std::sin(x) / x) / x;
}

// f(x)/x with value 0 and slope 1 at 0.
double expm1_quotient(double x) noexcept { return x == 0.0 ? 1.0 : std::expm1(x) / x; }
double tanh_quotient(double x) noexcept { return x == 0.0 ? 1.0 : std::tanh(x) / x; }

// (log(a + w) - log a)/w.
double log_chord(double a, double w) noexcept { return w == 0.0 ? 1.0 / a : std::log1p(w / a) / w; }

// (|a + w| - |a|)/w; 0, between both slopes, where a and w are 0.
double abs_chord(double a, double w) noexcept {
  const double b = a + w;
  if ((a >= 0.0 && b >= 0.0) && (a > 0.0 || b > 0.0)) {
    return 1.0;
  }
  if ((a <= 0.0 && b <= 0.0) && (a < 0.0 || b < 0.0)) {
    return -1.0;
  }
  return w == 0.0 ? b : (std::abs(b) - std::abs(a)) / w;
}

// (atan(a + w) - atan a)/w: the angle between (1, a) and (1, a + w).
double atan_chord(double a, double w) noexcept {
  return w == 0.0 ? 1.0 / (1.0 + a * a) : std::atan2(w, 1.0 + a * (a + w)) / w;
}

// (asin b - asin a)/w with b = a + w: an angle by its sine b sqrt(1 - a^2) - a sqrt(1 - b^2), of equal signs multiplied
// out so that nothing cancels, and its cosine.
double asin_chord(double a, double w) noexcept {
  const double b = a + w;
  const double of_a = std::sqrt((1.0 - a) * (1.0 + a)), of_b = std::sqrt((1.0 - b) * (1.0 + b));
  if (w == 0.0) {
    return 1.0 / of_a;
  }
  const bool same_sign = std::min(a, b) > 0.0 || std::max(a, b) < 0.0;
  const double sine = same_sign ? w * ((a + b) / (b * of_a + a * of_b)) : b * of_a - a * of_b;
  return std::atan2(sine, of_a * of_b + a * b) / w;
}

// NaN if either is.
double minimum(double x, double y) noexcept { return x < y || std::isnan(x) ? x : y; }
double maximum(double x, double y) noexcept { return x > y || std::isnan(x) ? x : y; }

double integer_power(double base, int exponent) noexcept {
  double power = base;
  for (int i = 1; i < exponent; ++i) {
    power *= base;
  }
  return power;
}

}  // namespace

// What an instruction takes from the stack (it always leaves one value) and whether it has an argument.
struct Program::Signature {
  const char* name;
  Op op;
  int pops;
  bool has_argument;
};

const Program::Signature* Program::find_signature(const std::string& name) {
  static constexpr std::array<Signature, 31> kSignatures = {{
      {"const", Op::kConst, 0, true},
      {"angle", Op::kAngle, 0, true},
      {"speed", Op::kSpeed, 0, true},
      {"reference_speed", Op::kReferenceSpeed, 0, true},
      {"signal", Op::kSignal, 0, true},
      {"neg", Op::kNeg, 1, false},
      {"sin", Op::kSin, 1, false},
      {"cos", Op::kCos, 1, false},
      {"asin", Op::kAsin, 1, false},
      {"acos", Op::kAcos, 1, false},
      {"exp", Op::kExp, 1, false},
      {"sqrt", Op::kSqrt, 1, false},
      {"log", Op::kLog, 1, false},
      {"tanh", Op::kTanh, 1, false},
      {"abs", Op::kAbs, 1, false},
      {"sinc", Op::kSinc, 1, false},
      {"sinc_slope", Op::kSincSlope, 1, false},
      {"expm1_quotient", Op::kExpm1Quotient, 1, false},
      {"tanh_quotient", Op::kTanhQuotient, 1, false},
      {"pow_int", Op::kPowInt, 1, true},
      {"add", Op::kAdd, 2, false},
      {"sub", Op::kSub, 2, false},
      {"mul", Op::kMul, 2, false},
      {"div", Op::kDiv, 2, false},
      {"atan2", Op::kAtan2, 2, false},
      {"min", Op::kMin, 2, false},
      {"max", Op::kMax, 2, false},
      {"log_chord", Op::kLogChord, 2, false},
      {"abs_chord", Op::kAbsChord, 2, false},
      {"atan_chord", Op::kAtanChord, 2, false},
      {"asin_chord", Op::kAsinChord, 2, false},
  }};
  const auto* found = std::find_if(kSignatures.begin(), kSignatures.end(),
                                   [&name](const Signature& signature) { return name == signature.name; });
  return found == kSignatures.end() ? nullptr : found;
}

Program::Instruction Program::parse_instruction(const Field& field, const ProgramScope& scope,
                                                const Signature& signature) {
  const std::size_t size = signature.has_argument ? 2 : 1;
  if (field.size() != size) {
    field.fail("an instruction of " + std::to_string(field.size()),
               "\"" + std::string(signature.name) + "\" to have " + std::to_string(size - 1) + " arguments");
  }
  Instruction instruction{signature.op, 0, 0.0};
  if (signature.op == Op::kConst) {
    instruction.value = field.at(1).number();
  } else if (signature.op == Op::kPowInt) {
    instruction.index = static_cast<int>(field.at(1).integer(1, kMaxExponent));
  } else if (signature.has_argument) {
    const int count = signature.op == Op::kSignal ? scope.signals : scope.joints;
    instruction.index = static_cast<int>(field.at(1).integer(0, std::max(count, 1) - 1));
  }
  const bool in_scope = (signature.op != Op::kAngle || scope.joints > 0) &&
                        (signature.op != Op::kSpeed || scope.speed) &&
                        (signature.op != Op::kReferenceSpeed || scope.reference_speed) &&
                        (signature.op != Op::kSignal || scope.signals > 0);
  if (!in_scope) {
    field.fail("the operand \"" + std::string(signature.name) + "\"", "only the inputs of this program");
  }
  return instruction;
}

Program Program::parse(const Field& field, const ProgramScope& scope, int outputs) {
  field.only({"outputs", "code"});
  Program program;
  program.outputs_ = static_cast<int>(field["outputs"].integer(outputs, outputs));

  const Field code = field["code"];
  if (code.size() > static_cast<std::size_t>(kMaxProgramLength)) {
    code.fail(std::to_string(code.size()) + " instructions", "at most " + std::to_string(kMaxProgramLength));
  }
  program.code_.reserve(code.size());
  int depth = 0;
  for (std::size_t i = 0; i < code.size(); ++i) {
    const Field instruction = code.at(i);
    const std::string name = instruction.at(0).text();
    const Signature* signature = find_signature(name);
    if (signature == nullptr) {
      instruction.at(0).fail("an unknown instruction", "an instruction of the format");
    }
    program.code_.push_back(parse_instruction(instruction, scope, *signature));
    if (depth < signature->pops) {
      instruction.fail("a stack of " + std::to_string(depth),
                       "at least " + std::to_string(signature->pops) + " values");
    }
    depth += 1 - signature->pops;
    if (depth > kMaxProgramStack) {
      instruction.fail("a stack of " + std::to_string(depth),
                       "at most " + std::to_string(kMaxProgramStack) + " values");
    }
  }
  if (depth != outputs) {
    code.fail(std::to_string(depth) + " values left on the stack", std::to_string(outputs));
  }
  return program;
}

void Program::evaluate(const ProgramInput& input, double* output) const noexcept {
  std::array<double, kMaxProgramStack> stack;
  double* next = stack.data();  // one past the top; parse() proved that it stays inside
  for (const Instruction& instruction : code_) {
    switch (instruction.op) {
      case Op::kConst:
        *next++ = instruction.value;
        break;
      case Op::kAngle:
        *next++ = input.angle[instruction.index];
        break;
      case Op::kSpeed:
        *next++ = input.speed[instruction.index];
        break;
      case Op::kReferenceSpeed:
        *next++ = input.reference_speed[instruction.index];
        break;
      case Op::kSignal:
        *next++ = input.signal[instruction.index];
        break;
      case Op::kNeg:
        next[-1] = -next[-1];
        break;
      case Op::kSin:
        next[-1] = std::sin(next[-1]);
        break;
      case Op::kCos:
        next[-1] = std::cos(next[-1]);
        break;
      case Op::kAsin:
        next[-1] = std::asin(next[-1]);
        break;
      case Op::kAcos:
        next[-1] = std::acos(next[-1]);
        break;
      case Op::kExp:
        next[-1] = std::exp(next[-1]);
        break;
      case Op::kSqrt:
        next[-1] = std::sqrt(next[-1]);
        break;
      case Op::kLog:
        next[-1] = std::log(next[-1]);
        break;
      case Op::kTanh:
        next[-1] = std::tanh(next[-1]);
        break;
      case Op::kAbs:
        next[-1] = std::abs(next[-1]);
        break;
      case Op::kExpm1Quotient:
        next[-1] = expm1_quotient(next[-1]);
        break;
      case Op::kTanhQuotient:
        next[-1] = tanh_quotient(next[-1]);
        break;
      case Op::kSinc:
        next[-1] = sinc(next[-1]);
        break;
      case Op::kSincSlope:
        next[-1] = sinc_slope(next[-1]);
        break;
      case Op::kPowInt:
        next[-1] = integer_power(next[-1], instruction.index);
        break;
      case Op::kAdd:
        --next;
        next[-1] += next[0];
        break;
      case Op::kSub:
        --next;
        next[-1] -= next[0];
        break;
      case Op::kMul:
        --next;
        next[-1] *= next[0];
        break;
      case Op::kDiv:
        --next;
        next[-1] /= next[0];
        break;
      case Op::kAtan2:
        --next;
        next[-1] = std::atan2(next[-1], next[0]);
        break;
      case Op::kMin:
        --next;
        next[-1] = minimum(next[-1], next[0]);
        break;
      case Op::kMax:
        --next;
        next[-1] = maximum(next[-1], next[0]);
        break;
      case Op::kLogChord:
        --next;
        next[-1] = log_chord(next[-1], next[0]);
        break;
      case Op::kAbsChord:
        --next;
        next[-1] = abs_chord(next[-1], next[0]);
        break;
      case Op::kAtanChord:
        --next;
        next[-1] = atan_chord(next[-1], next[0]);
        break;
      case Op::kAsinChord:
        --next;
        next[-1] = asin_chord(next[-1], next[0]);
        break;
    }
  }
  std::copy(stack.data(), next, output);
}

}  // namespace quasilpv
