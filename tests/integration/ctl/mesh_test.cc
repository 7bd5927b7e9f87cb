// A mesh named in a campaign: it travels with the campaign, and what becomes of its file later does
// not matter.
#include <gmock/gmock.h>

#include "tests/integration/ctl/calibctl_fixture.h"
#include "tests/support/stl_text.h"

namespace calib::ctl {
namespace {

using testing::BinaryStl;
using testing::FourSides;
using testing::FunnelShape;
using ::testing::HasSubstr;

class MeshCampaign : public CalibctlFixture {
 protected:
  MeshCampaign() {
    Write("chute.csv", "belt_speed,mass_flow_right\n1.0,0.03\n");
    Write("chute.yaml", R"(name: chute
model:
  contact: hertz_mindlin
  effects: [viscous_damping]
  density: 2500
  fixed: {young_modulus: 5e6, poisson_ratio: 0.25, viscous_damping.ratio: 0.3}
parameters:
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.6}
experiments:
  - name: fall
    test: transfer_chute
    packing: {generate: {particles: 60, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}
    meshes: {funnel: {file: funnel.stl, unit: mm}}
    data: {file: chute.csv}
    control: belt_speed
    observables: {mass_flow_right: {noise: {absolute: 0.01}}}
inference: {method: sqmc, samples: 2}
)");
    PutFunnel({.lower = 13, .upper = 30, .height = 25});
  }

  void PutFunnel(const FunnelShape& shape) const {
    Write("funnel.stl", BinaryStl(FourSides(shape)));
  }

  Json States(const std::string& campaign, const std::string& state) const {
    return Call("states " + campaign + " 0 --state " + state + " --json").json()["experiments"];
  }
};

TEST_F(MeshCampaign, TheMeshOfTheSubmissionIsRunWhateverBecomesOfItsFile) {
  ASSERT_EQ(Call("submit chute.yaml --state b").out, "c1\n") << Read("err");
  const Answer run = Call("run chute.yaml --workers 2 --state a --json");
  ASSERT_EQ(run.code, 0) << run.err;
  const Json undisturbed = States("c1", "a");
  ASSERT_EQ(undisturbed[0]["states"].size(), 1U) << undisturbed;

  PutFunnel({.lower = 13, .upper = 30, .height = 25, .middle_y = 8});
  EXPECT_EQ(Call("watch c1 --state b --workers 1").code, 0) << Read("err");
  EXPECT_EQ(States("c1", "b"), undisturbed);
  const Answer other = Call("run chute.yaml --workers 2 --state a --json");
  ASSERT_EQ(other.code, 0) << other.err;
  EXPECT_EQ(other.json()["campaign"], "c2");
  EXPECT_NE(States("c2", "a")[0]["states"], undisturbed[0]["states"]);
}

TEST_F(MeshCampaign, SimulateRunsTheMeshAndABadOneIsRefusedInASentence) {
  const Answer answer =
      Call("simulate chute.yaml --set friction_coefficient=0.4 -o states.csv --vtk grains");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(Read("states.csv"), HasSubstr("fall,0,1,"));
  PutFunnel({.lower = 13, .upper = 30, .height = -25});
  const Answer low = Call("validate chute.yaml");
  EXPECT_EQ(low.code, 2);
  EXPECT_THAT(low.err, HasSubstr("fall: mesh funnel lies below its origin"));
  Write("funnel.stl", "solid x\nfacet normal 0 0 0\nouter loop\nvertex 0 0\n");
  const Answer broken = Call("validate chute.yaml");
  EXPECT_EQ(broken.code, 2);
  EXPECT_EQ(broken.err, "funnel.stl:4: a vertex line is: vertex x y z, with three numbers\n");
}

}  // namespace
}  // namespace calib::ctl
