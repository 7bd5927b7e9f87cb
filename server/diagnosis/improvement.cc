#include "server/diagnosis/improvement.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/sha256.h"
#include "server/client/findings.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/improve_step.h"
#include "server/diagnosis/left_out_error.h"
#include "server/report/text/people_units.h"
#include "server/report/views/comparison.h"

namespace calib::diagnosis {
namespace {

constexpr char kAdequate[] = "adequate";
constexpr char kExplained[] = "Noise, scatter and the emulator's error explain what is left.";

CalibratedModel Calibrated(const report::CampaignView& view, double rms_error) {
  return {.rms_error = rms_error,
          .has_posterior = view.posterior.posterior_from() != "none",
          .log_evidence = view.posterior.log_evidence(),
          .log_evidence_se = view.posterior.log_evidence_se()};
}

void AddSentence(const std::string& sentence, std::string& text) {
  absl::StrAppend(&text, text.empty() || sentence.empty() ? "" : " ", sentence);
}

}  // namespace

std::optional<std::int64_t> Improvement::Left() const {
  if (!limits_.evaluations) return std::nullopt;
  return std::max<std::int64_t>(0, *limits_.evaluations - evaluations_);
}

absl::Status Improvement::From(report::CampaignView view) {
  first_ = view;
  std::vector<std::string> added;
  RETURN_IF_ERROR(Climb(std::move(view), added));
  RETURN_IF_ERROR(Exchange(added));
  RETURN_IF_ERROR(Instead(added));
  RETURN_IF_ERROR(Prune(added));
  return Open();
}

// Adds effects to a model until it is adequate, nothing helps, or no more are allowed: the last
// one.
absl::Status Improvement::Climb(report::CampaignView view, std::vector<std::string>& added) {
  for (;;) {
    const bool last = static_cast<int>(added.size()) >= limits_.effects || Spent();
    ASSIGN_OR_RETURN(auto diagnosis, Judge(view, last));
    ImproveStep& step = steps_.back();
    if (diagnosis.verdict == kAdequate) {
      std::string reason = kExplained;
      AddSentence(step.reason, reason);
      step.reason = std::move(reason);
      break;
    }
    if (last) {
      AddSentence(Spent() ? "--max-evaluations is used up, so no effect was looked for."
                          : absl::StrCat("--max-effects allows ", limits_.effects, "."),
                  step.reason);
      break;
    }
    if (step.reason.empty() && EffectsToTry(diagnosis).empty() && !diagnosis.reason.empty()) {
      step.reason = absl::StrCat(diagnosis.reason, ".");
    }
    ASSIGN_OR_RETURN(auto extended, Forward(view, diagnosis));
    if (!extended) break;
    added.push_back(step.next_effect);
    fork_ = Fork{.view = std::move(view), .diagnosis = std::move(diagnosis)};
    view = *std::move(extended);
  }
  last_ = std::move(view);
  return absl::OkStatus();
}

// The model with the first of the effects to try that makes it better; none: there is none. Sets
// the effect of the last step, and its reason.
absl::StatusOr<std::optional<report::CampaignView>> Improvement::Forward(
    const report::CampaignView& view, const Diagnosis& diagnosis) {
  ImproveStep& step = steps_.back();
  std::string against;
  for (const std::string& effect : EffectsToTry(diagnosis)) {
    if (const std::string why = WhyNotJoin(view.campaign, effect); !why.empty()) {
      AddSentence(absl::StrCat(effect, " would be added, but cannot be: ", why, "."), against);
      continue;
    }
    auto extended = Extended(view, {effect}, ClosestRunWith(effect, diagnosis));
    if (absl::IsResourceExhausted(extended.status())) {
      AddSentence(absl::StrCat(effect, " would be added, but --max-evaluations forbids it: ",
                               extended.status().message(), "."),
                  against);
      break;
    }
    if (!extended.ok()) return extended.status();
    const std::string why = WhyNot(view, step.rms_error, *extended, ErrorOf(*extended));
    if (why.empty()) {
      step.next_effect = effect;
      AddSentence(WhyNext(diagnosis, effect), step.reason);
      AddSentence(against, step.reason);
      return std::optional(*std::move(extended));
    }
    AddSentence(absl::StrCat("The calibration with ", effect, " (", extended->status.campaign(),
                             ") is no step: ", why, "."),
                against);
  }
  AddSentence(against, step.reason);
  return std::optional<report::CampaignView>();
}

// WhyNoStep of two models whose errors on the fitted data are known.
std::string Improvement::WhyNot(const report::CampaignView& without, double without_error,
                                const report::CampaignView& with, double with_error) {
  CalibratedModel before = Calibrated(without, without_error);
  CalibratedModel after = Calibrated(with, with_error);
  if (const auto left_out = LeftOutErrorsOf(laboratory_, without, with, nuisance_)) {
    before.left_out_error = left_out->without;
    after.left_out_error = left_out->with;
  }
  return WhyNoStep(before, after);
}

// A diagnosis that cannot be paid for is no more than the adequacy of the model; the reason says
// so.
absl::StatusOr<Diagnosis> Improvement::Ask(const report::CampaignView& view, bool only_adequacy,
                                           std::string& reason) {
  DiagnosisOptions options{.only_adequacy = only_adequacy,
                           .nuisance = nuisance_,
                           .without = limits_.without,
                           .max_evaluations = Left(),
                           .next_experiment = false};
  auto diagnosis = Diagnose(laboratory_, view, options);
  if (absl::IsResourceExhausted(diagnosis.status())) {
    reason = absl::StrCat("No effect was looked for, --max-evaluations forbids it: ",
                          diagnosis.status().message(), ".");
    options.only_adequacy = true;
    diagnosis = Diagnose(laboratory_, view, options);
  }
  if (!diagnosis.ok()) return diagnosis;
  client::StoreFinding(client_, diagnosis->campaign, client::kDiagnosis, DiagnosisJson(*diagnosis));
  if (!diagnosis->only_adequacy) nuisance_ = diagnosis->nuisance;
  evaluations_ += diagnosis->screen_evaluations + diagnosis->warm_evaluations;
  return diagnosis;
}

// Adds a step.
absl::StatusOr<Diagnosis> Improvement::Judge(const report::CampaignView& view, bool only_adequacy) {
  std::string reason;
  auto diagnosis = Ask(view, only_adequacy, reason);
  if (!diagnosis.ok()) {
    if (steps_.empty() || !absl::IsFailedPrecondition(diagnosis.status())) return diagnosis;
    // It comes closer, but how well it could do is not known: no adequacy without support.
    reason = absl::StrCat("Its adequacy is not known: ", diagnosis.status().message(), ".");
    diagnosis = Diagnosis{};
    diagnosis->verdict = "unexplained";
  }
  steps_.push_back(StepOf(view, diagnosis->verdict, std::move(reason)));
  return diagnosis;
}

ImproveStep Improvement::StepOf(const report::CampaignView& view, const std::string& verdict,
                                std::string reason) {
  return {.campaign = view.status.campaign(),
          .effects = view.campaign.model.effects,
          .rms_error = ErrorOf(view),
          .heldout_rms_error = std::nullopt,
          .left_out_error = LeftOutErrorOf(laboratory_, view, nuisance_),
          .log_evidence = view.posterior.log_evidence(),
          .verdict = verdict,
          .next_effect = "",
          .reason = std::move(reason)};
}

// What was taken first may stand for something else that could not be told from it then. Where the
// last model is not adequate, what is missing beside the later effects is asked anew without an
// earlier one, and another answer is taken where it makes the model adequate.
absl::Status Improvement::Exchange(std::vector<std::string>& added) {
  if (steps_.back().verdict == kAdequate) return absl::OkStatus();
  const report::CampaignView full = *last_;
  for (std::size_t k = 0; k + 1 < added.size() && !Spent(); ++k) {
    const auto replaced = Replace(k, added, full);
    if (absl::IsResourceExhausted(replaced.status())) return absl::OkStatus();
    if (!replaced.ok()) return replaced.status();
    if (*replaced) return absl::OkStatus();
    AddSentence(absl::StrCat("Nothing else in the place of ", added[k], " makes it adequate."),
                steps_.back().reason);
  }
  return absl::OkStatus();
}

// The last effect may be the wrong one of several that were near: where the model at the end is not
// adequate, others are calibrated in its place, and one that comes closer goes on from there.
absl::Status Improvement::Instead(std::vector<std::string>& added) {
  if (steps_.back().verdict == kAdequate || added.empty() || !fork_) return absl::OkStatus();
  const Fork fork = *fork_;
  const std::string out = added.back();
  for (const std::string& in : OthersToTry(fork.diagnosis, out, steps_.back().rms_error)) {
    if (Spent() || !WhyNotJoin(fork.view.campaign, in).empty()) continue;
    auto with = Extended(fork.view, {in}, ClosestRunWith(in, fork.diagnosis));
    if (absl::IsResourceExhausted(with.status())) return absl::OkStatus();
    if (!with.ok()) return with.status();
    ImproveStep& step = steps_.back();
    const double error = ErrorOf(*with);
    if (!WhyNot(*last_, step.rms_error, *with, error).empty()) {
      AddSentence(absl::StrCat("With ", in, " in the place of ", out, " (", with->status.campaign(),
                               ") it does no better: error ", report::Number(error, 3), " sd."),
                  step.reason);
      continue;
    }
    steps_.push_back(
        StepOf(fork.view, fork.diagnosis.verdict,
               absl::StrCat("Tried in the place of ", out, ": ", in, " comes closer.")));
    steps_.back().next_effect = in;
    added.resize(fork.view.campaign.model.effects.size() - first_->campaign.model.effects.size());
    added.push_back(in);
    RETURN_IF_ERROR(Climb(*std::move(with), added));
    if (steps_.back().verdict == kAdequate) return absl::OkStatus();
  }
  return absl::OkStatus();
}

// Whether an adequate model without added[doubted], or with another effect in its place, was found;
// then it is the last one. RESOURCE_EXHAUSTED: --max-evaluations forbids to look on.
absl::StatusOr<bool> Improvement::Replace(std::size_t doubted, std::vector<std::string>& added,
                                          const report::CampaignView& full) {
  const std::string out = added[doubted];
  std::vector<std::string> others = added;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(doubted));
  ASSIGN_OR_RETURN(const auto without, Extended(*first_, others, ClosestRunWithout(out, full), 1));
  std::string reason;
  const auto missing = Ask(without, false, reason);
  if (absl::IsFailedPrecondition(missing.status())) return false;
  if (!missing.ok()) return missing.status();
  if (missing->verdict == kAdequate) {
    steps_.push_back(
        StepOf(without, missing->verdict, absl::StrCat(kExplained, " It does without ", out, ".")));
    last_ = without;
    added = std::move(others);
    return true;
  }
  for (const std::string& in : EffectsToTry(*missing)) {
    if (in == out || !WhyNotJoin(without.campaign, in).empty()) continue;
    ASSIGN_OR_RETURN(auto with, Extended(without, {in}, ClosestRunWith(in, *missing)));
    const auto judged = Ask(with, false, reason);
    if (absl::IsFailedPrecondition(judged.status())) continue;
    if (!judged.ok()) return judged.status();
    if (judged->verdict != kAdequate) continue;
    steps_.push_back(StepOf(
        without, missing->verdict,
        absl::StrCat("Asked anew what is missing without ", out, ": ", WhyNext(*missing, in))));
    steps_.back().next_effect = in;
    steps_.push_back(StepOf(with, judged->verdict,
                            absl::StrCat(kExplained, " So ", in, " stands where ", out, " did.")));
    last_ = std::move(with);
    others.push_back(in);
    added = std::move(others);
    return true;
  }
  return false;
}

