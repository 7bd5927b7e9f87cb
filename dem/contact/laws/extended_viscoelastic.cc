#include "dem/contact/laws/extended_viscoelastic.h"

#include <utility>

#include "dem/contact/contact_kernel.h"
#include "dem/contact/viscoelastic.h"

namespace calib::dem {
namespace {

std::unique_ptr<ContactKernel> Dashpot(const KernelContext& context) {
  return MakeViscoelasticDashpot(context, {.kind = ViscoelasticExponent::Kind::kGiven,
                                           .value = context.parameters.Get("damping_exponent")});
}

}  // namespace

ContactEntry ExtendedViscoelastic() {
  std::vector<ParameterInfo> parameters = ViscoelasticParameters("1");
  ParameterInfo exponent;
  exponent.name = "damping_exponent";
  exponent.unit = std::string("1");
  exponent.max = 3;
  exponent.default_prior = {.kind = "uniform", .min = 0.15, .max = 1.35};
  exponent.description = "alpha; 1/4 is tsuji, 1/2 kuwabara_kono";
  parameters.push_back(exponent);
  return {
      .info =
          {.name = "extended_viscoelastic",
           .description = "Hertz contact with a dashpot of free exponent: F = 4/3 E* sqrt(r*) "
                          "u^1.5 + damping u' u^damping_exponent, which may pull; dFs = "
                          "tangential_stiffness dus, |Fs| <= tan(phi_mu) |F|",
           .parameters = std::move(parameters),
           .reference =
               "Hadjidoukas et al., Comput. Methods Appl. Mech. Eng. 282 (2014) 218, Table 1, M3"},
      .place = 50,
      .make = &MakeViscoelasticSprings,
      .make_dashpot = &Dashpot};
}

}  // namespace calib::dem
