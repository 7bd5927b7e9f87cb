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

/// Values of StageQuantities(), in their order. Not thread-safe: whoever drives the specimen writes
/// them between steps, when no kernel runs.
struct StageState {
  double mean_stress = 0, deviatoric_stress = 0;   ///< [Pa]
  double axial_strain = 0, volumetric_strain = 0;  ///< [-]
  double porosity = 0;                             ///< [-]
};

/// A contact at which a formula gave no finite number.
struct ContactFault {
  bool wall = false;  ///< it is a contact with a wall
  int pair = 0;       ///< ContactBlock::pair
  std::string what;   ///< effect, formula and the values it had
};

/// Stage of the chain at which an effect of a user that is of kind "contact" acts.
ContactStage StageOf(const UserEffect& effect);

/// Kernel of a user's formula. A value that is not finite is never used: the contact goes on as
/// without the effect, and the first such contact (of the smallest pair) is what Fault() tells.
/// With block.dt = 0 the slopes of the formula with overlap and velocity join stiffness and
/// damping, so that the time step stays stable. Thread-safe, but for the StageState that it reads.
class FormulaKernel final : public ContactKernel {
 public:
  /// Precondition: UserEffectProblems() finds nothing. stage: null where
  /// NeedsStage() is false.
  FormulaKernel(const UserEffect& effect, const ParameterSet& parameters, const GrainMass& grains,
                std::shared_ptr<const StageState> stage);

  [[nodiscard]] int HistorySize() const override { return remembers_ ? 1 : 0; }
  void Apply(ContactBlock& block, int first) const override;

  /// The first contact, of the smallest pair, at which the formula gave no finite number, if any.
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
  bool remembers_ = false;  ///< contacts remember their sliding distance
  double neutral_ = 0;
  mutable std::mutex mutex_;
  mutable std::optional<ContactFault> fault_;
};

}  // namespace calib::dem