// An effect that was added early may be needless beside the later ones: the model is kept without
// the first that it is adequate without, and what is left is asked again.
absl::Status Improvement::Prune(std::vector<std::string> added) {
  while (steps_.back().verdict == kAdequate) {
    const auto needless = TakeOutNeedless(added);
    if (absl::IsResourceExhausted(needless.status())) return absl::OkStatus();
    if (!needless.ok()) return needless.status();
    if (needless->empty()) return absl::OkStatus();
    added.erase(std::find(added.begin(), added.end(), *needless));
  }
  return absl::OkStatus();
}

// The effect that was taken out; empty: every one but the last is needed, or --max-evaluations is
// used up.
absl::StatusOr<std::string> Improvement::TakeOutNeedless(const std::vector<std::string>& added) {
  const report::CampaignView full = *last_;
  for (std::size_t k = 0; k + 1 < added.size() && !Spent(); ++k) {
    std::vector<std::string> others = added;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    ASSIGN_OR_RETURN(auto without, Extended(*first_, others, ClosestRunWithout(added[k], full), 1));
    if (without.posterior.posterior_from() == "none" || !Fits(without)) continue;
    last_ = std::move(without);
    if (auto judged = Judge(*last_, true); !judged.ok()) return judged.status();
    steps_.back().reason = absl::StrCat("As adequate without ", added[k], ", which is taken out.");
    return added[k];
  }
  return "";
}

