#include "dem/contact/laws/kuwabara_kono.h"

#include "dem/contact/contact_kernel.h"
#include "dem/contact/viscoelastic.h"

namespace calib::dem {
namespace {

std::unique_ptr<ContactKernel> Dashpot(const KernelContext& context) {
  return MakeViscoelasticDashpot(context, {.kind = ViscoelasticExponent::Kind::kHalf});
}

}  // namespace

ContactEntry KuwabaraKono() {
  return {.info = {.name = "kuwabara_kono",
                   .description = "Viscoelastic spheres: F = 4/3 E* sqrt(r*) u^1.5 + damping u' "
                                  "u^0.5, which may pull; dFs = tangential_stiffness dus, |Fs| <= "
                                  "tan(phi_mu) |F|; 1 - restitution grows with speed^0.2",
                   .parameters = ViscoelasticParameters("N s/m^1.5"),
                   .reference = "Kuwabara & Kono, Jpn. J. Appl. Phys. 26 (1987) 1230; Hadjidoukas "
                                "et al. 2014, Table 1, M2"},
          .place = 40,
          .make = &MakeViscoelasticSprings,
          .make_dashpot = &Dashpot};
}

}  // namespace calib::dem
