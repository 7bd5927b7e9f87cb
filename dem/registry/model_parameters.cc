#include "dem/registry/model_parameters.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "dem/contact/common_parameters.h"
#include "dem/contact/materials.h"
#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"

namespace calib::dem {
namespace {

const ParameterInfo& Density() {
  static const ParameterInfo info = [] {
    ParameterInfo density;
    density.name = "density";
    density.unit = "kg/m^3";
    density.min_open = true;
    density.max = 1e9;
    density.default_prior = {.kind = "log_uniform", .min = 500, .max = 2e4};
    density.description = "of the material";
    return density;
  }();
  return info;
}

const ParameterInfo& PairFriction() {
  static const ParameterInfo info = [] {
    ParameterInfo friction = FrictionCoefficient();
    friction.alternative_to = "";
    friction.description = "coefficient tan(phi_mu) of friction between two materials";
    return friction;
  }();
  return info;
}

const ParameterInfo* Named(const std::vector<ParameterInfo>& infos, const std::string& name) {
  const auto it = std::find_if(infos.begin(), infos.end(),
                               [&](const ParameterInfo& info) { return info.name == name; });
  return it == infos.end() ? nullptr : &*it;
}

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// "A-A" and not "A-B".
bool OfEquals(const std::string& pair) {
  const std::size_t dash = pair.find('-');
  return pair.substr(0, dash) == pair.substr(dash + 1);
}

/// Of materials A and B as "A-B" or "B-A", or of A among its equals as "A-A".
const ParameterInfo* PairParameter(const Model& model, const std::string& pair,
                                   const std::string& name) {
  if (!IsMaterialPair(model, pair)) {
    return nullptr;
  }
  if (name.find('.') != std::string::npos) {
    const ParameterInfo* info = FindParameter(model.contact, model.effects, name);
    return info != nullptr && info->of_pairs ? info : nullptr;
  }
  if (OfEquals(pair)) {
    return nullptr;  // the material's own: A.friction_coefficient
  }
  if (name == "friction_coefficient") {
    return &PairFriction();
  }
  const ContactInfo* law = FindContact(model.contact);
  return name == "damping" && law != nullptr ? Named(law->parameters, name) : nullptr;
}

/// Names that PairParameter() may know.
std::vector<std::string> PairNames(const Model& model) {
  std::vector<std::string> names = {"friction_coefficient", "damping"};
  for (const std::string& effect : model.effects) {
    if (const EffectInfo* info = FindEffect(effect)) {
      for (const ParameterInfo& parameter : info->parameters) {
        if (parameter.of_pairs) {
          names.push_back(absl::StrCat(effect, ".", parameter.name));
        }
      }
    }
  }
  return names;
}

/// What is wrong with the values of two materials, or of one among its equals, whatever the order
/// in which each of them names the pair.
std::vector<std::string> PairProblems(const Model& model, const std::string& a,
                                      const std::string& b) {
  const auto given = [&](const std::string& name) {
    std::vector<std::string> dotted;
    for (const std::string& pair : {absl::StrCat(a, "-", b), absl::StrCat(b, "-", a)}) {
      if (const std::string full = absl::StrCat(pair, ".", name); model.parameters.contains(full)) {
        dotted.push_back(full);
      }
      if (a == b) {
        break;
      }
    }
    return dotted;
  };
  std::vector<std::string> problems;
  for (const std::string& name : PairNames(model)) {
    const std::vector<std::string> own = given(name);
    if (own.size() > 1) {
      problems.push_back(absl::StrCat(own[0], " and ", own[1], " are the same; give one of them"));
    }
    const ParameterInfo* info = PairParameter(model, absl::StrCat(a, "-", b), name);
    if (own.empty() || info == nullptr || info->alternative_to.empty()) {
      continue;
    }
    const std::vector<std::string> other =
        given(absl::StrCat(name.substr(0, name.rfind('.') + 1), info->alternative_to));
    if (!other.empty()) {
      problems.push_back(absl::StrCat(own[0], " and ", other[0],
                                      " are alternatives: only one of them may be given"));
    }
  }
  return problems;
}

}  // namespace

const ParameterInfo* FindParameter(const Model& model, const std::string& dotted_name) {
  if (const ParameterInfo* info =
          FindParameter(model.user_effects, model.contact, model.effects, dotted_name)) {
    return info;
  }
  const auto dot = dotted_name.find('.');
  if (dot == std::string::npos) {
    return nullptr;
  }
  const std::string prefix = dotted_name.substr(0, dot);
  const std::string name = dotted_name.substr(dot + 1);
  if (!Has(model.materials, prefix)) {
    return PairParameter(model, prefix, name);
  }
  if (name == "density") {
    return &Density();
  }
  const ContactInfo* law = FindContact(model.contact);
  return law == nullptr ? nullptr : Named(law->parameters, name);
}

bool IsMaterialName(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_';
  });
}

