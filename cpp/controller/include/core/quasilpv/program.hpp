// Postfix programs: the robot's equations as data (docs/reference/formats.md, "Programs").
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace quasilpv {

class Field;

inline constexpr int kMaxProgramStack = 64;
inline constexpr int kMaxProgramLength = 4096;

/// Values a program may read: of joints, each `joints` many, or signals; null if the program does not read them.
struct ProgramInput {
  const double* angle = nullptr;            ///< measured angles, rad
  const double* speed = nullptr;            ///< estimated or filtered speeds, rad/s
  const double* reference_speed = nullptr;  ///< rad/s
  const double* signal = nullptr;           ///< of a general system, by number
};

/// The operands a program is allowed to use.
struct ProgramScope {
  int joints = 0;
  bool speed = false;
  bool reference_speed = false;
  int signals = 0;  ///< of a general system, which has no joints
};

/// A vector-valued function in postfix form. Immutable; valid by construction: its stack neither under- nor overflows,
/// its operands exist, its constants are finite, and it leaves exactly `outputs()` values.
class Program {
 public:
  /// INIT-ONLY. Throws InputError naming the instruction.
  /// \param outputs number of outputs the program must have.
  static Program parse(const Field& field, const ProgramScope& scope, int outputs);

  /// Runs the instructions in the order of the list, nothing reassociated; `pow_int` multiplies from the left. Values
  /// outside the domain of an operation give NaN or Inf, which the caller must check.
  /// RT-SAFE (bounded by the length of the program, no allocation, no lock, no throw).
  /// \param[out] output `outputs()` values.
  void evaluate(const ProgramInput& input, double* output) const noexcept;

  int outputs() const noexcept { return outputs_; }

 private:
  enum class Op : std::uint8_t {
    kConst,
    kAngle,
    kSpeed,
    kReferenceSpeed,
    kSignal,
    kNeg,
    kSin,
    kCos,
    kAsin,
    kAcos,
    kExp,
    kSqrt,
    kLog,
    kTanh,
    kAbs,
    kSinc,
    kSincSlope,
    kExpm1Quotient,
    kTanhQuotient,
    kPowInt,
    kAdd,
    kSub,
    kMul,
    kDiv,
    kAtan2,
    kMin,
    kMax,
    kLogChord,
    kAbsChord,
    kAtanChord,
    kAsinChord
  };

  struct Instruction {
    Op op;
    int index;     ///< joint or signal of an operand, exponent of pow_int
    double value;  ///< of a constant
  };

  struct Signature;
  static const Signature* find_signature(const std::string& name);
  static Instruction parse_instruction(const Field& field, const ProgramScope& scope, const Signature& signature);

  int outputs_ = 0;
  std::vector<Instruction> code_;
};

}  // namespace quasilpv
