#pragma once
// The runs of a test that a campaign does not have, on a server: a design of that test alone.

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/proposed_test.h"
#include "server/diagnosis/run_maker.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A test as an entry of `experiments`, and the file that its data are in.
struct TestEntry {
  campaign::YamlNode entry{};
  std::string file{}, data{};
};

/// Of a test that no design of the base has. Not thread-safe.
class ProposedRuns {
 public:
  /// Finds or submits the design; runs nothing. What is pointed to outlives it. Errors:
  /// INVALID_ARGUMENT for an entry that is no test of a campaign; those of the laboratory.
  static absl::StatusOr<ProposedRuns> Open(client::Laboratory& laboratory,
                                           const report::CampaignView& base,
                                           const AnsweredDesign& answered,
                                           const LeadingModels& leading, const TestEntry& test);

  /// Makes the rows of RowsOfTest, and the second number of them where the first do not hold, and
  /// learns from them. Errors: those of the runs and of LearnTest.
  absl::StatusOr<KnownTest> Learn();
  /// Fresh runs of these models, which end the design. known: as Learn() gave it. Errors: those of
  /// the runs.
  absl::StatusOr<std::map<std::string, double>> Verify(const KnownTest& known,
                                                       const std::vector<VerifiedModel>& models);
  std::string campaign() const { return maker_.design().status.campaign(); }
  std::int64_t runs() const;  ///< so far

 private:
  ProposedRuns(const AnsweredDesign& answered, const LeadingModels& leading, ServerRunMaker maker)
      : answered_(&answered), leading_(&leading), maker_(std::move(maker)) {}

  const AnsweredDesign* answered_;
  const LeadingModels* leading_;
  ServerRunMaker maker_;
};

}  // namespace calib::diagnosis
