#pragma once
// Stiffness, limit and catalogue parameters that rolling and twisting resistance have in common.

#include <limits>
#include <vector>

#include "dem/contact/contact_kernel.h"
#include "dem/model/effect.h"

namespace calib::dem {

/// Law of a moment at a contact: stiffness k = constant + ratio r1 r2 ks, limit = friction Fn l
/// with l the mean radius or the smaller radius.
struct MomentLaw {
  double constant = 0;                                        ///< [N m/rad]
  double ratio = 0;                                           ///< [-]
  double friction = std::numeric_limits<double>::infinity();  ///< eta [-]; infinite: no limit
  bool limit_by_smaller = false;  ///< l = min(r1, r2) instead of (r1 + r2)/2
};

/// The law from the parameters stiffness or stiffness_ratio, and friction, under the contact law of
/// the context. Pure. [Cheng 2018, Table 1]
MomentLaw MomentLawFrom(const KernelContext& context);

/// The laws of all pairs of materials, by Materials::Pair(); for a model with one material one law.
/// A pair that has a stiffness or a stiffness_ratio of its own has it instead of either of the
/// effect's.
std::vector<MomentLaw> MomentLawsFrom(const KernelContext& context);

/// Catalogue entries of stiffness, stiffness_ratio and friction; `motion` ("rolling", "twisting")
/// completes their descriptions.
std::vector<ParameterInfo> MomentParameters(const std::string& motion);

/// Two ways to turn a moment on: its limit with a stiffness like that of sliding, and its stiffness
/// with a limit that is hardly reached.
std::vector<StrengthRay> MomentRays();

/// Stiffness [N m/rad] and limit [N m] of every lane.
struct MomentResponse {
  ContactBlock::Lane stiffness;
  ContactBlock::Lane limit;
};

/// Evaluates the laws of MomentLawsFrom() on a block whose normal force and tangential stiffness
/// are known.
void EvaluateMoment(const std::vector<MomentLaw>& laws, const ContactBlock& block,
                    MomentResponse& response);

}  // namespace calib::dem
