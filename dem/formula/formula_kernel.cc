#include "dem/formula/formula_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

/// Names that a formula may mention [-]. Chosen: all quantities and UserEffect's parameters are
/// fewer.
constexpr int kMostNames = 32;
/// Step of the difference quotient in the overlap, over the overlap [-]. Chosen: slopes only bound
/// the time step.
constexpr double kOverlapStep = 1e-3;
/// Step of the difference quotient in a velocity, over the velocity [-], and the least one [m/s].
/// Chosen as kOverlapStep.
constexpr double kVelocityStep = 0.1;
constexpr double kLeastVelocity = 1e-6;

/// The order of ContactQuantities() and StageQuantities().
enum Quantity : int {
  kOverlap,
  kClosingVelocity,
  kSlidingVelocity,
  kSlidingDistance,
  kNormalForce,
  kNormalStiffness,
  kTangentialStiffness,
  kShearForce,
  kFriction,
  kEffectiveRadius,
  kSmallerRadius,
  kLargerRadius,
  kEffectiveMass,
  kMeanStress,
  kDeviatoricStress,
  kAxialStrain,
  kVolumetricStrain,
  kPorosity,
  kQuantities
};

double SlipOf(const ContactBlock& b, int k) {
  return std::sqrt(b.slip_x[k] * b.slip_x[k] + b.slip_y[k] * b.slip_y[k] +
                   b.slip_z[k] * b.slip_z[k]);
}

double ShearOf(const ContactBlock& b, int k) {
  return std::sqrt(b.fx[k] * b.fx[k] + b.fy[k] * b.fy[k] + b.fz[k] * b.fz[k]);
}

bool Uses(const Formula& formula, int quantity) {
  return std::find(formula.used().begin(), formula.used().end(), quantity) != formula.used().end();
}

}  // namespace

ContactStage StageOf(const UserEffect& effect) {
  if (effect.target == "friction_coefficient") return ContactStage::kSlidingLimit;
  return effect.target == "shear_force" ? ContactStage::kShearExtra : ContactStage::kNormalExtra;
}

FormulaKernel::FormulaKernel(const UserEffect& effect, const ParameterSet& parameters,
                             const GrainMass& grains, std::shared_ptr<const StageState> stage)
    : effect_(effect),
      formula_(effect.formula, FormulaNames(effect)),
      grains_(grains),
      stage_(std::move(stage)),
      viscous_(IsViscous(effect)),
      remembers_(Uses(formula_, kSlidingDistance)),
      neutral_(effect.action == FormulaAction::kAdds ? 0.0 : 1.0) {
  for (const ParameterInfo& p : effect.info.parameters)
    parameters_.push_back(parameters.Get(p.name));
}

double FormulaKernel::ValueAt(int quantity, const ContactBlock& b, int first, int k) const {
  switch (static_cast<Quantity>(quantity)) {
    case kOverlap:
      return b.overlap[k] > 0 ? b.overlap[k] : 0.0;
    case kClosingVelocity:
      return -b.normal_velocity[k];
    case kSlidingVelocity:
      return b.dt > 0 ? SlipOf(b, k) / b.dt : 0.0;
    case kSlidingDistance:
      return b.history[first][k];
    case kNormalForce:
      return b.normal_force[k];
    case kNormalStiffness:
      return b.normal_stiffness[k];
    case kTangentialStiffness:
      return b.tangential_stiffness[k];
    case kShearForce:
      return ShearOf(b, k);
    case kFriction:
      return b.mixed ? b.friction[k] : b.sliding_friction;
    case kEffectiveRadius:
      return b.effective_radius[k];
    case kSmallerRadius:
      return std::min(b.radius_i[k], b.radius_j[k]);
    case kLargerRadius:
      return std::max(b.radius_i[k], b.radius_j[k]);
    case kEffectiveMass:
      return b.mixed ? b.effective_mass[k]
                     : EffectiveMass(grains_, b.mass_factor, b.radius_i[k], b.radius_j[k]);
    case kMeanStress:
      return stage_->mean_stress;
    case kDeviatoricStress:
      return stage_->deviatoric_stress;
    case kAxialStrain:
      return stage_->axial_strain;
    case kVolumetricStrain:
      return stage_->volumetric_strain;
    case kPorosity:
      return stage_->porosity;
    case kQuantities:
      break;
  }
  return parameters_[static_cast<std::size_t>(quantity - kQuantities)];
}

void FormulaKernel::Fill(const ContactBlock& b, int first, int k, double* row) const {
  for (const int quantity : formula_.used()) *row++ = ValueAt(quantity, b, first, k);
}

double FormulaKernel::Shifted(const double* row, double overlap, double force, double closing,
                              double sliding) const {
  std::array<double, kMostNames> moved{};
  std::copy_n(row, formula_.used().size(), moved.begin());
  for (std::size_t v = 0; v < formula_.used().size(); ++v) {
    const int quantity = formula_.used()[v];
    moved[v] += quantity == kOverlap           ? overlap
                : quantity == kNormalForce     ? force
                : quantity == kClosingVelocity ? closing
                : quantity == kSlidingVelocity ? sliding
                                               : 0.0;
  }
  double value = 0;
  formula_.Evaluate(moved.data(), 1, &value);
  return value;
}

