#pragma once
// `initial_density`: a specimen of another density than assumed.

#include "dem/catalog/registry.h"

namespace calib::dem {

/// Porosity at the start of loading is lower by `densification` than consolidation as asked for
/// would make it: a porosity that is asked for is shifted, otherwise friction is lowered at the
/// consolidation pressure (and restored) until the shifted porosity holds, within 1e-4. Looser
/// (below zero) is possible where consolidation asks for a porosity or for less friction than the
/// model's own; where it is not, the run has diverged, with the attainable range as the reason.
/// Two-sided, vanishes at 0. [Cheng 2018, sec. 2.2, on the procedure]
EffectEntry InitialDensity();

}  // namespace calib::dem
