#include "server/planning/posterior_record.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace calib::scheduler {
namespace {

TEST(PosteriorRecord, JsonKeepsEveryBit) {
  v1::Posterior posterior;
  posterior.set_log_evidence(-1.0 / 3.0);
  posterior.set_log_evidence_se(5e-324);
  posterior.set_ess(std::nextafter(17.0, 18.0));
  posterior.set_pareto_k(std::numeric_limits<double>::infinity());
  posterior.add_parameters()->set_mean(0.1 + 0.2);
  posterior.add_warnings("few \"effective\" samples");
  const auto back = planning::PosteriorFromJson(planning::PosteriorToJson(posterior));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->SerializeAsString(), posterior.SerializeAsString());
  EXPECT_EQ(planning::MeansOf(*back).parameters.front().mean, 0.1 + 0.2);
}

TEST(PosteriorRecord, ProposalKeepsEveryBit) {
  inference::Proposal proposal;
  proposal.defensive_share = 0.1;
  proposal.log_acceptance = -1e-17;
  inference::Proposal::Component component;
  component.weight = 1.0 / 3.0;
  component.mean = Eigen::Vector2d(0.1, -2.0 / 3.0);
  component.covariance = Eigen::Matrix2d{{1.1, 0.3}, {0.3, 2.2}};
  proposal.components.push_back(component);
  const auto back = planning::ProposalFromJson(planning::ProposalToJson(proposal));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->log_acceptance, proposal.log_acceptance);
  EXPECT_EQ(back->components.front().weight, component.weight);
  EXPECT_EQ(back->components.front().mean, component.mean);
  EXPECT_EQ(back->components.front().covariance, component.covariance);
}

TEST(PosteriorRecord, DamagedTextIsDataLoss) {
  EXPECT_EQ(planning::PosteriorFromJson("{").status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(planning::ProposalFromJson("{}").status().code(), absl::StatusCode::kDataLoss);
}

}  // namespace
}  // namespace calib::scheduler