/// What the explicit step must follow: the largest slopes of the force with overlap and velocity.
void FormulaKernel::AddSlopes(ContactBlock& b, int k, const double* row, double value) const {
  const double force = b.normal_force[k];
  const double stiffness = b.normal_stiffness[k];
  const bool scales = effect_.action == FormulaAction::kScales;
  const double sign = effect_.target == "attraction" ? -1.0 : (scales ? force : 1.0);
  double steepest = 0;
  double damping = 0;
  double across = 0;
  for (const double side : {1.0, -1.0}) {
    const double h = side * kOverlapStep * b.overlap[k];
    if (StageOf(effect_) == ContactStage::kNormalExtra && b.overlap[k] > 0) {
      const double moved = Shifted(row, h, stiffness * h, 0, 0);
      // Written so that a formula that does nothing changes no bit.
      steepest =
          std::max(steepest, stiffness * (scales ? moved : 1.0) + sign * ((moved - value) / h));
      const double v =
          side * std::max(kVelocityStep * std::abs(b.normal_velocity[k]), kLeastVelocity);
      damping = std::max(damping, sign * ((Shifted(row, 0, 0, v, 0) - value) / v));
    }
  }
  if (effect_.target == "shear_force") {
    for (const double v : {kLeastVelocity, 1e3 * kLeastVelocity}) {
      across = std::max(across, (Shifted(row, 0, 0, 0, v) - value) / v);
    }
  }
  if (std::isfinite(steepest)) b.normal_stiffness[k] = std::max(stiffness, steepest);
  if (std::isfinite(damping)) b.normal_damping[k] += damping;
  if (std::isfinite(across)) b.tangential_damping[k] += across;
}

void FormulaKernel::Act(ContactBlock& b, int k, double value) const {
  if (effect_.action == FormulaAction::kScales) {
    if (effect_.target == "normal_force") {
      b.normal_force[k] *= value;
    } else {
      b.sliding_limit[k] *= std::max(value, 0.0);
    }
  } else if (effect_.target == "shear_force") {
    const double slip = SlipOf(b, k);
    if (!(slip > 0) || value == 0) return;
    const double x = b.fx[k] - value * (b.slip_x[k] / slip);
    const double y = b.fy[k] - value * (b.slip_y[k] / slip);
    const double z = b.fz[k] - value * (b.slip_z[k] / slip);
    const double size = std::sqrt(x * x + y * y + z * z);
    const double cut = size > b.sliding_limit[k] ? b.sliding_limit[k] / size : 1.0;
    b.fx[k] = cut * x;
    b.fy[k] = cut * y;
    b.fz[k] = cut * z;
  } else if (effect_.target == "attraction") {
    b.normal_force[k] -= value;
    b.attraction[k] += value;
  } else {
    b.normal_force[k] += value;
  }
}

void FormulaKernel::Report(const ContactBlock& b, int k, const double* row, double value) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (fault_ && std::pair(fault_->wall, fault_->pair) <= std::pair(b.wall, b.pair[k])) return;
  const std::vector<std::string> names = FormulaNames(effect_);
  std::string what =
      absl::StrCat("effect ", effect_.info.name, ": ", effect_.formula, " is ", value, " at ");
  for (std::size_t v = 0; v < formula_.used().size(); ++v) {
    absl::StrAppend(&what, v > 0 ? ", " : "", names[static_cast<std::size_t>(formula_.used()[v])],
                    " = ", row[v]);
  }
  fault_ = ContactFault{.wall = b.wall, .pair = b.pair[k], .what = what};
}

void FormulaKernel::Apply(ContactBlock& b, int first) const {
  if (remembers_) {
    for (int k = 0; k < kBlock; ++k) b.history[first][k] += SlipOf(b, k);
  }
  if (viscous_ && b.viscous == 0) return;
  const int lanes = std::max(b.count, 1);  // without a count the first lane is asked for
  const std::size_t width = formula_.used().size();
  std::array<double, static_cast<std::size_t>(kBlock) * kMostNames> rows;
  std::array<double, kBlock> values;
  for (int k = 0; k < lanes; ++k) {
    Fill(b, first, k, rows.data() + static_cast<std::size_t>(k) * width);
  }
  formula_.Evaluate(rows.data(), lanes, values.data());
  for (int k = 0; k < lanes; ++k) {
    const double* const row = rows.data() + static_cast<std::size_t>(k) * width;
    double value = values[static_cast<std::size_t>(k)];
    if (!std::isfinite(value)) {
      const bool acts = b.overlap[k] > 0 || b.holds[k] > 0;
      if (b.count > 0 && b.dt > 0 && acts) Report(b, k, row, value);
      value = neutral_;
    } else if (b.dt == 0) {
      AddSlopes(b, k, row, value);
    }
    Act(b, k, value);
  }
}

std::optional<ContactFault> FormulaKernel::Fault() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return fault_;
}

}  // namespace calib::dem
