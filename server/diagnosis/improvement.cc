#include "server/diagnosis/improvement.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/sha256.h"
#include "server/client/findings.h"
#include "server/client/load_view.h"
#include "server/diagnosis/extended_calibration.h"
#include "server/diagnosis/improve_step.h"
#include "server/report/views/comparison.h"

namespace calib::diagnosis {
namespace {

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
  const std::size_t own = view.campaign.model.effects.size();
  for (;;) {
    const int left = limits_.effects - static_cast<int>(view.campaign.model.effects.size() - own);
    const bool last = left <= 0 || Spent();
    ASSIGN_OR_RETURN(const Diagnosis diagnosis, Judge(view, last));
    ImproveStep& step = steps_.back();
    if (diagnosis.answer.verdict == AnswerVerdict::kAdequate) {
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
    if (step.reason.empty() && ModelsToTry(diagnosis.answer, left).empty())
      step.reason = diagnosis.answer.sentence;
    ASSIGN_OR_RETURN(auto extended, Forward(view, diagnosis, left));
    if (!extended) break;
    view = *std::move(extended);
  }
  last_ = std::move(view);
  return Open();
}

// As often as few iterations as it takes until the model is found: those that were made are found
// again by their digests. More runs may show that an emulator was not good enough; a posterior that
// passed is kept.
absl::StatusOr<report::CampaignView> Improvement::Calibrate(const report::CampaignView& view,
                                                            const NamedModel& model,
                                                            const report::CampaignView* design) {
  absl::StatusOr<report::CampaignView> extended = absl::UnknownError("not calibrated");
  for (int times = 1; times <= kMostTimes; ++times) {
    const auto plan =
        PlanExtended(view, model, {.design = design, .times = times, .budget = Left()});
    if (times > 1 && absl::IsResourceExhausted(plan.status())) break;
    RETURN_IF_ERROR(plan.status());
    ASSIGN_OR_RETURN(const auto text, ExtensionText(view, *plan));
    auto next =
        laboratory_.Run(view, text, "calibration with " + absl::StrJoin(model.effects, " + "));
    RETURN_IF_ERROR(next.status());
    evaluations_ += next->status.model_evaluations();
    const bool loses = extended.ok() && Calibrated(*extended, 0).has_posterior &&
                       !Calibrated(*next, 0).has_posterior;
    if (!loses) extended = std::move(next);
    if (IsFound(*extended, model)) break;
  }
  return extended;
}

// The model with the first of those to try that makes it better; none: there is none. Sets the
// effects of the last step, and its reason.
absl::StatusOr<std::optional<report::CampaignView>> Improvement::Forward(
    const report::CampaignView& view, const Diagnosis& diagnosis, int most) {
  const Answer& answer = diagnosis.answer;
  ImproveStep& step = steps_.back();
  std::optional<report::CampaignView> design;
  if (!diagnosis.design.empty()) {
    ASSIGN_OR_RETURN(design, client::LoadView(client_, diagnosis.design));
  }
  std::string against;
  for (const NamedModel* model : ModelsToTry(answer, most)) {
    const std::string names = absl::StrJoin(model->effects, " and ");
    auto extended = Calibrate(view, *model, design ? &*design : nullptr);
    if (absl::IsResourceExhausted(extended.status())) {
      AddSentence(absl::StrCat(names, " would be added, but --max-evaluations forbids it: ",
                               extended.status().message(), "."),
                  against);
      break;
    }
    if (!extended.ok()) return extended.status();
    const std::string why =
        WhyNoStep(Calibrated(view, step.rms_error), Calibrated(*extended, ErrorOf(*extended)));
    if (why.empty()) {
      step.next_effects = model->effects;
      AddSentence(WhyNext(answer, *model), step.reason);
      AddSentence(against, step.reason);
      probability_ = model->probability;
      return std::optional(*std::move(extended));
    }
    AddSentence(absl::StrCat("The calibration with ", names, " (", extended->status.campaign(),
                             ") is no step: ", why, "."),
                against);
  }
  AddSentence(against, step.reason);
  return std::optional<report::CampaignView>();
}

// A diagnosis that cannot be paid for is no more than the adequacy of the model; the reason says
// so.
absl::StatusOr<Diagnosis> Improvement::Ask(const report::CampaignView& view, bool only_adequacy,
                                           std::string& reason) {
  DiagnosisOptions options{.only_adequacy = only_adequacy,
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
  evaluations_ += diagnosis->evaluations;
  return diagnosis;
}

// Adds a step. A model to which an effect was added is asked whether it is adequate before more are
// looked for.
absl::StatusOr<Diagnosis> Improvement::Judge(const report::CampaignView& view, bool last) {
  std::string reason;
  auto diagnosis = Ask(view, last || !steps_.empty(), reason);
  if (diagnosis.ok() && !last && diagnosis->only_adequacy && reason.empty() &&
      diagnosis->answer.verdict != AnswerVerdict::kAdequate)
    diagnosis = Ask(view, false, reason);
  if (!diagnosis.ok()) {
    if (steps_.empty() || !absl::IsFailedPrecondition(diagnosis.status())) return diagnosis;
    // It comes closer, but how well it could do is not known: no adequacy without support.
    reason = absl::StrCat("Its adequacy is not known: ", diagnosis.status().message(), ".");
    diagnosis = Diagnosis{};
    diagnosis->answer.verdict = AnswerVerdict::kUnexplained;
  }
  if (steps_.empty() && !diagnosis->only_adequacy) probability_ = diagnosis->answer.adequate;
  steps_.push_back({.campaign = view.status.campaign(),
                    .effects = view.campaign.model.effects,
                    .probability = probability_,
                    .rms_error = ErrorOf(view),
                    .log_evidence = view.posterior.log_evidence(),
                    .verdict = ToString(diagnosis->answer.verdict),
                    .reason = std::move(reason)});
  return diagnosis;
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
    list.push_back({{"campaign", step.campaign},
                    {"effects", step.effects},
                    {"probability", step.probability ? json(*step.probability) : json(nullptr)},
                    {"rms_error", step.rms_error},
                    {"heldout_rms_error",
                     step.heldout_rms_error ? json(*step.heldout_rms_error) : json(nullptr)},
                    {"log_evidence", step.log_evidence},
                    {"verdict", step.verdict},
                    {"next_effect",
                     step.next_effects.empty() ? json(nullptr) : json(step.next_effects.front())},
                    {"next_effects", step.next_effects},
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
