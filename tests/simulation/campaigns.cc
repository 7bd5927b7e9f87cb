#include "tests/simulation/campaigns.h"

#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/planning/posterior_record.h"
#include "tests/support/smooth_curve.h"

namespace calib::simulation {
namespace {

std::string BytesOf(const std::vector<double>& values) {
  std::string bytes(values.size() * sizeof(double), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// Of a campaign in which some runs fail and some diverge, told by this density.
constexpr double kWithBadRuns = 2651;

std::vector<SimulatedCampaign> MakeCampaigns() {
  using testing::MakeSmallCampaign;
  std::vector<SimulatedCampaign> all;
  const std::string plain = "  replicates: 0\n";
  all.push_back({.name = "filter",
                 .files = MakeSmallCampaign({.samples = 6, .inference = plain}),
                 .often = 4});
  all.push_back(
      {.name = "filter_validated",
       .files = MakeSmallCampaign(
           {.samples = 6, .max_iterations = 3, .with_validation = true, .inference = plain}),
       .often = 3});
  all.push_back(
      {.name = "two_tests",
       .files = MakeSmallCampaign({.samples = 5, .with_second = true, .inference = plain}),
       .often = 3});
  SimulatedCampaign bad{
      .name = "bad_runs",
      .files = MakeSmallCampaign({.samples = 8, .failure_attempts = 2, .inference = plain}),
      .often = 3};
  bad.files.yaml.replace(bad.files.yaml.find("2650"), 4, "2651");
  all.push_back(bad);
  all.push_back({.name = "twins",
                 .files = MakeSmallCampaign({.samples = 6, .inference = "  replicates: 3\n"}),
                 .often = 2});
  all.push_back(
      {.name = "packings",
       .files = MakeSmallCampaign({.samples = 6, .packings = 2, .inference = "  replicates: 2\n"}),
       .often = 2});
  all.push_back({.name = "sqmc",
                 .files = MakeSmallCampaign(
                     {.samples = 8, .max_iterations = 1, .method = "sqmc", .inference = plain}),
                 .often = 2});
  all.push_back({.name = "stopped_early",
                 .files = MakeSmallCampaign({.samples = 16,
                                             .load_steps = 8,
                                             .relative_noise = 0.03,
                                             .with_second = true,
                                             .inference = plain,
                                             .extra = "early_stopping: {discard_at_most: 1e-3}\n"}),
                 .often = 2,
                 .goes_on = true});
  all.push_back({.name = "rungs",
                 .files = MakeSmallCampaign(
                     {.samples = 12,
                      .load_steps = 8,
                      .relative_noise = 0.03,
                      .inference = plain,
                      .extra = "early_stopping: {discard_at_most: 1e-3, rungs: [0.25, 0.5]}\n"}),
                 .often = 3,
                 .goes_on = true});
  all.push_back(
      {.name = "tmcmc",
       .files = MakeSmallCampaign(
           {.samples = 20, .max_iterations = 3, .method = "tmcmc", .inference = "  steps: 2\n"}),
       .often = 2});
  all.push_back({.name = "surrogate",
                 .files = MakeSmallCampaign({.samples = 5,
                                             .max_iterations = 2,
                                             .relative_noise = 0.02,
                                             .method = "surrogate_msrs",
                                             .inference = plain}),
                 .often = 1});
  all.push_back(
      {.name = "adaptive",
       .files = MakeSmallCampaign({.samples = 0,
                                   .relative_noise = 0.02,
                                   .method = "adaptive_emulator",
                                   .inference = "  max_runs: 38\n  asynchronous: true\n"}),
       .often = 1});
  return all;
}

}  // namespace

const std::vector<SimulatedCampaign>& Campaigns() {
  static const std::vector<SimulatedCampaign> all = MakeCampaigns();
  return all;
}

RunEnd EndOf(const v1::AttemptSpec& spec) {
  if (spec.density() != kWithBadRuns) return {};
  const auto bits = std::bit_cast<std::uint64_t>(spec.parameters().at("friction_angle"));
  switch ((bits * 0x9E3779B97F4A7C15U) >> 61) {
    case 0:
      return {
          .outcome = v1::Finished::OUTCOME_MODEL_FAILED, .after = 2, .reason = "ended by SIGSEGV"};
    case 1:
      return {.outcome = v1::Finished::OUTCOME_DIVERGED, .after = 1, .reason = "grains overlap"};
    default:
      return {};
  }
}

v1::State StateOf(const v1::AttemptSpec& spec, int load_step) {
  const double value = testing::SmoothCurve(spec, load_step, 0.02, 0.005);
  v1::State state;
  state.set_load_step(load_step);
  const std::size_t width = dem::FindTest(spec.test())->observables.size();
  for (std::size_t k = 0; k < width; ++k) state.add_values(value);
  return state;
}

absl::StatusOr<std::string> Fingerprint(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  const store::CampaignProgress& progress = record.progress;
  std::string text = absl::StrCat(ToString(progress.state), " ", ToString(progress.phase), " ",
                                  progress.iteration, " ", progress.converged, "\n");
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign));
  for (const store::IterationRecord& iteration : iterations) {
    absl::StrAppend(&text, "proposal ", iteration.proposal, "\n");
    if (!iteration.posterior.has_value()) continue;
    ASSIGN_OR_RETURN(v1::Posterior posterior, planning::PosteriorFromJson(*iteration.posterior));
    posterior.clear_model_evaluations();
    posterior.clear_campaign();
    absl::StrAppend(&text, "posterior ", planning::PosteriorToJson(posterior), "\n");
  }
  ASSIGN_OR_RETURN(const auto samples, reader.Samples(campaign));
  for (const store::SampleRecord& sample : samples) {
    absl::StrAppend(&text, sample.sample, " ", BytesOf(sample.parameters),
                    BytesOf({sample.log_weight, sample.log_likelihood}), "\n");
  }
  ASSIGN_OR_RETURN(const auto evaluations, reader.Evaluations(campaign));
  for (const store::EvaluationRecord& evaluation : evaluations) {
    absl::StrAppend(&text, ToString(evaluation.status), " ", evaluation.reason, "\n");
  }
  ASSIGN_OR_RETURN(const auto states, reader.States(campaign));
  for (const store::StateRecord& state : states) {
    absl::StrAppend(&text, state.key.sample, " ", state.key.experiment, " ", state.load_step, " ",
                    BytesOf(state.observables), "\n");
  }
  return text;
}

}  // namespace calib::simulation
