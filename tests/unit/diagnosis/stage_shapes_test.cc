#include "server/diagnosis/stage_shapes.h"

#include <gtest/gtest.h>

namespace calib::diagnosis {
namespace {

// Two observables along one path of three stages.
TEST(StageShapes, AreConstantsAndTrendsOfEachObservableInEachStage) {
  campaign::Campaign campaign;
  campaign::Experiment& experiment = campaign.experiments.emplace_back();
  experiment.segment = {"loading", "loading", "loading", "loading", "unload", "unload",
                        "reload",  "reload",  "reload",  "reload",  "reload"};
  inference::DataSet data;
  for (int step = 0; step < 11; ++step) {
    for (const int observable : {0, 1}) {
      data.readings.push_back({.observable = observable, .load_step = step});
    }
  }
  const std::vector<Eigen::MatrixXd> sets = StageShapes(campaign, data);
  ASSERT_EQ(sets.size(), 2U);
  EXPECT_EQ(sets[0].cols(), 6);   // constants
  EXPECT_EQ(sets[1].cols(), 10);  // unloading is too short for a trend
  EXPECT_TRUE((sets[0].rowwise().sum().array() == 1).all()) << "every reading is in one stage";
  EXPECT_EQ(sets[0].colwise().sum().maxCoeff(), 5);
  for (Eigen::Index k = 0; k < sets[1].cols(); ++k) {
    const Eigen::VectorXd shape = sets[1].col(k);
    if (shape.minCoeff() < 0) {
      EXPECT_NEAR(shape.sum(), 0, 1e-12) << "a trend has no mean";
    }
  }
  data.readings.resize(8);  // loading only: constants are a quarter of the readings, trends half
  EXPECT_EQ(StageShapes(campaign, data).size(), 2U);
  data.readings.resize(4);
  EXPECT_EQ(StageShapes(campaign, data).size(), 2U) << "too short for trends";
  data.readings.resize(2);
  EXPECT_TRUE(StageShapes(campaign, data).empty()) << "as many shapes as readings";
}

}  // namespace
}  // namespace calib::diagnosis
