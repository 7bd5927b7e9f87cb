#pragma once
// Which parameters a model has, by its contact law, its effects, its materials and pairs of
// materials, and what of these cannot be together.

#include <string>
#include <vector>

#include "dem/model/scenario.h"
#include "dem/registry/catalog.h"

namespace calib::dem {

/// The parameter of a model by its dotted campaign name, those of its effects and materials
/// included, or nullptr when the model has none of that name.
const ParameterInfo* FindParameter(const Model& model, const std::string& dotted_name);

/// Whether a material may have this name: letters, digits and _.
bool IsMaterialName(const std::string& name);

/// Dotted names that the model's materials and pairs of them may give values to; pairs once, in the
/// order in which the materials are named.
std::vector<std::string> MaterialParameters(const Model& model);

/// Everything wrong with the names and values of the model's materials, one sentence each.
std::vector<std::string> MaterialProblems(const Model& model);

/// Everything wrong with the model's effects that know single spheres only, one sentence each.
/// clumps: whether the packing has clumps.
std::vector<std::string> ShapeProblems(const Model& model, bool clumps);

}  // namespace calib::dem
