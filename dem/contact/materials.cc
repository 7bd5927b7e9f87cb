#include "dem/contact/materials.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/contact/common_parameters.h"
#include "dem/model/effect.h"

namespace calib::dem {

Materials::Materials(const Model& model, const ContactInfo& law, const ParameterSet& own,
                     double thickness)
    : names_(MaterialNames(model)),
      laws_{own},
      densities_{model.density},
      mass_units_{GrainMassOf(model.density, thickness).unit},
      depth_(GrainMassOf(model.density, thickness).depth),
      parameters_(model.parameters) {
  std::vector<double> friction = {SlidingFriction(model.parameters)};
  for (const std::string& name : model.materials) {
    std::map<std::string, double> values;
    for (const ParameterInfo& info : law.parameters) {
      const auto given = model.parameters.find(absl::StrCat(name, ".", info.name));
      if (given != model.parameters.end()) {
        values[info.name] = given->second;
      } else if (const auto value = own.Find(info.name);
                 value && info.name != "friction_angle" && info.name != "friction_coefficient") {
        values[info.name] = *value;
      }
    }
    const bool rubs = values.contains("friction_angle") || values.contains("friction_coefficient");
    friction.push_back(rubs ? SlidingFriction(values) : friction.front());
    laws_.emplace_back(std::move(values));
    const auto density = model.parameters.find(absl::StrCat(name, ".density"));
    densities_.push_back(density != model.parameters.end() ? density->second : model.density);
    mass_units_.push_back(GrainMassOf(densities_.back(), thickness).unit);
  }
  for (const double a : friction) {
    for (const double b : friction) {
      friction_.push_back(std::min(a, b));
    }
  }
  ApplyPairParameters("friction_coefficient", friction_);
}

int Materials::IndexOf(const std::string& name) const {
  if (name.empty()) {
    return 0;
  }
  const auto it = std::find(names_.begin(), names_.end(), name);
  assert(it != names_.end());
  return static_cast<int>(it - names_.begin());
}

std::optional<double> Materials::PairParameter(int a, int b, const std::string& name) const {
  const std::string& one = names_[static_cast<std::size_t>(a)];
  const std::string& other = names_[static_cast<std::size_t>(b)];
  for (const std::string& pair : {absl::StrCat(one, "-", other), absl::StrCat(other, "-", one)}) {
    const auto it = parameters_.find(absl::StrCat(pair, ".", name));
    if (it != parameters_.end()) {
      return it->second;
    }
  }
  return std::nullopt;
}

void Materials::ApplyPairParameters(const std::string& name, std::vector<double>& values) const {
  for (int a = 0; a < count(); ++a) {
    for (int b = 0; b < count(); ++b) {
      double& value = values[static_cast<std::size_t>(Pair(a, b))];
      value = PairParameter(a, b, name).value_or(value);
    }
  }
}

void Materials::Complete(ContactBlock& b) const {
  const double own = friction_[0];
  const double lowered = own > 0 ? b.sliding_friction / own : 1.0;
  b.mixed = true;
  for (int k = 0; k < kBlock; ++k) {
    const int i = b.materials[k] / count();
    const int j = b.wall ? i : b.materials[k] % count();  // a wall mirrors its grain
    if (!b.wall) {
      const double friction = friction_[static_cast<std::size_t>(b.materials[k])];
      b.friction[k] = friction == own ? b.sliding_friction : lowered * friction;
    }
    const double ui = mass_units_[static_cast<std::size_t>(i)];
    const double uj = mass_units_[static_cast<std::size_t>(j)];
    const double ri = b.radius_i[k];
    const double rj = b.radius_j[k];
    if (ui == uj) {
      b.effective_mass[k] = EffectiveMass({.unit = ui, .depth = depth_}, b.mass_factor, ri, rj);
    } else {
      const double mi = ui * ri * ri * (depth_ > 0 ? depth_ : ri);
      const double mj = uj * rj * rj * (depth_ > 0 ? depth_ : rj);
      b.effective_mass[k] = b.mass_factor * (mi * mj / (mi + mj));
    }
  }
}

std::vector<double> PairValues(const KernelContext& context, const std::string& parameter) {
  const double own = context.parameters.Get(parameter);
  if (context.materials == nullptr) {
    return {own};
  }
  std::vector<double> values(static_cast<std::size_t>(context.materials->pairs()), own);
  context.materials->ApplyPairParameters(absl::StrCat(context.effect, ".", parameter), values);
  return values;
}

}  // namespace calib::dem
