#include "server/report/documents/fit_plots.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const TerminalStyle kPlain = {.columns = 70};

std::vector<ExperimentCurves> ExampleCurves() {
  const CampaignView view = testing::ExampleView("sand");
  return Curves(view, PredictReadings(view));
}

TEST(FitPlots, DrawReadingsModelAndResidualsTheLargestErrorFirst) {
  const std::string all = FitPlots(ExampleCurves(), 10, kPlain);
  for (const char* said : {"tx02, q over p: ", "tx05 (held out), volumetric strain: ", "measured",
                           "model, median", "tx02: model minus measurement [sd]"}) {
    EXPECT_THAT(all, HasSubstr(said));
  }
  EXPECT_THAT(all, Not(HasSubstr("nan")));
  EXPECT_THAT(all, Not(HasSubstr("more observables")));
  const std::string one = FitPlots(ExampleCurves(), 1, kPlain);
  EXPECT_THAT(one, HasSubstr("3 more observables: calibctl page shows all"));
  EXPECT_EQ(one.substr(0, one.find(':')), all.substr(0, all.find(':')));
}

TEST(FitPlots, BeforeAPosteriorTheBestRunStandsForTheModel) {
  std::vector<ExperimentCurves> curves = ExampleCurves();
  curves.resize(1);
  for (ObservableCurves& o : curves[0].observables) {
    o.prediction = {};
    o.residual.assign(o.values.size(), std::nan(""));
  }
  const std::string text = FitPlots(curves, 1, kPlain);
  EXPECT_THAT(text, HasSubstr("best run"));
  EXPECT_THAT(text, Not(HasSubstr("model minus measurement")));
  EXPECT_THAT(text, Not(HasSubstr(" sd")));
}

TEST(FitPlots, OfNothingThereIsNothing) { EXPECT_EQ(FitPlots({}, 3, kPlain), ""); }

}  // namespace
}  // namespace calib::report
