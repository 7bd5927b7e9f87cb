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

/// Names that would be given, and how many models may be verified: siblings from a probability on.
struct VerificationQuestion {
  std::vector<std::string> named{};
  int most = 3;
  double sibling = 0.01;
};
/// The most probable model that has all that would be named, at the draw of its posterior that the
/// measurement is most probable at; then, most probable first, models of no more effects that lack
/// one of them. None: nothing would be named.
std::vector<VerifiedModel> ModelsToVerify(const Knowledge& knowledge, const Asked& asked,
                                          const VerificationQuestion& question);

/// For each effect of the models the smallest chance of the fresh runs of a model that has it
/// (inference::VerificationChance). base: of the tests that were run; knowledge: of them, without
/// these runs. runs: `each` of every model in their order; those that did not come to their ends
/// are left out, and where none came the chance is 0.
std::map<std::string, double> ChancesOf(const BaseRuns& base, const Knowledge& knowledge,
                                        const std::vector<VerifiedModel>& models,
                                        const EndedBatch& runs, int each);

}  // namespace calib::diagnosis