std::vector<std::string> MaterialParameters(const Model& model) {
  const ContactInfo* law = FindContact(model.contact);
  std::vector<std::string> dotted;
  for (const std::string& name : model.materials) {
    for (std::size_t p = 0; law != nullptr && p < law->parameters.size(); ++p) {
      dotted.push_back(absl::StrCat(name, ".", law->parameters[p].name));
    }
    dotted.push_back(absl::StrCat(name, ".density"));
  }
  const std::vector<std::string> names = MaterialNames(model);
  for (std::size_t a = 0; a < names.size(); ++a) {
    for (std::size_t b = a; b < names.size(); ++b) {
      const std::string pair = absl::StrCat(names[a], "-", names[b]);
      for (const std::string& name : PairNames(model)) {
        if (PairParameter(model, pair, name) != nullptr) {
          dotted.push_back(absl::StrCat(pair, ".", name));
        }
      }
    }
  }
  return dotted;
}

std::vector<std::string> MaterialProblems(const Model& model) {
  std::vector<std::string> problems;
  if (model.materials.size() > kMostMaterials) {
    problems.push_back(
        absl::StrCat(model.materials.size(), " materials, allowed are at most ", kMostMaterials));
  }
  for (std::size_t m = 0; m < model.materials.size(); ++m) {
    const std::string& name = model.materials[m];
    if (!IsMaterialName(name)) {
      problems.push_back(
          absl::StrCat("material \"", name, "\": a name has letters, digits and _ only"));
    } else if (name == kOwnMaterial) {
      problems.push_back(absl::StrCat("material ", name,
                                      " is the model's own, whose values stand with the model; "
                                      "name others"));
    } else if (FindEffect(model.user_effects, name) != nullptr) {
      problems.push_back(
          absl::StrCat("material ", name, " has the name of an effect; call it something else"));
    } else if (std::find(model.materials.begin(),
                         model.materials.begin() + static_cast<std::ptrdiff_t>(m),
                         name) != model.materials.begin() + static_cast<std::ptrdiff_t>(m)) {
      problems.push_back(absl::StrCat("material ", name, " is named twice"));
    }
    const std::string angle = absl::StrCat(name, ".friction_angle");
    const std::string coefficient = absl::StrCat(name, ".friction_coefficient");
    if (model.parameters.contains(angle) && model.parameters.contains(coefficient)) {
      problems.push_back(absl::StrCat(coefficient, " and ", angle,
                                      " are alternatives: only one of them may be given"));
    }
  }
  if (model.materials.empty()) {
    return problems;
  }
  for (const std::string& name : model.effects) {
    const EffectInfo* effect = FindEffect(name);
    if (effect != nullptr && effect->one_material) {
      problems.push_back(
          absl::StrCat("effect ", name, " knows one material only; leave it out or model.materials",
                       effect->one_material->empty() ? "" : ": ", *effect->one_material));
    }
  }
  const std::vector<std::string> names = MaterialNames(model);
  for (std::size_t a = 0; a < names.size(); ++a) {
    for (std::size_t b = a; b < names.size(); ++b) {
      for (std::string& problem : PairProblems(model, names[a], names[b])) {
        problems.push_back(std::move(problem));
      }
    }
  }
  return problems;
}

std::vector<std::string> ShapeProblems(const Model& model, bool clumps) {
  std::vector<std::string> problems;
  std::string makes_clumps;
  std::string breaks_grains;
  for (const EffectInfo& effect : Effects()) {
    if (!Has(model.effects, effect.name) || !(effect.makes_clumps || effect.breaks_grains)) {
      continue;
    }
    (effect.makes_clumps ? makes_clumps : breaks_grains) = effect.name;
    if (clumps) {
      problems.push_back(absl::StrCat("effect ", effect.name,
                                      " needs a packing of single spheres (clump -1), this one has "
                                      "clumps"));
    }
  }
  if (!makes_clumps.empty() && !breaks_grains.empty()) {
    problems.push_back(absl::StrCat("effects ", makes_clumps, " and ", breaks_grains,
                                    " cannot act together: only spheres crush"));
  }
  return problems;
}

}  // namespace calib::dem
