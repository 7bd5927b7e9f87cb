#pragma once
// The formula of a user's effect as a kernel of the contact chain.

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "dem/contact/contact_kernel.h"
#include "dem/contact/grain_mass.h"
#include "dem/formula/formula.h"
#include "dem/formula/user_effect.h"

namespace calib::dem {

/// Values of StageQuantities(), in their order. Written between steps by whoever drives the
/// specimen.
struct StageState {
  double mean_stress = 0, deviatoric_stress = 0;   ///< [Pa]
  double axial_strain = 0, volumetric_strain = 0;  ///< [-]
  double porosity = 0;                             ///< [-]
};

/// Where a formula gave no finite number.
struct ContactFault {
  bool wall = false;
  int pair = 0;      ///< ContactBlock::pair
  std::string what;  ///< effect, formula and the values it had
};

/// Stage at which a contact formula acts.
ContactStage StageOf(const UserEffect& effect);

/// A value that is not finite is never used: the contact goes on as without the effect, and the
/// first such contact (of the smallest pair) is kept until somebody asks for it. So is the time
/// step kept stable: with block.dt = 0 the slopes of the formula with overlap and velocity join
/// stiffness and damping. Thread-safe.
class FormulaKernel final : public ContactKernel {
 public:
  /// Precondition: UserEffectProblems() finds nothing. stage: may be null where !NeedsStage().
  FormulaKernel(const UserEffect& effect, const ParameterSet& parameters, const GrainMass& grains,
                std::shared_ptr<const StageState> stage);

  [[nodiscard]] int HistorySize() const override { return remembers_ ? 1 : 0; }
  void Apply(ContactBlock& block, int first) const override;

  [[nodiscard]] std::optional<ContactFault> Fault() const;

 private:
  void Fill(const ContactBlock& block, int first, int k, double* row) const;
  [[nodiscard]] double ValueAt(int quantity, const ContactBlock& block, int first, int k) const;
  [[nodiscard]] double Shifted(const double* row, double overlap, double force, double closing,
                               double sliding) const;
  void AddSlopes(ContactBlock& block, int k, const double* row, double value) const;
  void Act(ContactBlock& block, int k, double value) const;
  void Report(const ContactBlock& block, int k, const double* row, double value) const;

  UserEffect effect_;
  Formula formula_;
  std::vector<double> parameters_;  ///< in the order of the effect
  GrainMass grains_;
  std::shared_ptr<const StageState> stage_;
  bool viscous_ = false;
  bool remembers_ = false;  ///< the sliding distance
  double neutral_ = 0;
  mutable std::mutex mutex_;
  mutable std::optional<ContactFault> fault_;
};

}  // namespace calib::dem
