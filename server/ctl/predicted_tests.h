#pragma once
// The tests that `calibctl predict` is asked for: a campaign file, one experiment, or a control
// path.

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/client/client.h"
#include "server/report/views/campaign_view.h"

namespace calib::ctl {

/// A label of a parameter per experiment or batch that no experiment of the campaign has.
struct UnseenLabel {
  std::size_t population = 0;  ///< index in Campaign::populations
  std::string label;
};

/// The tests to predict as a list of experiments, with the files they name.
struct PredictedTests {
  std::vector<campaign::YamlNode> experiments;
  std::map<std::string, std::string> files;        ///< path as written -> content
  std::map<std::string, std::string> observables;  ///< that any of the tests has, and SI units
  std::vector<UnseenLabel> unseen;
};

/// Gives an experiment without `packing` that of another one, with its `realizations` and, where it
/// has no `materials`, the mixture of its grains; not the materials of walls and other bodies,
/// which are of the other test. Nothing where the test makes its bodies from its settings.
void TakeSpecimen(const campaign::YamlNode& from, campaign::YamlNode& experiment);

/// Reads a file that holds `experiments:` (the rest of it is passed over) or is one experiment;
/// one without a name is called predicted, of several predicted_1, ... A
/// test without data is given by `control: {column: NAME, to: VALUE, readings: N}`: that many
/// readings, evenly spaced. Without `packing` a test takes the specimen of the parent's first
/// experiment (TakeSpecimen). Errors: INVALID_ARGUMENT, a line per problem.
absl::StatusOr<PredictedTests> ReadTests(client::Client& client, const std::string& path,
                                         const report::CampaignView& parent);

}  // namespace calib::ctl
