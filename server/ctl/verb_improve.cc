// compare -> diagnose -> extend until the misfit is explained or nothing helps. Held-out data are
// looked at for the first and the last model alone, after the verdict.
#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <iostream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_join.h"
#include "server/campaign/sha256.h"
#include "server/ctl/diagnosis.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/extension.h"
#include "server/ctl/findings.h"
#include "server/ctl/interrupt.h"
#include "server/ctl/text_table.h"
#include "server/ctl/verbs.h"
#include "server/report/comparison.h"
#include "server/report/people_units.h"

namespace calib::ctl {
namespace {

using Json = nlohmann::json;

struct ImproveStep {
  std::string campaign;
  std::vector<std::string> effects;
  double rms_error = 0;
  std::optional<double> heldout_rms_error;
  double log_evidence = 0;
  std::string verdict;
};

// The effect to try next: named, or the best of a group, or what helps most.
std::string NextEffect(const Diagnosis& diagnosis) {
  if (!diagnosis.effect.empty()) return diagnosis.effect;
  if (diagnosis.verdict == "ambiguous") return diagnosis.candidates.front().effect;
  return diagnosis.best_partial;
}

// Where the warm fit of an effect has come closest.
struct ClosestRun {
  std::map<std::string, double> values{};
  double rms = std::numeric_limits<double>::infinity();  // residual over noise sd
};
ClosestRun ClosestRunWith(const std::string& effect, const Diagnosis& diagnosis) {
  for (const CandidateEffect& candidate : diagnosis.candidates) {
    if (candidate.effect == effect && !candidate.closest.empty()) {
      return {.values = candidate.closest, .rms = candidate.predicted_rms_error};
    }
  }
  return {};
}

Json ToJson(const std::vector<ImproveStep>& steps, const std::string& digest,
            std::int64_t evaluations) {
  Json list = Json::array();
  for (const ImproveStep& step : steps) {
    list.push_back({{"campaign", step.campaign},
                    {"effects", step.effects},
                    {"rms_error", step.rms_error},
                    {"heldout_rms_error",
                     step.heldout_rms_error ? Json(*step.heldout_rms_error) : Json(nullptr)},
                    {"log_evidence", step.log_evidence},
                    {"verdict", step.verdict}});
  }
  return {{"steps", list},
          {"verdict", steps.back().verdict},
          {"final_campaign", steps.back().campaign},
          {"verdict_digest", digest},
          {"model_evaluations", evaluations}};
}

std::string ToText(const std::vector<ImproveStep>& steps) {
  TextTable table({"<campaign", "<effects", "error", "held out", "log evidence", "<verdict"});
  for (const ImproveStep& step : steps) {
    std::string effects;
    for (const std::string& name : step.effects) effects += (effects.empty() ? "" : " + ") + name;
    table.AddRow({step.campaign, effects.empty() ? "none" : effects,
                  report::Number(step.rms_error, 3),
                  step.heldout_rms_error ? report::Number(*step.heldout_rms_error, 3) : "–",
                  report::Number(step.log_evidence, 5), step.verdict});
  }
  std::string text = table.ToString();
  if (steps.size() > 1) {
    text += fmt::format("\nError {} before, {} after", report::Number(steps.front().rms_error, 3),
                        report::Number(steps.back().rms_error, 3));
    if (steps.front().heldout_rms_error && steps.back().heldout_rms_error) {
      text += fmt::format("; on held-out data {} before, {} after",
                          report::Number(*steps.front().heldout_rms_error, 3),
                          report::Number(*steps.back().heldout_rms_error, 3));
    }
    text += ".\n";
  }
  return text;
}

class Improvement {
 public:
  Improvement(Laboratory& laboratory, Client& client, const Arguments& limits)
      : laboratory_(laboratory),
        client_(client),
        max_effects_(limits.max_effects),
        max_evaluations_(limits.max_evaluations) {}

  absl::Status From(report::CampaignView view) {
    first_ = view;
    std::vector<std::string> added;
    for (;;) {
      const bool last = static_cast<int>(added.size()) >= max_effects_ || Spent();
      const auto diagnosis = Judge(view, last || (!added.empty() && Fits(view)));
      if (!diagnosis.ok()) return diagnosis.status();
      const std::string next = NextEffect(*diagnosis);
      if (diagnosis->verdict == "adequate" || last || next.empty()) break;
      if (Spent()) {
        std::cerr << next << " is not tried: " << evaluations_
                  << " model evaluations are as many as --max-evaluations allows\n";
        break;
      }
      auto extended = Extended(view, {next}, ClosestRunWith(next, *diagnosis));
      if (!extended.ok()) return extended.status();
      if (extended->posterior.posterior_from() == "none" &&
          !(ErrorOf(*extended) < steps_.back().rms_error)) {
        std::cerr << "the calibration with " << next << " (" << extended->status.campaign()
                  << ") has no posterior and comes no closer, so it is no step: run more samples\n";
        break;
      }
      added.push_back(next);
      view = *std::move(extended);
    }
    last_ = std::move(view);
    if (auto status = Prune(added); !status.ok()) return status;
    return Open();
  }

  const std::vector<ImproveStep>& steps() const { return steps_; }
  const std::string& digest() const { return digest_; }
  std::int64_t evaluations() const { return evaluations_; }

