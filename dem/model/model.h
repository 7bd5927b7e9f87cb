#pragma once
// Contact law, effects, materials and the values of their parameters: what all experiments of a
// campaign share.

#include <map>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

/// What becomes of an elastic shear force where its stiffness falls, as the normal force does.
enum class ShearUnloading {
  kAsPublished,  ///< it stays: closed cycles can give work [Cheng 2018, Eq. 2; YADE]
  kRescaled      ///< it falls along: no cycle gives work [Thornton et al. 2013; LIGGGHTS]
};

/// Contact law, effects and their parameters by dotted name ("young_modulus",
/// "rolling_resistance.stiffness").
struct Model {
  std::string contact;                       ///< a name of Contacts()
  std::vector<std::string> effects;          ///< names of Effects() or of user_effects
  double density = 2650;                     ///< of the grains [kg/m^3] > 0
  std::map<std::string, double> parameters;  ///< every parameter without a default must be present
  std::vector<UserEffect> user_effects{};    ///< declared; those that `effects` names act
  std::vector<std::string> materials{};      ///< besides the model's own, which is called `grains`;
                                             ///< their values are parameters (contact/materials.h)
  ShearUnloading shear_unloading = ShearUnloading::kAsPublished;
};

/// Name of the model's own material: whatever is not said to be of another material is of this one.
inline constexpr const char* kOwnMaterial = "grains";

/// Materials that a model may have besides its own [-]. Chosen: the table of pairs stays small, and
/// an index fits the byte that ParticleArrays::material has for it.
inline constexpr int kMostMaterials = 16;

/// Names of all materials of the model: kOwnMaterial, then Model::materials in their order.
std::vector<std::string> MaterialNames(const Model& model);

/// Whether a name is "A-B", A and B two materials of the model, or "A-A", A a material of the model
/// other than kOwnMaterial.
bool IsMaterialPair(const Model& model, const std::string& name);

}  // namespace calib::dem
