// The doctor's judgement is a function of its findings; its measurements measure.
#include "quasilpv/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "loop_fixture.hpp"
#include "quasilpv/in_process_link.hpp"

namespace quasilpv {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kMicrosecond = 1000;

LatencyHistogram always(std::int64_t ns) {
  LatencyHistogram histogram;
  for (int i = 0; i < 1000; ++i) {
    histogram.add(ns);
  }
  return histogram;
}

/// 1 kHz; wake-up 100 us, under SCHED_FIFO 50 us, step 10 us, round trip 100 us.
DoctorFindings healthy() {
  DoctorFindings findings;
  findings.wakeup = always(100 * kMicrosecond);
  findings.realtime = {true, true};
  findings.wakeup_fifo = always(50 * kMicrosecond);
  findings.step = always(10 * kMicrosecond);
  findings.round_trip = always(100 * kMicrosecond);
  return findings;
}

TEST(Doctor, when_everything_is_fast_expect_a_rate_that_holds_and_nothing_to_change) {
  EXPECT_EQ(judge(healthy()), DoctorVerdict::kHolds);
  EXPECT_THAT(advice(healthy()), IsEmpty());
}

TEST(Doctor, when_the_sum_of_the_parts_exceeds_half_the_period_or_all_of_it_expect_marginal_or_failure) {
  DoctorFindings findings = healthy();
  findings.round_trip = always(600 * kMicrosecond);
  EXPECT_EQ(judge(findings), DoctorVerdict::kMarginal);
  findings.round_trip = always(1000 * kMicrosecond);
  EXPECT_EQ(judge(findings), DoctorVerdict::kFails);
  EXPECT_THAT(advice(findings).at(0), HasSubstr("round trip"));
}

TEST(Doctor, judges_the_rare_samples_and_not_the_usual_ones) {
  DoctorFindings findings = healthy();
  findings.wakeup_fifo = always(50 * kMicrosecond);
  for (int i = 0; i < 5; ++i) {
    findings.wakeup_fifo->add(3000 * kMicrosecond);
  }
  EXPECT_EQ(judge(findings), DoctorVerdict::kFails);
  EXPECT_THAT(advice(findings).at(0), HasSubstr("PREEMPT_RT"));
}

TEST(Doctor, without_privilege_judges_normal_scheduling_and_says_what_is_missing) {
  DoctorFindings findings = healthy();
  findings.realtime = {};
  findings.wakeup_fifo.reset();
  findings.wakeup = always(2000 * kMicrosecond);
  EXPECT_EQ(judge(findings), DoctorVerdict::kFails);
  EXPECT_THAT(advice(findings).at(0), HasSubstr("CAP_SYS_NICE"));
  EXPECT_THAT(advice(findings).at(1), HasSubstr("CAP_IPC_LOCK"));
}

TEST(Doctor, without_a_transport_says_so_in_its_words) {
  DoctorFindings findings = healthy();
  findings.transport_error = "no multicast; ip route add 224.0.0.0/4 dev lo";
  EXPECT_EQ(judge(findings), DoctorVerdict::kNoTransport);
  EXPECT_THAT(advice(findings).at(0), HasSubstr("ip route add"));
}

TEST(Doctor, when_the_step_is_slow_expect_advice_about_the_design) {
  DoctorFindings findings = healthy();
  findings.step = always(400 * kMicrosecond);
  EXPECT_THAT(advice(findings).at(0), HasSubstr("lower rate"));
}

TEST(Doctor, measures_every_wakeup_step_and_round_trip_once) {
  constexpr std::int64_t kSamples = 20;
  EXPECT_EQ(measure_wakeup(kNanosecondsPerMillisecond, kSamples).count(), kSamples);
  const Artifact law = ::quasilpv::testing::artifact();
  EXPECT_EQ(measure_step(law, kSamples).count(), kSamples);
  auto [controller, plant] = InProcessLink::create_pair(::quasilpv::testing::identity_of(law));
  EXPECT_EQ(measure_round_trip(*plant, *controller, kNanosecondsPerMillisecond, kSamples).count(), kSamples);
}

}  // namespace
}  // namespace quasilpv