 private:
  static double ErrorOf(const report::CampaignView& view) {
    return report::Compare(view, report::PredictReadings(view)).rms_error;
  }
  bool Spent() const { return max_evaluations_ && evaluations_ >= *max_evaluations_; }

  // Adds a step.
  absl::StatusOr<Diagnosis> Judge(const report::CampaignView& view, bool only_adequacy) {
    auto diagnosis =
        Diagnose(laboratory_, view, {.only_adequacy = only_adequacy, .next_experiment = false});
    if (!diagnosis.ok()) {
      if (steps_.empty() || !absl::IsFailedPrecondition(diagnosis.status())) return diagnosis;
      // It comes closer, but how well it could do is not known: no adequacy without support.
      std::cerr << diagnosis.status().message() << "\n";
      diagnosis = Diagnosis{};
      diagnosis->verdict = "unexplained";
    }
    if (!diagnosis->campaign.empty()) {
      KeepFinding(client_, diagnosis->campaign, kDiagnosis, DiagnosisJson(*diagnosis));
    }
    evaluations_ += diagnosis->screen_evaluations + diagnosis->warm_evaluations;
    steps_.push_back({.campaign = view.status.campaign(),
                      .effects = view.campaign.model.effects,
                      .rms_error = ErrorOf(view),
                      .heldout_rms_error = std::nullopt,
                      .log_evidence = view.posterior.log_evidence(),
                      .verdict = diagnosis->verdict});
    return diagnosis;
  }

  // An effect that was added early may be needless beside the later ones: the model is kept without
  // the first that it is adequate without.
  absl::Status Prune(const std::vector<std::string>& added) {
    if (steps_.back().verdict != "adequate") return absl::OkStatus();
    for (std::size_t k = 0; k + 1 < added.size() && !Spent(); ++k) {
      std::vector<std::string> others = added;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
      auto without = Extended(*first_, others, ClosestRun{});
      if (!without.ok()) return without.status();
      if (without->posterior.posterior_from() == "none" || !Fits(*without)) continue;
      last_ = *std::move(without);
      return Judge(*last_, true).status();
    }
    return absl::OkStatus();
  }

  // With a parameter more the parent's iterations may not do: then as many again.
  absl::StatusOr<report::CampaignView> Extended(const report::CampaignView& view,
                                                const std::vector<std::string>& effects,
                                                const ClosestRun& closest) {
    absl::StatusOr<report::CampaignView> extended = absl::UnknownError("not run");
    for (const int times : {1, 2}) {
      const auto text = ExtensionText(
          view,
          {.effects = effects,
           .purpose = "extension",
           .near = closest.values,
           .samples = std::nullopt,
           .iterations = times == 1 ? std::nullopt
                                    : std::optional<int>(times * view.campaign.max_iterations)});
      if (!text.ok()) return text.status();
      extended = laboratory_.Run(view, *text, "calibration with " + absl::StrJoin(effects, " + "));
      if (!extended.ok()) break;
      // A posterior that misses more than a single run did has not been found yet.
      if (extended->posterior.posterior_from() != "none" && ErrorOf(*extended) <= closest.rms) {
        break;
      }
    }
    if (extended.ok()) evaluations_ += extended->status.model_evaluations();
    return extended;
  }

  bool Fits(const report::CampaignView& view) {
    const auto quick = Diagnose(laboratory_, view, {.only_adequacy = true});
    return quick.ok() && quick->verdict == "adequate";
  }

  // The verdict is stored by its digest before held-out data are looked at.
  absl::Status Open() {
    const std::string verdict = ToJson(steps_, "", evaluations_).dump();
    if (auto stored = client_.PutBlob(verdict); !stored.ok()) return stored;
    digest_ = campaign::Sha256Hex(verdict);
    steps_.front().heldout_rms_error =
        report::Compare(*first_, report::PredictReadings(*first_)).heldout_rms_error;
    steps_.back().heldout_rms_error =
        report::Compare(*last_, report::PredictReadings(*last_)).heldout_rms_error;
    const std::string opened = ToJson(steps_, digest_, evaluations_).dump();
    KeepFinding(client_, steps_.front().campaign, kImprovement, opened);
    if (steps_.size() > 1) KeepFinding(client_, steps_.back().campaign, kImprovement, opened);
    return absl::OkStatus();
  }

  Laboratory& laboratory_;
  Client& client_;
  int max_effects_;
  std::optional<std::int64_t> max_evaluations_;
  std::int64_t evaluations_ = 0;
  std::vector<ImproveStep> steps_;
  std::optional<report::CampaignView> first_, last_;
  std::string digest_;
};

}  // namespace

int Improve(const Arguments& arguments) {
  CatchInterrupts();
  const auto session = Session::Open(arguments);
  if (!session.ok()) return Fail(session.status());
  Laboratory laboratory(**session, arguments);
  auto view = laboratory.Finished(arguments.campaign);
  if (!view.ok()) return Fail(view.status());
  Improvement improvement(laboratory, (*session)->client(), arguments);
  if (auto status = improvement.From(*std::move(view)); !status.ok()) return Fail(status);
  std::cout << (arguments.json
                    ? ToJson(improvement.steps(), improvement.digest(), improvement.evaluations())
                              .dump(2) +
                          "\n"
                    : ToText(improvement.steps()));
  return kDone;
}

}  // namespace calib::ctl
