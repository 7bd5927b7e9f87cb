#pragma once
// Which experiments can show which effects: what none of them shows keeps its prior, whatever is
// measured.

#include <string>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Whether the bodies of the experiment come from its settings, so that there is no packing whose
/// grains chance has placed.
bool MakesItsBodies(const Experiment& experiment);

/// Whether the test is walked in stages that end when the specimen has come to rest: it is in the
/// periodic cell and has no loading_rate.
bool ReadAtRest(const Experiment& experiment);

/// Whether a reading of the experiment can depend on the effect: it is one of the effect's tests, a
/// collision has the wall that an effect of kind "boundary" is about, one that needs motion is
/// not read at rest, one that needs space is not held in a plane. Whether the effect is in the
/// model is not asked.
bool CanShow(const Experiment& experiment, const dem::EffectInfo& effect);

/// Where an effect acts, to follow "it acts in": its tests, and what they need.
std::string WhereItActs(const dem::EffectInfo& effect);

/// One sentence for each effect of the model that none of the experiments (calibrating or held
/// out) can show though one of its parameters is calibrated, or though it is one of the grains'
/// shape or strength or of the specimen's preparation, fixed or not. None for a table or a
/// design, which infer nothing, and for a campaign derived from another, which was asked itself.
std::vector<std::string> EffectsWithoutPart(const Campaign& campaign);

}  // namespace calib::campaign
