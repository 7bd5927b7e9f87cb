#pragma once
// A physical effect as data: its catalogue entry, the ways to turn it up from nothing, and what it
// sets where it acts.

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dem/model/lab_test.h"
#include "dem/model/parameter.h"
#include "dem/model/parameter_set.h"
#include "dem/model/rig.h"

namespace calib::dem {

/// One way to turn an effect up from nothing: a parameter leaves its null while others are held.
struct StrengthRay {
  std::string parameter;                 ///< undotted; has a null value
  std::array<double, 2> steps = {0, 0};  ///< two moderate distances from the null, none of them 0,
                                         ///< the nearer first, in units of the parameter's scale:
                                         ///< > 0 in the catalogue, of either sign in a user's
                                         ///< effect; of a two-sided effect -steps are as good where
                                         ///< they are admissible
  std::map<std::string, double> held = {};  ///< other parameters / scale; not listed: their default
  /// What it changes grows with this power of the distance from the null, about; > 0.
  double order = 1;
};

/// Catalogue entry of an effect.
struct EffectInfo {
  std::string name;
  /// "contact" | "particle" | "initial_state" | "boundary" | "measurement"; "held": not of this
  /// engine, but of runs that another code made.
  std::string kind;
  std::string
      description;  ///< formula, sign (one- or two-sided) and the value at which it vanishes
  std::vector<std::string> contacts;  ///< contact laws it can join; empty: all
  std::vector<ParameterInfo> parameters;
  std::string reference;  ///< paper and equations
  /// A word that effects share which act alike, so that curves that show one may as well show
  /// another; empty: none. `adhesion`: grains pull at each other; `rotation`: they turn less
  /// easily; `strain_reading`: strain is read that the specimen does not have.
  std::string family = {};
  bool two_sided = false;              ///< parameters of the rays may leave their null either way
  std::vector<StrengthRay> rays = {};  ///< 1 .. 3, for paired runs with and without the effect
  std::vector<std::string> excited_by = {};  ///< tests whose curves it can change; empty: all
  /// Shows only where pressure differs: between tests at one pressure each, or in any other.
  bool across_pressures = false;
  bool needs_motion = false;  ///< shows only where grains move while they are read: not in staged
                              ///< tests, whose readings are taken at rest
  bool needs_space = false;   ///< shows only where grains move in three dimensions: not in a plane
                              ///< silo
  std::vector<std::string> excludes = {};  ///< other laws of the same thing: never both
  bool makes_clumps = false;               ///< turns every grain, a single sphere, into a clump
  bool breaks_grains =
      false;  ///< single spheres break into smaller ones, in the periodic cell only
  /// Knows one material only: what a model with several does instead, "" where there is nothing.
  std::optional<std::string> one_material = {};
};

/// Whether `a` names `b` among its `excludes` or `b` names `a`: the two may not act together.
bool Exclude(const EffectInfo& a, const EffectInfo& b);

/// Parameters by dotted name, with SI values, that turn `effect` on at a distance `step` (in units
/// of scale) from the null of a ray; step 0: the model without the effect, bit for bit. Add the
/// effect's name to Model::effects and these to Model::parameters. Parameters at their default are
/// left out. The value may leave [min, max] for steps other than the ray's own; RayAdmits() tells.
std::map<std::string, double> ParametersOnRay(const EffectInfo& effect, const StrengthRay& ray,
                                              double step, const std::string& contact,
                                              const ReferenceState& state);

/// Whether the value that ParametersOnRay() gives to the ray's parameter at distance `step` (in
/// units of its scale) from its null lies in the parameter's admissible range.
bool RayAdmits(const EffectInfo& effect, const StrengthRay& ray, double step,
               const std::string& contact, const ReferenceState& state);

/// The stages through which a block of contacts passes the kernels of a model, in this order.
enum class ContactStage {
  kNormal,        ///< sets normal_force, normal_stiffness, tangential_stiffness
  kNormalExtra,   ///< adds to the normal force (adhesion, viscosity, plasticity)
  kSlidingLimit,  ///< sets or changes sliding_limit
  kTangential,    ///< integrates the shear force
  kShearExtra,    ///< adds to the shear force (viscosity)
  kMoment,        ///< adds moments
};

class ContactKernel;   // contact/contact_kernel.h
struct KernelContext;  // contact/contact_kernel.h
/// Makes one kernel from the parameters in `context`; never null.
using MakeKernel = std::unique_ptr<ContactKernel> (*)(const KernelContext& context);

/// One kernel of an effect and where in the chain it acts.
struct EffectKernel {
  ContactStage stage = ContactStage::kMoment;
  MakeKernel make = nullptr;
};

/// How the specimen and its initial state differ from packing and consolidation as asked for.
struct Preparation {
  double densification = 0;      ///< fall of porosity [-]
  double stress_anisotropy = 0;  ///< q/p during consolidation [-]
  double aspect = 1;             ///< length over width of the grains; 1: as they are [-]
  double weakness = 0;  ///< CrushingLaw::weakness (dynamics/crushing.h) [1/Pa]; 0: none crush
  double weibull_modulus = 3;        ///< CrushingLaw::weibull_modulus [-] > 0
  double reference_diameter = 1e-3;  ///< CrushingLaw::reference_diameter [m] > 0
  double size_loss = 0;              ///< CrushingLaw::size_loss [-], 0 .. 1
};

/// What distinguishes contacts with walls from those between grains.
struct WallProperties {
  double friction_ratio = 1;       ///< tan(phi_w)/tan(phi_mu) [-]
  std::optional<double> friction;  ///< tan(phi_w) itself, in place of the ratio [-]
};

/// An effect as the registry holds it: catalogue entry and what it does. It acts between grains
/// (kernels), at walls (bound), on the readings (alter) or on the initial state (prepare), and sets
/// the members for that; the others stay empty.
struct EffectEntry {
  EffectInfo info;
  int place = 1000;  ///< effects of one stage act, and all are listed, in this order, then by name
  /// Whether the effect can change the curves of a test, by the test's traits; null: of every test.
  /// The registry writes the names of those tests into info.excited_by.
  bool (*shows_in)(const TestInfo& test) = nullptr;
  std::vector<EffectKernel> kernels = {};  ///< of effects at contacts
  /// Sets the apparatus through which readings are taken.
  void (*alter)(const ParameterSet& parameters, Apparatus& apparatus) = nullptr;
  /// Sets how the specimen is prepared.
  void (*prepare)(const ParameterSet& parameters, Preparation& preparation) = nullptr;
  /// Sets what holds at walls.
  void (*bound)(const ParameterSet& parameters, WallProperties& walls) = nullptr;
};

}  // namespace calib::dem
