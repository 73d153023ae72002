#include "quasilpv/program.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>

#include "artifact_fixture.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::refusal;
using ::testing::HasSubstr;

constexpr ProgramScope kEverything{3, true, true};

// Code is a list of instructions, as JSON or as its text.
Program parse(const Json& list, int outputs, const ProgramScope& scope = kEverything) {
  const Json code = list.is_string() ? Json::parse(list.get<std::string>()) : list;
  const Json program = {{"outputs", outputs}, {"code", code}};
  return Program::parse(Field(program, "test", "p"), scope, outputs);
}

std::string refusal_of(const Json& code, int outputs, const ProgramScope& scope = kEverything) {
  return refusal([&] { parse(code, outputs, scope); });
}

const std::array<double, 3> kAngle = {0.3, -0.7, 1.1};
const std::array<double, 3> kSpeed = {2.0, -3.0, 5.0};
const std::array<double, 3> kReferenceSpeed = {0.25, 0.5, -0.125};

double evaluate(const Json& code) {
  double output = 0.0;
  parse(code, 1).evaluate({kAngle.data(), kSpeed.data(), kReferenceSpeed.data()}, &output);
  return output;
}

TEST(Program, computes_each_operation) {
  EXPECT_EQ(evaluate(R"([["const", -2.5]])"), -2.5);
  EXPECT_EQ(evaluate(R"([["angle", 2]])"), 1.1);
  EXPECT_EQ(evaluate(R"([["speed", 1]])"), -3.0);
  EXPECT_EQ(evaluate(R"([["reference_speed", 0]])"), 0.25);
  EXPECT_EQ(evaluate(R"([["angle", 0], ["neg"]])"), -0.3);
  EXPECT_EQ(evaluate(R"([["angle", 0], ["sin"]])"), std::sin(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["cos"]])"), std::cos(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["asin"]])"), std::asin(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["acos"]])"), std::acos(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["exp"]])"), std::exp(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["sqrt"]])"), std::sqrt(0.3));
  EXPECT_EQ(evaluate(R"([["angle", 0], ["pow_int", 1]])"), 0.3);
  EXPECT_EQ(evaluate(R"([["angle", 0], ["pow_int", 3]])"), 0.3 * 0.3 * 0.3);
}

TEST(Program, computes_each_operation_of_signals) {
  const ProgramScope scope{0, false, false, 3};
  const auto of_signals = [&](const char* code) {
    double output = 0.0;
    parse(code, 1, scope).evaluate({nullptr, nullptr, nullptr, kAngle.data()}, &output);
    return output;
  };
  EXPECT_EQ(of_signals(R"([["signal", 1]])"), -0.7);
  EXPECT_NEAR(of_signals(R"([["signal", 2], ["log"]])"), std::log(1.1), 1e-15);
  EXPECT_NEAR(of_signals(R"([["signal", 1], ["tanh"]])"), std::tanh(-0.7), 1e-15);
  EXPECT_EQ(of_signals(R"([["signal", 1], ["abs"]])"), 0.7);
  EXPECT_EQ(of_signals(R"([["signal", 0], ["signal", 1], ["min"]])"), -0.7);
  EXPECT_EQ(of_signals(R"([["signal", 0], ["signal", 1], ["max"]])"), 0.3);
  EXPECT_EQ(of_signals(R"([["const", 0], ["expm1_quotient"]])"), 1.0);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["expm1_quotient"]])"), (std::exp(0.3) - 1.0) / 0.3, 1e-15);
  EXPECT_EQ(of_signals(R"([["const", 0], ["tanh_quotient"]])"), 1.0);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["tanh_quotient"]])"), std::tanh(0.3) / 0.3, 1e-15);
  EXPECT_EQ(of_signals(R"([["const", 2], ["const", 0], ["log_chord"]])"), 0.5);
  EXPECT_NEAR(of_signals(R"([["const", 2], ["signal", 0], ["log_chord"]])"), (std::log(2.3) - std::log(2.0)) / 0.3,
              1e-15);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["signal", 1], ["abs_chord"]])"), (0.4 - 0.3) / -0.7, 1e-15);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["signal", 1], ["atan_chord"]])"),
              (std::atan(0.3 - 0.7) - std::atan(0.3)) / -0.7, 1e-15);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["signal", 1], ["asin_chord"]])"),
              (std::asin(0.3 - 0.7) - std::asin(0.3)) / -0.7, 1e-15);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["const", 0.2], ["asin_chord"]])"),
              (std::asin(0.3 + 0.2) - std::asin(0.3)) / 0.2, 1e-15);
  EXPECT_EQ(of_signals(R"([["signal", 1], ["const", 0.5], ["abs_chord"]])"), -1.0);
  EXPECT_EQ(of_signals(R"([["signal", 0], ["const", 0.5], ["abs_chord"]])"), 1.0);
  EXPECT_EQ(of_signals(R"([["const", 0], ["const", 0], ["abs_chord"]])"), 0.0);
  EXPECT_EQ(of_signals(R"([["const", 0], ["sinc_slope"]])"), 0.0);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["sinc_slope"]])"), (std::cos(0.3) - std::sin(0.3) / 0.3) / 0.3, 1e-14);
  EXPECT_NEAR(of_signals(R"([["const", 0.0999], ["sinc_slope"]])"), -0.0333 + 0.0999 * 0.0999 * 0.0999 / 30.0, 2e-8);
  EXPECT_EQ(of_signals(R"([["const", 0], ["const", -1e-300], ["abs_chord"]])"), -1.0);
  EXPECT_EQ(of_signals(R"([["const", 2], ["const", 0], ["atan_chord"]])"), 0.2);
  EXPECT_EQ(of_signals(R"([["const", 0], ["const", 0], ["asin_chord"]])"), 1.0);
  // Far below what a difference quotient can tell.
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["const", 1e-12], ["atan_chord"]])"), 1.0 / 1.09, 1e-12);
  EXPECT_NEAR(of_signals(R"([["signal", 0], ["const", 1e-12], ["asin_chord"]])"), 1.0 / std::sqrt(0.91), 1e-12);
  EXPECT_TRUE(std::isnan(of_signals(R"([["const", -1], ["log"], ["const", 1], ["min"]])")));
  EXPECT_TRUE(std::isnan(of_signals(R"([["const", 1], ["const", -1], ["log"], ["max"]])")));
  EXPECT_THAT(refusal_of(R"([["angle", 0]])", 1, scope), HasSubstr("operand"));
  EXPECT_THAT(refusal_of(R"([["signal", 0]])", 1), HasSubstr("operand"));
  EXPECT_THAT(refusal_of(R"([["signal", 3]])", 1, scope), HasSubstr("[0, 2]"));
}

