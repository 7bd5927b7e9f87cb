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

/// Immutable and shared between copies; thread-safe.
class ContactModel {
 public:
  /// entries: what the names of the model stand for; they are not kept. Precondition: ScenarioProblems() finds nothing
  /// wrong with the model. thickness: of disks [m]; 0: the grains are spheres.
  ContactModel(const Model& model, const ModelEntries& entries, double thickness = 0);

  /// Doubles that each contact remembers, <= kMaxHistory.
  [[nodiscard]] int history_size() const { return history_size_; }

  /// Largest gap at which a contact of grains up to this radius may still act [m].
  [[nodiscard]] double Reach(double largest_radius) const;

  /// Largest factor by which memories may stiffen a normal contact, >= 1.
  [[nodiscard]] double Stiffening() const;

  /// tan(phi_mu) of the model itself; consolidation may put another one into the block.
  [[nodiscard]] double sliding_friction() const { return sliding_friction_; }

  /// tan(phi_w) of contacts with walls.
  [[nodiscard]] double wall_friction() const { return wall_friction_; }

  /// null: the model has one material. Otherwise blocks need `mixed` and `materials`, at walls
  /// `friction`, too.
  [[nodiscard]] const Materials* materials() const { return materials_.get(); }

  /// Kinematics, every kernel in the order of ContactStage, totals. All inputs of the block are
  /// set; its history is read and updated.
  void Evaluate(ContactBlock& block) const;

  /// What EvaluateCommonChain() does in its place, where the chain is one of those.
  [[nodiscard]] const std::optional<CommonChain>& common() const { return common_; }

  /// Where a user's formula has given no finite number since the model was made.
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
  double sliding_friction_ = 0;
  double wall_friction_ = 0;
};

}  // namespace calib::dem
