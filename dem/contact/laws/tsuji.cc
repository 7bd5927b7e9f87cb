#include "dem/contact/laws/tsuji.h"

#include "dem/contact/contact_kernel.h"
#include "dem/contact/viscoelastic.h"

namespace calib::dem {
namespace {

std::unique_ptr<ContactKernel> Dashpot(const KernelContext& context) {
  return MakeViscoelasticDashpot(context, {.kind = ViscoelasticExponent::Kind::kQuarter});
}

}  // namespace

ContactEntry Tsuji() {
  return {
      .info = {.name = "tsuji",
               .description = "Hertz contact with a dashpot: F = 4/3 E* sqrt(r*) u^1.5 + damping "
                              "u' u^0.25, which may pull; dFs = tangential_stiffness dus, |Fs| <= "
                              "tan(phi_mu) |F|; restitution does not depend on speed",
               .parameters = ViscoelasticParameters("N s/m^1.25"),
               .reference = "Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239; Hadjidoukas et "
                            "al. 2014, Table 1, M1"},
      .place = 30,
      .make = &MakeViscoelasticSprings,
      .make_dashpot = &Dashpot};
}

}  // namespace calib::dem
