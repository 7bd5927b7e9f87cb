#pragma once
// What a contact law or a contact effect is to the engine: a pure function over blocks of contacts.

#include <memory>
#include <string>

#include "dem/contact/contact_block.h"
#include "dem/model/effect.h"
#include "dem/model/parameter_set.h"

namespace calib::dem {

/// One kernel of the chain that a block of contacts passes. Immutable after construction;
/// thread-safe: one instance serves all threads.
class ContactKernel {
 public:
  ContactKernel() = default;
  ContactKernel(const ContactKernel&) = delete;
  ContactKernel& operator=(const ContactKernel&) = delete;
  virtual ~ContactKernel() = default;

  /// Doubles that each contact remembers for this kernel between steps; zero when a contact forms.
  [[nodiscard]] virtual int HistorySize() const { return 0; }

  /// Largest gap between surfaces at which a contact, once formed, may go on acting, for grains up
  /// to this radius [m]; there the kernel sets block.holds or lets the contact open. Contacts form
  /// on touching only.
  [[nodiscard]] virtual double Reach(double /*largest_radius*/) const { return 0; }

  /// Largest factor by which what contacts remember may stiffen the normal force beyond what Apply
  /// tells of an empty memory; bounds the step of contacts that are about to form.
  [[nodiscard]] virtual double Stiffening() const { return 1; }

  /// Acts on all kBlock lanes. `first` is the kernel's first history column. With block.dt = 0
  /// increments vanish and the call only evaluates: the engine uses it to read stiffnesses.
  virtual void Apply(ContactBlock& block, int first) const = 0;
};

class Materials;  // contact/materials.h

/// What a law or an effect may know when it is made: its own parameters and the law it joins.
struct KernelContext {
  bool linear_springs = false;  ///< trait of the contact law: ContactInfo::linear_springs
  std::string effect = {};      ///< name of the effect; empty: the kernel is the law's own
  double density = 0;           ///< of the grains [kg/m^3]
  double thickness = 0;         ///< of disks [m]; 0: the grains are spheres
  ParameterSet law;             ///< parameters of the law, defaults filled in
  ParameterSet parameters;  ///< of the effect, without its prefix, or of the law where the kernel
                            ///< is the law's own, defaults filled in
  const Materials* materials =
      nullptr;  ///< lives while the kernel is made; null: there is one material
};

}  // namespace calib::dem
