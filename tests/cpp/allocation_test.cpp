// No allocation after initialisation: malloc and its family, and with them operator new, are replaced by counting ones.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>

#include "artifact_fixture.hpp"
#include "counting.hpp"
#include "quasilpv/controller.hpp"
#include "quasilpv/system_controller.hpp"
#include "quasilpv/trajectory.hpp"
#include "quiet_robot.hpp"
#include "system_fixture.hpp"

#if QUASILPV_COUNTS_CALLS
using ::quasilpv::testing::count;

// NOLINTBEGIN(bugprone-reserved-identifier): glibc's own entry points, so that the replacements need no dlsym.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  count();
  return __libc_malloc(size);
}

void* calloc(std::size_t number, std::size_t size) noexcept {
  count();
  return __libc_calloc(number, size);
}

void* realloc(void* block, std::size_t size) noexcept {
  count();
  return __libc_realloc(block, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  count();
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** block, std::size_t alignment, std::size_t size) noexcept {
  count();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? 12 : 0;  // ENOMEM
}
}
// NOLINTEND(bugprone-reserved-identifier)
#endif

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::calls_in;
using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::kChainLaws;
using ::quasilpv::testing::kLawKinds;
using ::quasilpv::testing::kPaces;
using ::quasilpv::testing::make_loop;
using ::quasilpv::testing::observed_table;
using ::quasilpv::testing::QuietRobot;
using ::quasilpv::testing::QuietSystem;
using ::quasilpv::testing::run_control_thread;
using ::quasilpv::testing::system_table;
using ::quasilpv::testing::with_chain;

class Allocation : public ::testing::Test {
 protected:
  void SetUp() override {
    if (QUASILPV_COUNTS_CALLS == 0) {
      GTEST_SKIP() << "the sanitizer replaces malloc itself";
    }
  }
};

struct alignas(64) Overaligned {
  double values[8];
};

TEST_F(Allocation, is_counted_for_new_for_aligned_new_and_for_dynamic_eigen) {
  std::unique_ptr<int> plain;
  EXPECT_EQ(calls_in([&] { plain = std::make_unique<int>(1); }), 1);
  std::unique_ptr<Overaligned> aligned;
  EXPECT_EQ(calls_in([&] { aligned = std::make_unique<Overaligned>(); }), 1);
  Eigen::VectorXd dynamic;
  EXPECT_GE(calls_in([&] { dynamic.setZero(5); }), 1);
}

TEST_F(Allocation, does_not_happen_in_10000_steps_of_any_law_whatever_the_input) {
  for (const char* kind : kLawKinds) {
    for (const int joints : {1, 3, 7}) {
      Controller controller(Artifact::parse(json_twin(artifact_table(kind, joints)), "test"));
      std::uint32_t flags = 0;
      const int count = calls_in([&] {
        for (int k = 0; k < 10000; ++k) {
          StepInput input;
          input.seq = k;
          input.valid = k % 13 != 0;
          input.angle.fill(k % 17 == 0 ? std::numeric_limits<double>::quiet_NaN() : 3e-4 * k);
          input.speed.fill(0.1);
          input.reference.angle.fill(k % 19 == 0 ? std::numeric_limits<double>::infinity() : 3e-4 * k + 0.01);
          flags |= controller.step(input).flags;
          if (k == 5000) {
            controller.reset();
          }
        }
      });
      EXPECT_EQ(count, 0) << kind << ", " << joints << " joints";
      EXPECT_EQ(flags & (kMeasurementInvalid | kReferenceInvalid | kPremiseOutsideBox),
                kMeasurementInvalid | kReferenceInvalid | kPremiseOutsideBox);
    }
  }
}

TEST_F(Allocation, does_not_happen_in_the_steps_of_a_general_system_whatever_the_state) {
  for (const Json& table : {system_table(), observed_table()}) {
    SystemController controller(SystemArtifact::parse(json_twin(table), "test"));
    std::uint32_t flags = 0;
    const int count = calls_in([&] {
      for (int k = 0; k < 10000; ++k) {
        const double state[2] = {k % 17 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1.0 + 3e-4 * k, 0.1};
        flags |= controller.step(state, nullptr).flags;
      }
    });
    EXPECT_EQ(count, 0);
    EXPECT_EQ(flags, kSignalInvalid | kSystemPremiseOutside | kInputSaturated | kOutsideRegion);
  }
}

