#pragma once
// A contact law joined by its effects: the chain of kernels that every block of contacts passes.

#include <memory>
#include <optional>
#include <vector>

#include "dem/contact/contact_kernel.h"
#include "dem/contact/materials.h"
#include "dem/dynamics/common_chain.h"
#include "dem/formula/formula_kernel.h"
#include "dem/model/model.h"
#include "dem/model/model_entries.h"

namespace calib::dem {

/// The chain of kernels of one model. Immutable and shared between copies; thread-safe, but for
/// what stage() points to.
class ContactModel {
 public:
  /// entries: what the names of the model stand for; they are not kept. Precondition:
  /// ScenarioProblems() finds nothing wrong with the model. thickness: of disks [m]; 0: the grains
  /// are spheres.
  ContactModel(const Model& model, const ModelEntries& entries, double thickness = 0);

  /// Number of doubles that each contact remembers between steps, <= kMaxHistory.
  [[nodiscard]] int history_size() const { return history_size_; }

  /// First of the three doubles of a contact's memory that are the force of its shear spring on j
  /// [N], dashpots aside.
  [[nodiscard]] int shear_history() const { return shear_history_; }

  /// Largest gap at which a contact of grains up to this radius may still act [m].
  [[nodiscard]] double Reach(double largest_radius) const;

  /// Largest factor by which what contacts remember may stiffen their normal force [-] >= 1.
  [[nodiscard]] double Stiffening() const;

  /// tan(phi_mu) between grains of the model's own material [-]; consolidation may put another one
  /// into the block.
  [[nodiscard]] double sliding_friction() const { return sliding_friction_; }

  /// tan(phi_w) of contacts with walls [-].
  [[nodiscard]] double wall_friction() const { return wall_friction_; }

  /// The materials of the model; null: it has one material. Where it is not null, blocks need
  /// `mixed` and `materials`, and at walls `friction`, too.
  [[nodiscard]] const Materials* materials() const { return materials_.get(); }

  /// Computes kinematics, runs every kernel in the order of ContactStage and sums totals. Its
  /// history is read and updated. Precondition: all inputs of the block are set.
  void Evaluate(ContactBlock& block) const;

  /// The chain by which EvaluateCommonChain() can do the work of Evaluate(); empty: it cannot.
  [[nodiscard]] const std::optional<CommonChain>& common() const { return common_; }

  /// The contact at which a formula of a user has given no finite number since the model was made,
  /// if any.
  [[nodiscard]] std::optional<ContactFault> Fault() const;

  /// What user's formulas know of the specimen, to be kept up to date by whoever drives it; null:
  /// they ask for nothing. Shared between copies.
  [[nodiscard]] StageState* stage() const { return stage_.get(); }

 private:
  struct Link {
    std::shared_ptr<const ContactKernel> kernel;
    int first_history = 0;
  };
  std::vector<Link> chain_;
  std::optional<CommonChain> common_;
  std::vector<std::shared_ptr<const FormulaKernel>> formulas_;
  std::shared_ptr<StageState> stage_;
  std::shared_ptr<const Materials> materials_;
  int history_size_ = 0;
  int shear_history_ = 0;
  double sliding_friction_ = 0;
  double wall_friction_ = 0;
};

}  // namespace calib::dem
