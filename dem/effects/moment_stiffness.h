#pragma once
// Stiffness, limit and catalogue parameters that rolling and twisting resistance have in common.

#include <limits>
#include <vector>

#include "dem/catalog/catalog.h"
#include "dem/contact/contact_kernel.h"

namespace calib::dem {

/// k = constant + ratio r1 r2 ks, limit = friction Fn l with l = mean radius or smaller radius.
struct MomentLaw {
  double constant = 0;                                        ///< [N m/rad]
  double ratio = 0;                                           ///< [-]
  double friction = std::numeric_limits<double>::infinity();  ///< eta [-]; infinite: no limit
  bool limit_by_smaller = false;  ///< l = min(r1, r2) instead of (r1 + r2)/2
};

/// Law from the parameters stiffness or stiffness_ratio, and friction, under a contact law. [Cheng
/// 2018, Table 1]
MomentLaw MomentLawFrom(const KernelContext& context);

/// stiffness, stiffness_ratio, friction; `motion` ("rolling", "twisting") completes the
/// descriptions.
std::vector<ParameterInfo> MomentParameters(const std::string& motion);

/// Stiffness [N m/rad] and limit [N m] of one contact.
struct MomentResponse {
  double stiffness = 0;
  double limit = 0;
};

inline MomentResponse Evaluate(const MomentLaw& law, const ContactBlock& b, int k) {
  const double ri = b.radius_i[k];
  const double rj = b.radius_j[k];
  const double smaller = ri < rj ? ri : rj;
  const double length = law.limit_by_smaller ? smaller : 0.5 * (ri + rj);
  const double force = b.normal_force[k] > 0 ? b.normal_force[k] : 0.0;
  return {.stiffness = law.constant + law.ratio * (ri * rj * b.tangential_stiffness[k]),
          .limit = law.friction * (force * length)};
}

}  // namespace calib::dem
