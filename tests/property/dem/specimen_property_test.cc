// Any small specimen in any test: threads and the order of grains in the file change no bit.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numeric>
#include <random>

#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

struct Outcomes {
  std::vector<std::vector<double>> values;
  std::int64_t steps = 0;
  bool operator==(const Outcomes&) const = default;
};

Outcomes ResultOf(const Scenario& scenario) {
  const test::Run run = test::RunAll(scenario);
  Outcomes outcomes{.values = {}, .steps = run.summary.steps};
  for (const State& state : run.states) outcomes.values.push_back(state.values);
  return outcomes;
}

Scenario SomeScenario() {
  const Model models[2] = {test::HertzModel(), test::LinearModel()};
  Scenario s = test::SmallTriaxial(models[*rc::gen::inRange(0, 2)]);
  const char* tests[4] = {"triaxial_drained", "triaxial_undrained", "oedometric", "simple_shear"};
  s.test = tests[*rc::gen::inRange(0, 4)];
  s.model.parameters["friction_coefficient"] = 0.1 * *rc::gen::inRange(0, 10);
  s.packing = test::SmallPacking(*rc::gen::element(60, 150));
  s.staging.unbalanced = 1e-2;
  s.path = {{.target = 0.001 * *rc::gen::inRange(1, 5), .load_step = 0}};
  return s;
}

RC_GTEST_PROP(Specimen, ThreadsChangeNoBit, ()) {
  Scenario s = SomeScenario();
  const Outcomes one = ResultOf(s);
  s.threads = *rc::gen::inRange(2, 5);
  RC_ASSERT(ResultOf(s) == one);
}

RC_GTEST_PROP(Specimen, OrderInTheFileChangesNoBit, ()) {
  const Scenario s = SomeScenario();
  Scenario shuffled = s;
  std::vector<std::size_t> order(s.packing.x.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), std::mt19937(*rc::gen::inRange(0U, 1000U)));
  for (std::size_t k = 0; k < order.size(); ++k) {
    shuffled.packing.x[k] = s.packing.x[order[k]];
    shuffled.packing.y[k] = s.packing.y[order[k]];
    shuffled.packing.z[k] = s.packing.z[order[k]];
    shuffled.packing.radius[k] = s.packing.radius[order[k]];
  }
  RC_ASSERT(ResultOf(s) == ResultOf(shuffled));
}

}  // namespace
}  // namespace calib::dem