TEST(Program, takes_the_deeper_value_as_the_left_operand) {
  EXPECT_EQ(evaluate(R"([["const", 7], ["const", 2], ["add"]])"), 9.0);
  EXPECT_EQ(evaluate(R"([["const", 7], ["const", 2], ["sub"]])"), 5.0);
  EXPECT_EQ(evaluate(R"([["const", 7], ["const", 2], ["mul"]])"), 14.0);
  EXPECT_EQ(evaluate(R"([["const", 7], ["const", 2], ["div"]])"), 3.5);
  EXPECT_EQ(evaluate(R"([["const", 7], ["const", 2], ["atan2"]])"), std::atan2(7.0, 2.0));
}

TEST(Program, does_not_reassociate) {
  EXPECT_EQ(evaluate(R"([["const", 1], ["const", 1], ["add"], ["const", 1e16], ["add"]])"), 1e16 + 2.0);
  // 1e16 + 1 rounds to 1e16, twice.
  EXPECT_EQ(evaluate(R"([["const", 1e16], ["const", 1], ["add"], ["const", 1], ["add"]])"), 1e16);
}

TEST(Program, stores_outputs_in_the_order_of_the_stack) {
  std::array<double, 3> outputs{};
  parse(R"([["angle", 0], ["const", 4.0], ["angle", 2]])", 3).evaluate({kAngle.data()}, outputs.data());
  EXPECT_THAT(outputs, ::testing::ElementsAre(0.3, 4.0, 1.1));
}

TEST(Program, computes_sinc_to_rounding_on_both_sides_of_zero) {
  EXPECT_EQ(evaluate(R"([["const", 0.0], ["sinc"]])"), 1.0);
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> exponent(-12.0, 1.0);
  for (int i = 0; i < 10000; ++i) {
    const double x = std::pow(10.0, exponent(random)) * (i % 2 == 0 ? 1.0 : -1.0);
    const auto wide = static_cast<long double>(x);
    const auto exact = static_cast<double>(std::sin(wide) / wide);
    EXPECT_NEAR(evaluate(Json::array({Json::array({"const", x}), Json::array({"sinc"})})), exact, 4e-16) << x;
  }
}

TEST(Program, when_an_argument_is_outside_the_domain_expect_nan) {
  EXPECT_TRUE(std::isnan(evaluate(R"([["const", 2.0], ["acos"]])")));
  EXPECT_TRUE(std::isnan(evaluate(R"([["const", -1.0], ["sqrt"]])")));
}

// A random expression tree, emitted in postfix form and evaluated by recursion.
struct Tree {
  std::string op;
  double constant = 0.0;
  int joint = 0;
  std::unique_ptr<Tree> left;
  std::unique_ptr<Tree> right;

  Tree(std::mt19937_64& random, int depth) {
    static const std::vector<std::string> kLeaves = {"const", "angle", "speed"};
    static const std::vector<std::string> kInner = {"neg", "sin", "cos", "add", "sub", "mul", "atan2"};
    const std::vector<std::string>& choices = depth == 0 ? kLeaves : kInner;
    op = choices[random() % choices.size()];
    joint = static_cast<int>(random() % 3);
    constant = std::uniform_real_distribution<double>(-2.0, 2.0)(random);
    if (depth > 0) {
      left = std::make_unique<Tree>(random, depth - 1);
      right = is_binary() ? std::make_unique<Tree>(random, depth - 1) : nullptr;
    }
  }

  bool is_binary() const { return op == "add" || op == "sub" || op == "mul" || op == "atan2"; }

