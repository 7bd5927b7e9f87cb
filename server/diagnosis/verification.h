#pragma once
// Fresh runs at the optimum of what would be named: an emulator that is wrong there would name
// whatever its error looks like. Pure.

#include <map>
#include <string>
#include <vector>

#include "server/diagnosis/knowledge.h"

namespace calib::diagnosis {

/// A model that fresh runs are made for.
struct VerifiedModel {
  std::vector<std::string> effects{};  ///< names
  inference::DesignPoints optimum{};   ///< 1 point, of the kept entries
};

/// Names that would be given, and who is a sibling.
struct VerificationQuestion {
  std::vector<std::string> named{};
  /// Effects that act alike: a model with one of what would be named exchanged for another of its
  /// family is a sibling, however improbable. An emulator that has never been where the sibling
  /// would lie does not know how improbable it is.
  std::vector<std::vector<std::string>> families{};
  int most = 4;           ///< models that may be verified
  double sibling = 0.01;  ///< other models of no more effects are siblings from this probability on
};
/// The most probable model that has all that would be named, at the draw of its posterior that the
/// measurement is most probable at; then its siblings, which lack one of them: those of a family
/// first, then most probable first. None: nothing would be named.
std::vector<VerifiedModel> ModelsToVerify(const Knowledge& knowledge, const Asked& asked,
                                          const VerificationQuestion& question);

/// For each effect of the models the chance of the fresh runs of the first model that has it
/// (inference::VerificationChance): of what would be named its own. base: of the tests that were run; knowledge: of them, without
/// these runs. runs: `each` of every model in their order; those that did not come to their ends
/// are left out, and where none came the chance is 0.
std::map<std::string, double> ChancesOf(const BaseRuns& base, const Knowledge& knowledge,
                                        const std::vector<VerifiedModel>& models,
                                        const EndedBatch& runs, int each);

}  // namespace calib::diagnosis
