#pragma once
// The settings of one compared observable: {noise: {...}, weight: w}.

#include "server/campaign/file/laboratory_table.h"

namespace calib::campaign {

struct NoiseRules {
  std::string control;  ///< name of the control, which correlation lengths are measured in; empty:
                        ///< the reading's index
  bool noise_needed = true;  ///< false with ess_target and where nothing is inferred
  bool measured = true;      ///< false: readings are only predicted
};

/// Reads noise {relative, floor} | {absolute} | {column}, each with an optional correlation_length,
/// and weight, into `observable` (values known). node may be nullptr (nothing given) and table too
/// (file unreadable: only the keys are checked). raw: the readings in SI as the laboratory computed
/// them.
void ReadNoise(const MapReader& experiment, const std::string& name, const YamlNode* node,
               const NoiseRules& rules, const LaboratoryTable* table,
               const std::vector<double>& raw, ReadContext& context,
               MeasuredObservable& observable);

}  // namespace calib::campaign