absl::StatusOr<report::CampaignView> Improvement::Extended(const report::CampaignView& view,
                                                           const std::vector<std::string>& effects,
                                                           const ClosestRun& closest, int times) {
  ExtendedCalibration calibration(laboratory_, times, Left());
  auto extended = calibration.Of(view, effects, closest);
  evaluations_ += calibration.evaluations();
  return extended;
}

bool Improvement::Fits(const report::CampaignView& view) {
  const auto quick = Diagnose(laboratory_, view, {.only_adequacy = true, .nuisance = nuisance_});
  return quick.ok() && quick->verdict == kAdequate;
}

// The verdict is stored by its digest before held-out data are looked at.
absl::Status Improvement::Open() {
  const std::string verdict = Json();
  RETURN_IF_ERROR(client_.PutBlob(verdict));
  digest_ = campaign::Sha256Hex(verdict);
  const auto held_out = [](const report::CampaignView& view) {
    return report::Compare(view, report::PredictReadings(view)).heldout_rms_error;
  };
  steps_.front().heldout_rms_error = held_out(*first_);
  steps_.back().heldout_rms_error = held_out(*last_);
  if (steps_.front().heldout_rms_error) {
    ASSIGN_OR_RETURN(auto before, OpenedBefore());
    opened_before_ = std::move(before);
  }
  const std::string opened = Json();
  client::StoreFinding(client_, steps_.front().campaign, client::kImprovement, opened);
  if (steps_.size() > 1)
    client::StoreFinding(client_, steps_.back().campaign, client::kImprovement, opened);
  return absl::OkStatus();
}

