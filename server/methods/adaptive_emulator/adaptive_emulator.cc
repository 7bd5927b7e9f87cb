#include "server/methods/adaptive_emulator/adaptive_emulator.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"
#include "server/methods/adaptive_emulator/adaptive_planner.h"

namespace calib::methods {
namespace {

constexpr int kMostRuns = 10'000;
constexpr const char* kMaxRuns = "max_runs";
constexpr const char* kBatch = "batch";
constexpr const char* kAsynchronous = "asynchronous";

class AdaptiveEmulator final : public campaign::Method {
 public:
  std::string name() const override { return "adaptive_emulator"; }
  bool keeps_batches() const override { return true; }
  bool chooses_while_running() const override { return asynchronous_; }
  bool needs_errors() const override { return true; }
  bool bounds_runs() const override { return false; }  // it would take a bound for a value
  int standard_iterations() const override { return 0; }
  bool takes_first_proposal() const override { return false; }  // first runs fill the prior
  bool takes_rows() const override { return true; }
  bool takes_made_runs() const override { return true; }

  bool batches_vary() const override { return true; }

  int FirstBatch(const campaign::Campaign& campaign) const override {
    return GivenBeside(campaign) +
           inference::FirstRunsOf(static_cast<Eigen::Index>(campaign.parameters.size()), options_);
  }
  std::string RunsInWords(const campaign::Campaign& campaign) const override {
    const int given = GivenBeside(campaign);
    return absl::StrCat(given > 0 ? absl::StrCat(given, " rows given, at most ") : "",
                        FirstBatch(campaign) - given, " runs that fill the prior, then batches of ",
                        options_.batch, ", at most ", options_.max_runs,
                        given > 0 ? " runs beside the rows" : " runs in all");
  }
  int LaterBatch(const campaign::Campaign& /*campaign*/) const override {
    return std::max(options_.batch, options_.verify);
  }
  int MostBatches(const campaign::Campaign& campaign) const override {
    if (campaign.precomputed) return 1;
    // Rows may stand for all runs that would fill the prior.
    const int filling = GivenBeside(campaign) > 0 ? 0 : FirstBatch(campaign);
    const int later = options_.max_runs - filling;
    const int least = std::min(options_.batch, options_.verify);
    return 1 + (std::max(0, later) + least - 1) / least;
  }

  campaign::LeastRuns least_runs(
      std::size_t parameters,
      const std::function<std::optional<int>(const std::string&)>& said) const override {
    inference::AdaptiveOptions options;
    const int standard = options.max_runs;
    options.batch = said(kBatch).value_or(options.batch);
    return {.key = kMaxRuns,
            .least = inference::LeastMaxRuns(static_cast<Eigen::Index>(parameters), options),
            .standard = standard};
  }

  std::vector<campaign::Section> Keys() const override {
    const inference::AdaptiveOptions standard;
    return {{"inference",
             "inference",
             {
                 {kMaxRuns, campaign::Whole(1, kMostRuns), absl::StrCat(standard.max_runs),
                  "adaptive_emulator: runs at most, of all batches together, `rows` aside"},
                 {kBatch, campaign::AnyOf({campaign::Whole(1, 1000), campaign::OneWord({"auto"})}),
                  absl::StrCat("auto: ", standard.batch),
                  "adaptive_emulator: runs that are chosen together"},
                 {"rows", campaign::ListOf(campaign::MapOf("row")), "none",
                  "runs that come first, beside those that max_runs counts"},
                 {kAsynchronous, campaign::TrueOrFalse(), "false",
                  "adaptive_emulator: true, the next batch is chosen while one runs, from those "
                  "before it, so that no core waits for the last run of a batch"},
             }}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& campaign) const override {
    auto read = std::make_shared<AdaptiveEmulator>();
    inference::AdaptiveOptions& options = read->options_;
    options.max_runs = static_cast<int>(inference.Integer(kMaxRuns).value_or(options.max_runs));
    const campaign::YamlNode* batch = inference.Find(kBatch);
    const bool is_auto = batch == nullptr || (batch->kind == campaign::YamlNode::Kind::kScalar &&
                                              batch->scalar == "auto");
    if (!is_auto) {
      options.batch = static_cast<int>(inference.Integer(kBatch).value_or(options.batch));
    }
    for (const char* key : {kMaxRuns, kBatch, kAsynchronous}) {
      if (campaign.precomputed && inference.Has(key)) {
        inference.Problem(key, "has no meaning with runs that exist already; remove it");
      }
    }
    read->asynchronous_ = inference.TrueOrFalse(kAsynchronous).value_or(false);
    for (const char* key : {"samples", "max_iterations"}) {
      if (inference.Has(key)) {
        inference.Problem(
            key, absl::StrCat("is chosen by ", name(), "; ", kMaxRuns, " bounds its runs"));
      }
    }
    if (campaign.filter.noise != inference::NoiseMode::kGiven) {
      inference.Problem("method", absl::StrCat(name(),
                                               " needs the errors of the readings as they are; "
                                               "write noise: given, or take tmcmc"));
    }
    // The largest batch is the first, which the parameters decide.
    if (!campaign.precomputed) campaign.samples = options.max_runs;
    // Its runs are spread over the packings, so that it knows what these differ by.
    if (!campaign.replicates) campaign.replicates = 0;
    return read;
  }

  void Check(const campaign::MapReader& inference,
             const campaign::Campaign& campaign) const override {
    const auto parameters = static_cast<Eigen::Index>(campaign.parameters.size());
    const int least = inference::LeastMaxRuns(parameters, options_);
    if (!campaign.precomputed && parameters > 0 && options_.max_runs < least) {
      inference.Problem(
          kMaxRuns,
          absl::StrCat("is ", options_.max_runs, ", and ", parameters, " parameters take ", least,
                       " runs at least: ", inference::FirstRunsOf(parameters, options_),
                       " that fill the prior, two batches of ", options_.batch, " and ",
                       options_.verify, " that judge"));
    }
  }

  campaign::MethodInWords InWords(const campaign::Campaign& /*campaign*/,
                                  int iterations) const override {
    return {
        "Runs placed one batch after the other where an emulator of those before leaves the "
        "posterior least certain",
        {"Sinsbeck M, Nowak W (2017) Sequential design of computer experiments for the "
         "solution of Bayesian inverse problems. SIAM/ASA J Uncertain Quantif 5:640–664",
         "Järvenpää M, Gutmann MU, Vehtari A, Marttinen P (2021) Parallel Gaussian process "
         "surrogate Bayesian inference with noisy likelihood evaluations. Bayesian Anal "
         "16:147–178"},
        absl::StrCat(", ", iterations, " batches")};
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    return MakeAdaptivePlanner(definition, options_);
  }

 private:
  static int GivenBeside(const campaign::Campaign& campaign) {
    return campaign.table ? static_cast<int>(campaign.table->parameters.rows()) : 0;
  }

  inference::AdaptiveOptions options_;  // max_runs and batch
  bool asynchronous_ = false;
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeAdaptiveEmulator() {
  return std::make_shared<AdaptiveEmulator>();
}

}  // namespace calib::methods
