#pragma once
// Units of a formula, before it is ever evaluated: whether what is added, compared and returned
// measures the same thing.

#include <map>
#include <string>

#include "server/campaign/file/text/quantity.h"

namespace calib::campaign {

struct FormulaUnits {
  std::string problem;    ///< a sentence that names the mismatch; empty: the formula is sound
  int position = 0;       ///< 1-based character at which the problem is
  Dimension dimension;    ///< dimension of what the formula gives
  bool anything = false;  ///< a bare 0 (or infinite) fits every unit
};

/// Reads the formula and follows units through + - * / ^, comparisons, conditions and functions
/// (dem/formula/formula.h). names: dimension of every quantity and parameter. Rules: both sides of
/// + - and of a comparison, the arguments of min and max, and both outcomes of a condition measure
/// the same; exponents, and arguments of exp, log, sin, cos, tanh, have none; something with a unit
/// is raised to plain numbers only. The number 0 has any unit. Syntax and unknown names are
/// problems too.
FormulaUnits UnitsOf(const std::string& formula, const std::map<std::string, Dimension>& names);

}  // namespace calib::campaign
