// Readings back from the scale on which a diagnosis sees them.
#include "server/diagnosis/history_scale.h"

#include <gtest/gtest.h>

#include "inference/data/data_set.h"
#include "tests/support/race_toy.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

class HistoryScales : public ::testing::Test {
 protected:
  campaign::Campaign campaign_ = RaceToy(1, 5, 1).Measured({}, 1).campaign;
  inference::DataSet data_ = campaign::MakeDataSet(campaign_);
  HistoryScale scale_{campaign_, data_};

  double ValueAt(Index column) const {  // of the result
    return data_
        .readings[static_cast<std::size_t>(scale_.order()[static_cast<std::size_t>(column)])]
        .value;
  }
};

// Parts of a reading on either side of the twentieth where the logarithm becomes a straight line,
// on it, and of the wrong sign.
TEST_F(HistoryScales, ReadingsAreTheInverseOfScaled) {
  const Eigen::RowVectorXd measured = scale_.Readings(Eigen::RowVectorXd::Zero(96));
  const double parts[] = {1, 1.3, 0.2, 0.05, 0.049, 0.01, 0, -1};
  Eigen::MatrixXd readings(std::size(parts), 96);
  for (Index i = 0; i < readings.rows(); ++i)
    readings.row(i) = parts[static_cast<std::size_t>(i)] * measured;
  const Eigen::MatrixXd scaled = scale_.Scaled(readings);
  int logarithmic = 0;
  for (Index c = 0; c < 96; ++c) {
    logarithmic += scale_.is_logarithmic(c) ? 1 : 0;
    EXPECT_NEAR(measured[scale_.order()[static_cast<std::size_t>(c)]], ValueAt(c),
                1e-12 * std::abs(ValueAt(c)))
        << "the measured history is zero";
  }
  EXPECT_EQ(logarithmic, 48) << "the stresses, and not the strains";
  // Rounding is of the size of a reading; logarithms amplify none of it here.
  const Eigen::MatrixXd back = scale_.Readings(scaled);
  EXPECT_LT(((back - readings).array().rowwise() / measured.array()).abs().maxCoeff(), 1e-12);
  const Eigen::MatrixXd again = scale_.Scaled(back);
  EXPECT_LT((again - scaled).cwiseAbs().maxCoeff(), 1e-9 * scaled.cwiseAbs().maxCoeff());
}

TEST_F(HistoryScales, ALogarithmBecomesTheLineThatTouchesIt) {
  const Eigen::RowVectorXd measured = scale_.Readings(Eigen::RowVectorXd::Zero(96));
  const auto at = [&](double part) { return scale_.Scaled(part * measured); };
  constexpr double kStep = 1e-3, kLine = 0.05;
  const Eigen::MatrixXd below = at(kLine) - at(kLine - kStep);
  const Eigen::MatrixXd farther = at(kLine - 20 * kStep) - at(kLine - 21 * kStep);
  const Eigen::MatrixXd above = at(kLine + kStep) - at(kLine);
  for (Index c = 0; c < 96; ++c) {
    EXPECT_NEAR(farther(0, c), below(0, c), 1e-9 * std::abs(below(0, c))) << "a straight line";
    // Second order of the logarithm there: half a step of a fiftieth of its argument.
    EXPECT_NEAR(above(0, c) / below(0, c), 1, 0.011) << c;
  }
}

}  // namespace
}  // namespace calib::diagnosis
