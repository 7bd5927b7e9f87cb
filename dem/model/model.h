#pragma once
// Contact law, effects, materials and the values of their parameters: what all experiments of a campaign share.

#include <map>
#include <string>
#include <vector>

#include "dem/model/user_effect.h"

namespace calib::dem {

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
};

/// The model's own material, of everything that nobody says otherwise of.
inline constexpr const char* kOwnMaterial = "grains";

/// Materials that a model may have besides its own.
inline constexpr int kMostMaterials = 16;

/// The model's own material first, then its others in their order.
std::vector<std::string> MaterialNames(const Model& model);

/// Whether a name is "A-B" of two materials of the model, or "A-A" of one that is not its own.
bool IsMaterialPair(const Model& model, const std::string& name);

}  // namespace calib::dem