  void emit(Json& code) const {
    if (left != nullptr) {
      left->emit(code);
    }
    if (right != nullptr) {
      right->emit(code);
    }
    if (op == "const") {
      code.push_back(Json::array({op, constant}));
    } else if (left == nullptr) {
      code.push_back(Json::array({op, joint}));
    } else {
      code.push_back(Json::array({op}));
    }
  }

  double value() const {
    const double a = left != nullptr ? left->value() : 0.0;
    const double b = right != nullptr ? right->value() : 0.0;
    const auto index = static_cast<std::size_t>(joint);
    return op == "const"   ? constant
           : op == "angle" ? kAngle[index]
           : op == "speed" ? kSpeed[index]
           : op == "neg"   ? -a
           : op == "sin"   ? std::sin(a)
           : op == "cos"   ? std::cos(a)
           : op == "add"   ? a + b
           : op == "sub"   ? a - b
           : op == "mul"   ? a * b
                           : std::atan2(a, b);
  }
};

TEST(Program, equals_the_recursive_evaluation_of_random_expressions_bit_for_bit) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 500; ++i) {
    const Tree tree(random, 1 + i % 7);
    Json code = Json::array();
    tree.emit(code);
    EXPECT_EQ(evaluate(code), tree.value());
  }
}

TEST(Program, refuses_unsound_programs_and_names_the_instruction) {
  EXPECT_EQ(refusal_of(R"([["angle", 0], ["add"]])", 1),
            "test: p.code[1]: got a stack of 1, expected at least 2 values");
  EXPECT_EQ(refusal_of(R"([["angle", 0], ["angle", 1]])", 1),
            "test: p.code: got 2 values left on the stack, expected 1");
  EXPECT_THAT(refusal_of(R"([["angle", 3]])", 1), HasSubstr("p.code[0][1]: got 3, expected an integer in [0, 2]"));
  EXPECT_THAT(refusal_of(R"([["angle", -1]])", 1), HasSubstr("p.code[0][1]"));
  EXPECT_THAT(refusal_of(R"([["angle", 0.5]])", 1), HasSubstr("p.code[0][1]"));
  EXPECT_THAT(refusal_of(R"([["angle", 0], ["pow_int", 17]])", 1), HasSubstr("integer in [1, 16]"));
  EXPECT_THAT(refusal_of(R"([["angle", 0], ["pow_int", 0]])", 1), HasSubstr("integer in [1, 16]"));
  EXPECT_THAT(refusal_of(R"([["const", "x"]])", 1), HasSubstr("p.code[0][1]: got \"x\", expected a finite number"));
  EXPECT_THAT(refusal_of(R"([["angle"]])", 1), HasSubstr("expected \"angle\" to have 1 arguments"));
  EXPECT_THAT(refusal_of(R"([["angle", 0], ["sin", 1]])", 1), HasSubstr("expected \"sin\" to have 0 arguments"));
  EXPECT_THAT(refusal_of(R"([["tan"]])", 1), HasSubstr("p.code[0][0]: got an unknown instruction"));
  EXPECT_THAT(refusal_of(R"([[]])", 1), HasSubstr("p.code[0]"));
  EXPECT_THAT(refusal_of(R"([7])", 1), HasSubstr("p.code[0]"));
}

TEST(Program, refuses_operands_outside_its_scope) {
  const ProgramScope angles_only{3, false, false};
  EXPECT_THAT(refusal_of(R"([["speed", 0]])", 1, angles_only), HasSubstr("only the inputs of this program"));
  EXPECT_THAT(refusal_of(R"([["reference_speed", 0]])", 1, angles_only), HasSubstr("only the inputs of this program"));
  EXPECT_EQ(refusal_of(R"([["angle", 0]])", 1, angles_only), "accepted");
}

TEST(Program, allows_a_stack_of_64_and_4096_instructions_and_no_more) {
  Json deep = Json::array();
  for (int i = 0; i < kMaxProgramStack; ++i) {
    deep.push_back(Json::array({"angle", 0}));
  }
  EXPECT_EQ(refusal_of(deep, kMaxProgramStack), "accepted");
  deep.push_back(Json::array({"angle", 0}));
  EXPECT_THAT(refusal_of(deep, kMaxProgramStack + 1), HasSubstr("p.code[64]: got a stack of 65"));

  Json code = Json::parse(R"([["angle", 0]])");
  while (code.size() < static_cast<std::size_t>(kMaxProgramLength)) {
    code.push_back(Json{"neg"});
  }
  EXPECT_EQ(refusal_of(code, 1), "accepted");
  code.push_back(Json{"neg"});
  EXPECT_THAT(refusal_of(code, 1), HasSubstr("4097 instructions"));
}

TEST(Program, refuses_a_number_of_outputs_other_than_required) {
  const Json program = {{"outputs", 2}, {"code", Json::parse(R"([["angle", 0], ["angle", 1]])")}};
  EXPECT_THAT(refusal([&] { Program::parse(Field(program, "test", "p"), kEverything, 3); }),
              HasSubstr("p.outputs: got 2"));
}

}  // namespace
}  // namespace quasilpv
