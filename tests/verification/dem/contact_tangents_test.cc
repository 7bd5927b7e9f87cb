// The stiffness that laws and effects report against the difference of their forces.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "dem/dynamics/contact_model.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 1e-3;  // [m]

/// Response of two equal grains at an overlap [m], both freshly in touch.
struct Response {
  double force, normal, shear;
};

Response At(const ContactModel& model, double overlap) {
  ContactBlock block;
  block.count = 1;
  block.dx[0] = 2 * kRadius - overlap;
  block.dy[0] = block.dz[0] = 0;
  block.radius_i[0] = block.radius_j[0] = kRadius;
  for (ContactBlock::Lane* lane : {&block.vx, &block.vy, &block.vz, &block.wix, &block.wiy,
                                   &block.wiz, &block.wjx, &block.wjy, &block.wjz}) {
    (*lane)[0] = 0;
  }
  for (auto& column : block.own_history) column[0] = 0;
  PadLanes(kMaxHistory, block);
  model.Evaluate(block);
  return {block.normal_force[0], block.normal_stiffness[0], block.tangential_stiffness[0]};
}

// Also where the factor of hertz_nonlinearity is held, below a thousandth of the reference force:
// n/m of the tangent was reported there, a too small step's stiffness and a too small shear spring.
TEST(ContactTangents, AreTheSlopesOfTheForces) {
  struct Base {
    Model model;
    double exponent;
  };
  for (const Base& base : {Base{test::LinearModel(), 1}, Base{test::HertzModel(), 1.5}}) {
    const ContactModel plain = ContactModelOf(base.model);
    for (const double n : {0.75, 1.0, 1.25, 1.5, 2.5}) {
      Scenario s;
      s.model = base.model;
      s = test::With(s, "hertz_nonlinearity", {{"exponent", n}, {"reference_pressure", 2e7}});
      const ContactModel bent = ContactModelOf(s.model);
      const double reference = 2e7 * 4 * kRadius * kRadius;
      int held = 0;
      for (double u = 2e-8; u < 1e-4; u *= 1.7) {
        const Response at = At(bent, u);
        const double h = 1e-3 * u;
        const double slope = (At(bent, u + h).force - At(bent, u - h).force) / (2 * h);
        EXPECT_NEAR(at.normal, slope, 1e-5 * slope) << base.exponent << " " << n << " " << u;
        const Response law = At(plain, u);
        EXPECT_NEAR(at.shear / at.normal, law.shear / law.normal, 1e-9) << n << " " << u;
        held += n < base.exponent && law.force < 1e-3 * reference ? 1 : 0;
      }
      EXPECT_TRUE(n >= base.exponent || held > 3) << n;
    }
  }
}

}  // namespace
}  // namespace calib::dem