TEST_F(Allocation, does_not_happen_in_the_control_thread_of_a_general_system_whatever_the_plant_does) {
  for (const Pace pace : kPaces) {
    SystemLoop loop(SystemArtifact::parse(json_twin(system_table()), "test"), {});
    auto ring = std::make_unique<SystemRing>();  // nobody empties it
    loop.publish_to(ring.get());
    QuietSystem system;
    EXPECT_EQ(calls_in([&] { run_control_thread(loop, system, pace); }), 0);
    EXPECT_GT(ring->drops(), 0);
    EXPECT_GT(loop.faults(), 0);
  }
}

TEST_F(Allocation, does_not_happen_in_laws_with_a_chain_of_bodies_whether_limits_act_or_not) {
  for (const char* kind : kChainLaws) {
    for (const int joints : {1, 6, 7}) {
      Controller controller(Artifact::parse(json_twin(with_chain(artifact_table(kind, joints))), "test"));
      std::uint32_t flags = 0;
      int moved = 0;
      const int count = calls_in([&] {
        for (int k = 0; k < 2000; ++k) {
          StepInput input;
          input.seq = k;
          input.valid = k % 13 != 0;
          input.angle.fill(3e-4 * k);
          input.speed.fill(0.1);
          input.reference.angle.fill(k % 500 == 499 ? 9.0 : 3e-4 * k);
          const StepReport report = controller.step(input);
          flags |= report.flags;
          moved += report.torque_applied[0] != 0.0 ? 1 : 0;
        }
      });
      EXPECT_EQ(count, 0) << kind << ", " << joints << " joints";
      EXPECT_GT(moved, 1000);
      EXPECT_NE(flags & (kTorqueSaturated | kSlewLimited), 0U) << kind;
      EXPECT_EQ(flags & (kPremiseOutsideBox | kModelInvalid), 0U);
    }
  }
}

TEST_F(Allocation, does_not_happen_when_blocks_of_several_premises_keep_the_vertex_sum) {
  Json table = artifact_table("dob-acceleration", 2);
  Json& inertia = table["law"]["inertia"];
  const Json& vertex = inertia["blocks"][0]["vertices"][0];
  inertia["blocks"] = {{{"kind", "box"}, {"premises", {0, 1}}, {"vertices", {vertex, vertex, vertex, vertex}}}};
  Controller controller(Artifact::parse(json_twin(table), "test"));
  EXPECT_EQ(calls_in([&] {
              for (int k = 0; k < 10000; ++k) {
                controller.step({});
              }
            }),
            0);
}

TEST_F(Allocation, does_not_happen_when_a_trajectory_is_evaluated) {
  const Json table = {{"schema", "quasilpv.trajectory"},
                      {"schema_version", 1},
                      {"name", "line"},
                      {"joints", 1},
                      {"task", nullptr},
                      {"knots_s", {0.0, 1.0, 2.0}},
                      {"coefficients", Json::parse("[[[0,1,0,0,0,0]],[[1,1,0,0,0,0]]]")}};
  const Trajectory trajectory = Trajectory::parse(json_twin(table), "test");
  double sum = 0.0;
  EXPECT_EQ(calls_in([&] {
              for (int k = 0; k < 10000; ++k) {
                sum += trajectory.evaluate(3e-4 * k).angle[0];
              }
            }),
            0);
  EXPECT_GT(sum, 0.0);
}

TEST_F(Allocation, does_not_happen_in_the_control_thread_of_any_law_whatever_the_robot_does) {
  for (const char* kind : kLawKinds) {
    for (const Pace pace : kPaces) {
      ControlLoop loop = make_loop(kind);
      auto ring = std::make_unique<SampleRing>();  // nobody empties it
      loop.publish_to(ring.get());
      QuietRobot robot;
      EXPECT_EQ(calls_in([&] { run_control_thread(loop, robot, pace); }), 0) << kind;
      EXPECT_GT(ring->drops(), 0);
    }
  }
}

}  // namespace
}  // namespace quasilpv
