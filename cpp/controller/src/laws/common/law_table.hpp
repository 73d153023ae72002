// How a kind of law describes itself: one line per member of its document and per program.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "artifact/matrices.hpp"
#include "document/member_table.hpp"
#include "laws/registry.hpp"

namespace quasilpv {

/// What the design inertia of a law may be: a table over premises, or a chain of bodies too, `kind` tree, which needs
/// no programs.
enum class Inertia { kTable, kTableOrChain };

/// The table of a law. `inertia` and the programs `premises` and `gravity`, which every law has, are in it from the
/// beginning; members are read in the order of the table, programs after them. INIT-ONLY.
template <class Parameters>
class LawTable : public MemberTable<Parameters> {
 public:
  explicit LawTable(std::string kind, Inertia inertia = Inertia::kTable) : kind_(std::move(kind)) {
    const char* const type = inertia == Inertia::kTable ? "polytope" : "design-inertia";
    this->add({"inertia", type}, [inertia](const Field& field, int joints, Parameters& parameters) {
      if (inertia == Inertia::kTableOrChain && field.has("kind")) {
        parameters.model.tree = read_design_tree(field, joints);
      } else {
        parameters.model.inertia = read_inertia(field, joints);
      }
    });
    if (inertia == Inertia::kTableOrChain) {
      const std::vector<Member> members{{"mass_kg", "non-negative"}, {"first_moment_kg_m", "numbers"}};
      this->add({"gravity_load", "object", true, members},
                [](const Field& field, int /*joints*/, Parameters& parameters) {
                  if (!parameters.model.tree) {
                    field.fail("a load", "none beside an inertia by vertices, whose gravity is a program");
                  }
                });
    }
    add_program("premises", [](const Field& field, int joints, Parameters& parameters) {
      parameters.model.premises = Program::parse(field, {joints}, parameters.model.inertia.premises());
    });
    add_program("gravity", [](const Field& field, int joints, Parameters& parameters) {
      parameters.model.gravity = Program::parse(field, {joints}, joints);
    });
  }

  /// One number per joint.
  void joint_values(const char* name, JointArray Parameters::*at) {
    this->add({name, "joint-values"}, [at](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_joint_values(field, joints, [](const Field& value) { return value.number(); });
    });
  }

  /// One positive number per joint.
  void positive_joint_values(const char* name, JointArray Parameters::*at) {
    this->add({name, "positive-joint-values"}, [at](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_joint_values(field, joints, [](const Field& value) { return value.positive(); });
    });
  }

  /// One number per joint, at least 0; the parameters' own stay where there is no such member.
  void optional_non_negative_joint_values(const char* name, JointArray Parameters::*at) {
    this->add({name, "non-negative-joint-values", true}, [at](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_joint_values(field, joints, [](const Field& value) { return value.non_negative(); });
    });
  }

  /// Gains on the premises of the inertia, `rows` n x `columns` n.
  void gains(const char* name, BlockPolytope Parameters::*at, int rows, int columns) {
    this->add({name, "polytope"}, [at, rows, columns](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_gains(field, parameters.model.inertia, rows * joints, columns * joints);
    });
  }
  /// The same, if the document has them.
  void gains(const char* name, std::optional<BlockPolytope> Parameters::*at, int rows, int columns) {
    this->add({name, "polytope", true}, [at, rows, columns](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_gains(field, parameters.model.inertia, rows * joints, columns * joints);
    });
  }
  /// Gains on premises of their own, `rows` n x `columns` n.
  void polytope(const char* name, BlockPolytope Parameters::*at, int rows, int columns) {
    this->add({name, "polytope"}, [at, rows, columns](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = BlockPolytope::parse(field, rows * joints, columns * joints);
    });
  }
  /// A symmetric positive definite matrix, `size` n x `size` n.
  void lyapunov(const char* name, Eigen::MatrixXd Parameters::*at, int size) {
    this->add({name, "matrix"}, [at, size](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = read_lyapunov(field, size * joints);
    });
  }

  /// A program of one torque per joint, N m. \param operands what it reads besides angles; `joints` is filled in.
  void torque_program(const char* name, Program Parameters::*at, ProgramScope operands) {
    add_program(name, [at, operands](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = Program::parse(field, {joints, operands.speed, operands.reference_speed}, joints);
    });
  }
  /// The program `schedule` of premises from angles and speeds, as many as `table` has.
  void schedule(Program Parameters::*at, BlockPolytope Parameters::*table) {
    add_program("schedule", [at, table](const Field& field, int joints, Parameters& parameters) {
      parameters.*at = Program::parse(field, {joints, true, false}, (parameters.*table).premises());
    });
  }

  /// What is still to be checked or computed when all members are there. \param law the document, for refusals.
  void finish(std::function<void(const Field& law, Parameters& parameters)> finish) { finish_ = std::move(finish); }

  LawKind kind() const {
    return {kind_, this->members(), program_names_,
            [table = *this](const Field& law, const Field& programs, int joints) {
              return table.read_law(law, programs, joints);
            }};
  }

 private:
  using Read = typename MemberTable<Parameters>::Read;

  void add_program(const char* name, Read read) {
    program_names_.emplace_back(name);
    program_reads_.push_back(std::move(read));
  }

  static BlockPolytope read_gains(const Field& field, const BlockPolytope& inertia, int rows, int columns) {
    BlockPolytope gains = BlockPolytope::parse(field, rows, columns);
    if (!gains.is_scheduled_like(inertia)) {
      field.fail("another box, centre or partition of the premises", "that of law.inertia");
    }
    return gains;
  }

  std::shared_ptr<const LawParameters> read_law(const Field& law, const Field& programs, int joints) const {
    auto parameters = std::make_shared<Parameters>();
    this->read(law, joints, *parameters, {"kind"});
    if (parameters->model.tree) {
      programs.only({});
      if (law.has("gravity_load")) {
        const Field load = law["gravity_load"];
        parameters->model.tree = read_design_tree(law["inertia"], joints, &load);
      }
    } else {
      programs.only(program_names_);
      for (std::size_t i = 0; i < program_reads_.size(); ++i) {
        program_reads_[i](programs[program_names_[i]], joints, *parameters);
      }
    }
    if (finish_) {
      finish_(law, *parameters);
    }
    return parameters;
  }

  std::string kind_;
  std::vector<std::string> program_names_;
  std::vector<Read> program_reads_;
  std::function<void(const Field& law, Parameters& parameters)> finish_;
};

}  // namespace quasilpv
