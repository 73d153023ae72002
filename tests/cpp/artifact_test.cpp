#include "quasilpv/artifact.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <limits>

#include "artifact_fixture.hpp"
#include "quasilpv/controller.hpp"

namespace quasilpv {
namespace {

using ::quasilpv::testing::artifact_table;
using ::quasilpv::testing::cbor_twin;
using ::quasilpv::testing::json_twin;
using ::quasilpv::testing::kLawKinds;
using ::quasilpv::testing::refusal;
using ::quasilpv::testing::with_hash;
using ::testing::HasSubstr;

Artifact parse(const Json& table) { return Artifact::parse(json_twin(table), "a.json"); }

// Refusal of the artifact of `kind` with the value at `pointer` replaced.
std::string refused(const std::string& pointer, const Json& value, const std::string& kind = "dob-acceleration") {
  Json table = artifact_table(kind, 3);
  table[Json::json_pointer(pointer)] = value;
  return refusal([&] { parse(table); });
}

TEST(Artifact, keeps_what_the_document_says) {
  const Json table = artifact_table("dob-acceleration", 3);
  const Artifact artifact = parse(table);
  EXPECT_EQ(artifact.name(), "test-arm-dob-acceleration");
  EXPECT_EQ(artifact.law_kind(), "dob-acceleration");
  EXPECT_EQ(artifact.robot_id(), "test-arm");
  EXPECT_EQ(artifact.joints(), 3);
  EXPECT_EQ(artifact.sample_period_s(), 1e-3);
  EXPECT_EQ(artifact.hash(), with_hash(table)["hash"]);
  EXPECT_EQ(artifact.design_hash(), std::string(64, 'a'));
  EXPECT_EQ(artifact.limits().torque_nm[2], 1500.0);
  EXPECT_EQ(artifact.limits().torque_nm[3], 0.0);
  EXPECT_EQ(artifact.domain().angle_rad[1].low, -2.0);
  EXPECT_FALSE(artifact.law().reads_speed());
  EXPECT_EQ(artifact.law().coriolis(), nullptr);
  EXPECT_TRUE(artifact.law().model.inertia.is_affine());
}

TEST(Artifact, has_as_hash_prefix_the_first_eight_bytes_big_endian) {
  const Artifact artifact = parse(artifact_table("pid", 1));
  char text[17] = {};
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(artifact.hash_prefix()));
  EXPECT_EQ(artifact.hash().substr(0, 16), text);
}

TEST(Artifact, is_the_same_from_either_twin_and_from_a_file) {
  const Json table = artifact_table("ctc-dob", 2);
  const Artifact from_json = parse(table);
  EXPECT_EQ(Artifact::parse(cbor_twin(table), "a.cbor").hash(), from_json.hash());
  const std::string path = ::testing::TempDir() + "artifact_test.cbor";
  std::ofstream(path, std::ios::binary) << cbor_twin(table);
  EXPECT_EQ(Artifact::load(path).hash(), from_json.hash());
  std::remove(path.c_str());
}

TEST(Artifact, loads_every_kind_for_every_number_of_joints) {
  for (const char* kind : kLawKinds) {
    for (int joints = 1; joints <= kMaxJoints; ++joints) {
      const Artifact artifact = parse(artifact_table(kind, joints));
      EXPECT_EQ(artifact.law_kind(), kind);
      EXPECT_EQ(Controller(artifact).joints(), joints);
    }
  }
}

TEST(Artifact, refuses_unknown_members_except_where_the_format_leaves_them_open) {
  for (const char* place : {"", "/creator", "/robot", "/domain", "/limits", "/programs", "/law", "/law/feedback",
                            "/law/inertia", "/law/inertia/blocks/0", "/programs/gravity"}) {
    EXPECT_THAT(refused(std::string(place) + "/surprise", 1), HasSubstr("the unknown member \"surprise\"")) << place;
  }
  for (const char* place : {"/robot/parameters", "/payloads", "/verification"}) {
    EXPECT_EQ(refused(std::string(place) + "/surprise", 1), "accepted") << place;
  }
  EXPECT_EQ(refused("/witness", {{"surprise", 1}}), "accepted");
}

TEST(Artifact, refuses_any_missing_member_and_names_it) {
  const Json table = artifact_table("dob-acceleration", 2);
  for (const auto& [key, value] : table.items()) {
    Json without = table;
    without.erase(key);
    EXPECT_EQ(refusal([&] { parse(without); }), "a.json: " + key + ": got nothing, expected this member");
  }
  for (const auto& [key, value] : table["law"].items()) {
    Json without = table;
    without["law"].erase(key);
    EXPECT_EQ(refusal([&] { parse(without); }), "a.json: law." + key + ": got nothing, expected this member");
  }
}

TEST(Artifact, F8_refuses_wrong_values_and_names_the_field) {
  EXPECT_THAT(refused("/schema", "quasilpv.trajectory"), HasSubstr("a.json: schema: got \"quasilpv.trajectory\""));
  EXPECT_THAT(refused("/schema_version", 3), HasSubstr("a.json: schema_version: got 3, expected an integer in [1, 2]"));
  EXPECT_THAT(refused("/design_hash", std::string(64, 'A')), HasSubstr("a.json: design_hash: "));
  EXPECT_THAT(refused("/units", "cm"), HasSubstr("a.json: units: got \"cm\", expected \"SI\""));
  EXPECT_THAT(refused("/sample_period_s", 0), HasSubstr("a.json: sample_period_s: got 0, expected a number > 0"));
  EXPECT_THAT(refused("/joints", 8), HasSubstr("a.json: joints: got 8, expected an integer in [1, 7]"));
  EXPECT_THAT(refused("/joints", 2.5), HasSubstr("a.json: joints: got 2.5"));
  EXPECT_THAT(refused("/joints", 2), HasSubstr("a.json: domain.angle_rad: got an array of 3"));
  EXPECT_THAT(refused("/domain/speed_rad_s/1", {2.0, -2.0}), HasSubstr("a.json: domain.speed_rad_s[1]: got [2, -2]"));
  EXPECT_THAT(refused("/limits/torque_nm/2", -1.0), HasSubstr("a.json: limits.torque_nm[2]: got -1"));
  EXPECT_THAT(refused("/limits/slew_nm_per_s", {1.0}), HasSubstr("a.json: limits.slew_nm_per_s: got an array of 1"));
  EXPECT_THAT(refused("/witness", 3), HasSubstr("a.json: witness: "));
  EXPECT_THAT(refused("/payloads", nullptr), HasSubstr("a.json: payloads: "));
  EXPECT_THAT(refused("/law/kind", "magic"), HasSubstr("a.json: law.kind: got \"magic\""));
  EXPECT_THAT(refused("/law/feedback/kp", "high"), HasSubstr("a.json: law.feedback.kp: got \"high\""));
  EXPECT_THAT(refused("/law/observer/4", 1.0), HasSubstr("a.json: law.observer: got an array of 5"));
  EXPECT_THAT(refused("/law/filter_time_constant_s", 0), HasSubstr("a.json: law.filter_time_constant_s: got 0"));
  EXPECT_THAT(refused("/law/disturbance_compensation", 1), HasSubstr("a.json: law.disturbance_compensation: got 1"));
  EXPECT_THAT(refused("/programs/gravity/outputs", 2), HasSubstr("a.json: programs.gravity.outputs: got 2"));
  EXPECT_THAT(refused("/programs/premises/code/0/1", 3), HasSubstr("a.json: programs.premises.code[0][1]: got 3"));
  EXPECT_THAT(refused("/programs/gravity/code/1/0", "speed"), HasSubstr("a.json: programs.gravity.code[1]: "));
  EXPECT_THAT(refused("/law/kp/0", nullptr, "pid"), HasSubstr("a.json: law.kp[0]: got null"));
  EXPECT_THAT(refused("/law/gi", {1.0}, "ctc"), HasSubstr("a.json: law.gi: got an array of 1"));
  EXPECT_THAT(refused("/law/velocity_filter_time_constant_s", -1, "pid"), HasSubstr("expected a number >= 0"));
}

TEST(Artifact, refuses_a_bandwidth_that_contradicts_the_kind) {
  const char* bandwidth = "/law/disturbance_observer_bandwidth_rad_s";
  EXPECT_THAT(refused(bandwidth, 50.0, "ctc"), HasSubstr("law.disturbance_observer_bandwidth_rad_s: got 50"));
  EXPECT_THAT(refused(bandwidth, 0, "ctc-dob"), HasSubstr("law.disturbance_observer_bandwidth_rad_s: got 0"));
}

TEST(Artifact, refuses_gain_tables_of_another_shape_or_another_schedule_than_the_inertia) {
  EXPECT_THAT(refused("/law/feedback/lower/0", -0.6, "dob-torque"),
              HasSubstr("a.json: law.feedback: got another box, centre or partition of the premises"));
  EXPECT_THAT(refused("/law/observer/centre/2", 0.3, "dob-torque"),
              HasSubstr("a.json: law.observer: got another box, centre or partition of the premises"));
  EXPECT_THAT(refused("/law/feedback/blocks/0/vertices/0/0", {1.0, 2.0, 3.0}, "dob-torque"),
              HasSubstr("a.json: law.feedback.blocks[0].vertices[0][0]: got an array of 3"));
  EXPECT_THAT(refused("/law/observer/blocks/1/vertices/1/12", {1.0, 2.0, 3.0}, "dob-torque"),
              HasSubstr("a.json: law.observer.blocks[1].vertices[1]: got 13 rows, expected 12"));
  EXPECT_THAT(refused("/law/filter_time_constant_s", 0, "dob-torque"), HasSubstr("law.filter_time_constant_s: got 0"));
}

TEST(Artifact, refuses_a_premultiplication_that_is_null_or_scheduled_otherwise) {
  Json table = artifact_table("dob-torque", 3);
  table["law"]["premultiplication"] = table["law"]["inertia"];
  EXPECT_NO_THROW((void)Artifact::parse(json_twin(table), "a.json"));
  EXPECT_THAT(refused("/law/premultiplication", nullptr, "dob-torque"),
              HasSubstr("a.json: law.premultiplication: got null, expected an object"));
  EXPECT_THAT(refused("/law/premultiplication", table["law"]["feedback"], "dob-torque"),
              HasSubstr("a.json: law.premultiplication.blocks[0].vertices[0]"));
}

TEST(Artifact, keeps_a_lyapunov_bound_of_either_twin_padded_to_the_most_joints) {
  Json table = artifact_table("dob-acceleration", 2);
  EXPECT_EQ(parse(table).law().lyapunov_bound(), nullptr);
  table["law"]["lyapunov_bound"] = testing::TestArm{2}.lyapunov_bound();
  for (const std::string& bytes : {json_twin(table), cbor_twin(table)}) {
    const Artifact artifact = Artifact::parse(bytes, "a");
    const LyapunovBound* const bound = artifact.law().lyapunov_bound();
    ASSERT_NE(bound, nullptr);
    EXPECT_EQ(bound->innovation_share, 1.0 - table["law"]["observer"][0].get<double>());
    EXPECT_EQ(bound->signals, testing::TestArm::weights(LyapunovBound::kSignals));
    EXPECT_EQ(bound->joints.topLeftCorner(2, 2), testing::TestArm::weights(2));
    EXPECT_TRUE((bound->joints.bottomRows(kMaxJoints - 2).isZero(0.0)));
    EXPECT_TRUE((bound->joints.rightCols(kMaxJoints - 2).isZero(0.0)));
  }
}

TEST(Artifact, refuses_a_lyapunov_bound_that_is_none) {
  const auto refused_bound = [](const std::string& pointer, const Json& value) {
    Json bound = testing::TestArm{3}.lyapunov_bound();
    bound[Json::json_pointer(pointer)] = value;
    return refused("/law/lyapunov_bound", bound);
  };
  EXPECT_THAT(refused("/law/lyapunov_bound", nullptr), HasSubstr("a.json: law.lyapunov_bound: got null, expected"));
  EXPECT_THAT(refused_bound("/surprise", 1), HasSubstr("a.json: law.lyapunov_bound: got the unknown member"));
  EXPECT_THAT(refused_bound("/signals/0/1", 9.0), HasSubstr("law.lyapunov_bound.signals: got a matrix with asymmetry"));
  EXPECT_THAT(refused_bound("/signals/4/4", -1.0), HasSubstr("law.lyapunov_bound.signals: got smallest eigenvalue -"));
  EXPECT_THAT(refused_bound("/signals/4", {1.0}), HasSubstr("law.lyapunov_bound.signals[4]: got an array of 1"));
  EXPECT_THAT(refused_bound("/signals/2/2", nullptr), HasSubstr("law.lyapunov_bound.signals[2][2]: got null"));
  EXPECT_THAT(refused_bound("/joints", Json::array({{1.0}})), HasSubstr("law.lyapunov_bound.joints: got 1 rows"));
  EXPECT_THAT(refused_bound("/joints/0/1", 0.2), HasSubstr("law.lyapunov_bound.joints: got a matrix with asymmetry"));
  Json table = artifact_table("dob-acceleration", 3);
  table["law"]["lyapunov_bound"] = testing::TestArm{3}.lyapunov_bound();
  table["law"]["observer"][0] = 1.0;  // the correction leaves nothing of the innovation to read it off
  EXPECT_THAT(refusal([&] { parse(table); }), HasSubstr("a.json: law.observer[0]: got 1, expected another number"));
}

TEST(Artifact, refuses_a_lyapunov_matrix_of_another_shape_or_that_is_not_symmetric_and_positive_definite) {
  EXPECT_THAT(refused("/law/lyapunov/8", {1.0, 2.0, 3.0}, "hinf-tracking"),
              HasSubstr("a.json: law.lyapunov[8]: got an array of 3"));
  EXPECT_THAT(refused("/law/lyapunov/0/1", 9.0, "hinf-tracking"),
              HasSubstr("a.json: law.lyapunov: got a matrix with asymmetry"));
  EXPECT_THAT(refused("/law/lyapunov/0/0", 0.01, "hinf-tracking"),
              HasSubstr("a.json: law.lyapunov: got smallest eigenvalue -"));
  EXPECT_THAT(refused("/law/numerator/lower/0", -0.6, "hinf-tracking"),
              HasSubstr("a.json: law.numerator: got another box, centre or partition of the premises"));
}

TEST(Artifact, refuses_a_schedule_of_another_size_than_the_gains_or_that_reads_the_reference) {
  for (const char* kind : {"state-feedback", "descriptor-feedback", "delayed-feedback"}) {
    EXPECT_THAT(refused("/programs/schedule/outputs", 1, kind), HasSubstr("programs.schedule.outputs: got 1")) << kind;
    EXPECT_THAT(refused("/programs/schedule/code/2/0", "reference_speed", kind),
                HasSubstr("a.json: programs.schedule.code[2]: "));
    EXPECT_THAT(refused("/programs/premises/code/0/0", "speed", kind), HasSubstr("programs.premises.code[0]: "));
  }
  EXPECT_THAT(refused("/law/gain/blocks/0/vertices/0/0", {1.0, 2.0, 3.0}, "state-feedback"),
              HasSubstr("a.json: law.gain.blocks[0].vertices[0][0]: got an array of 3"));
  EXPECT_THAT(refused("/law/lyapunov/0/1", 9.0, "descriptor-feedback"),
              HasSubstr("a.json: law.lyapunov: got a matrix with asymmetry"));
}

TEST(Artifact, refuses_a_window_that_is_too_short_to_have_a_mean_but_not_its_limit) {
  for (const int samples : {1, 4, -1, 4097}) {
    EXPECT_THAT(refused("/law/window_samples", samples, "delayed-feedback"),
                HasSubstr("a.json: law.window_samples: got " + std::to_string(samples)));
  }
  for (const int samples : {0, 5, 4096}) {
    EXPECT_EQ(refused("/law/window_samples", samples, "delayed-feedback"), "accepted");
  }
}

TEST(Artifact, refuses_delayed_gains_that_are_not_one_per_triple_of_vertices_and_a_vertex_that_is_no_lyapunov_matrix) {
  Json table = artifact_table("delayed-feedback", 2);
  table["law"]["numerators"].erase(3);
  EXPECT_THAT(refusal([&] { parse(table); }),
              HasSubstr("a.json: law.numerators: got 63 matrices, expected 64, the cube of the number of vertices"));
  EXPECT_THAT(refused("/law/lyapunov/blocks/1/vertices/0/0/0", -1.0, "delayed-feedback"),
              HasSubstr("a.json: law.lyapunov.blocks: got smallest eigenvalue -"));
  EXPECT_THAT(refused("/law/lyapunov/blocks/1/vertices/0/0/1", 0.1, "delayed-feedback"),
              HasSubstr("a.json: law.lyapunov.blocks: got vertex 2 with asymmetry"));
  EXPECT_THAT(refused("/law/descriptor", 1, "delayed-feedback"), HasSubstr("a.json: law.descriptor: got 1"));
}

TEST(Artifact, refuses_an_inertia_that_is_not_symmetric) {
  EXPECT_THAT(refused("/law/inertia/blocks/0/vertices/0/0/1", 9.0),
              HasSubstr("a.json: law.inertia.blocks: got vertex 0 with asymmetry"));
}

TEST(Artifact, refuses_a_singular_or_indefinite_inertia_but_not_an_indefinite_vertex) {
  const auto with_inertia = [](const Json& lower, const Json& upper) {
    Json table = artifact_table("dob-acceleration", 2);
    table["programs"]["premises"] = {{"outputs", 1}, {"code", Json::parse(R"([["angle",0],["cos"]])")}};
    table["law"]["inertia"] = {{"premises", 1},
                               {"lower", {-1}},
                               {"upper", {1}},
                               {"centre", {0}},
                               {"blocks", {{{"kind", "box"}, {"premises", {0}}, {"vertices", {lower, upper}}}}}};
    return refusal([&] { parse(table); });
  };
  const Json rank_one = Json::parse("[[1,1],[1,1]]");
  const Json indefinite = Json::parse("[[1,2],[2,1]]");
  const Json definite = Json::parse("[[4,0],[0,4]]");
  EXPECT_THAT(with_inertia(rank_one, rank_one), HasSubstr("a.json: law.inertia: got smallest eigenvalue"));
  EXPECT_THAT(with_inertia(indefinite, indefinite), HasSubstr("got smallest eigenvalue -"));
  EXPECT_EQ(with_inertia(indefinite, definite), "accepted");
}

TEST(Artifact, reports_a_missing_file_in_one_line) {
  EXPECT_EQ(refusal([] { Artifact::load("/nonexistent.json"); }),
            "/nonexistent.json: file: got nothing that can be opened, expected a readable file");
}

}  // namespace
}  // namespace quasilpv
