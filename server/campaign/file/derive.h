#pragma once
// The text of a campaign that follows from another one: the same experiments, model and settings,
// with what is said here changed. Pure: the same parent and changes give the same text, by which it
// is recognised when it is asked for again. However many runs diverge, it is not paused. An
// extension gets the samples that its method asks for with its parameters.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/model/scenario.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

struct Derivation {
  std::string name;
  Lineage lineage;
  std::vector<std::string> effects{};  ///< joined to the model, in addition to the parent's
  /// Parameters that are calibrated in addition (dotted names), with their priors in SI.
  std::map<std::string, dem::DefaultPrior> parameters{};
  bool held_out = true;                 ///< false: experiments with role validate are left out
  std::vector<YamlNode> experiments{};  ///< in the place of the parent's, if there are any
  /// Of parameters with `per`: labels of these experiments that the parent lacks have a value of
  /// their own; false: they have the common one.
  bool new_labels = false;
  std::optional<std::string> method{};  ///< the keys of the parent's stay: of the same family
  std::optional<int> samples{}, max_iterations{};
  std::optional<FirstProposal> first_proposal{};
  std::optional<std::int64_t> model_evaluations{};  ///< its budget; not of a table or design
  /// Makes it a table, or gives a design its first batch: parameter values by name, and whose
  /// specimen and seed they take.
  struct Row {
    int like = 0;
    std::map<std::string, double> values{};
  };
  std::vector<Row> rows{};
  /// Makes it a design with these effects to race; their parameters and those of the numerics are
  /// among `parameters`.
  std::optional<std::vector<std::string>> race{};
};

/// INVALID_ARGUMENT when the parent's text cannot be read; whether the result is a valid campaign
/// is seen when it is read.
absl::StatusOr<std::string> Derive(const MethodList& methods, const std::string& parent_yaml,
                                   const Derivation& derivation);

}  // namespace calib::campaign