// Of what is kept with the first campaign: verdicts that were there before this one was first.
absl::StatusOr<std::vector<std::string>> Improvement::OpenedBefore() {
  ASSIGN_OR_RETURN(const auto findings, client_.Findings(steps_.front().campaign));
  std::map<std::string, std::int64_t> opened;  // verdict's digest -> when first
  for (const v1::Finding& finding : findings) {
    if (finding.kind() != client::kImprovement) continue;
    ASSIGN_OR_RETURN(const auto document, client_.GetBlob(finding.digest()));
    const auto json = nlohmann::json::parse(document, nullptr, false);
    if (!json.is_object()) continue;
    const auto [at, is_new] =
        opened.emplace(json.value("verdict_digest", ""), finding.created_unix_ms());
    if (!is_new) at->second = std::min(at->second, finding.created_unix_ms());
  }
  const auto own = opened.find(digest_);
  std::vector<std::string> digests;
  for (const auto& [digest, when] : opened) {
    if (digest != digest_ && (own == opened.end() || when < own->second)) digests.push_back(digest);
  }
  return digests;
}

std::string Improvement::Json() const {
  using nlohmann::json;
  json list = json::array();
  for (const ImproveStep& step : steps_) {
    list.push_back(
        {{"campaign", step.campaign},
         {"effects", step.effects},
         {"rms_error", step.rms_error},
         {"heldout_rms_error",
          step.heldout_rms_error ? json(*step.heldout_rms_error) : json(nullptr)},
         {"left_out_error", step.left_out_error ? json(*step.left_out_error) : json(nullptr)},
         {"log_evidence", step.log_evidence},
         {"verdict", step.verdict},
         {"next_effect", step.next_effect.empty() ? json(nullptr) : json(step.next_effect)},
         {"reason", step.reason}});
  }
  json document = {{"steps", list},
                   {"verdict", steps_.back().verdict},
                   {"final_campaign", steps_.back().campaign},
                   {"verdict_digest", digest_},
                   {"model_evaluations", evaluations_}};
  if (!opened_before_.empty()) document["opened_before"] = opened_before_;
  return document.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace calib::diagnosis
