#include <fmt/format.h>

#include "dem/registry/catalog.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/campaign/model/words.h"
#include "server/report/html/sections.h"
#include "server/report/text/html.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

std::string Entry(const std::string& term, const std::string& text) {
  return fmt::format("<dt>{}</dt><dd>{}</dd>\n", Escape(term), Escape(text));
}

std::string Listed(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "none" : text;
}

std::string NoiseSentence(const campaign::Campaign& campaign) {
  switch (campaign.filter.noise) {
    case inference::NoiseMode::kGiven:
      return "given: the standard deviations stated in the campaign file";
    case inference::NoiseMode::kInferred:
      return "inferred: one variance factor per observable, marginalised";
    case inference::NoiseMode::kEssTarget:
      break;
  }
  return fmt::format("ess_target {}: tempered until that share of the samples counts",
                     campaign.filter.ess_target);
}

std::string SpecimenSentence(const campaign::Experiment& experiment) {
  if (experiment.specimens.empty()) return "runs made elsewhere";
  if (const auto* file = std::get_if<campaign::PackingFile>(&experiment.specimens.front())) {
    const std::string others = campaign::GeneratedFromFile(experiment);
    return fmt::format("packing {} ({} grains){}", file->path, file->packing.x.size(),
                       others.empty() ? "" : "; " + others);
  }
  if (const auto* recipe = std::get_if<dem::PackingRecipe>(&experiment.specimens.front())) {
    return fmt::format("{} generated packing(s) of {} grains, porosity {}",
                       experiment.specimens.size(), recipe->particles, Number(recipe->porosity, 3));
  }
  return "bodies by the test's settings";
}

// What early stopping saved is in the effort; this says what it may have lost.
std::string StoppingSentence(const v1::Posterior& posterior) {
  if (posterior.stopped_early() == 0) return "none";
  std::string text = fmt::format("{} samples; they may have lost {} of the posterior mass together",
                                 posterior.stopped_early(), Number(posterior.stated_loss(), 2));
  if (posterior.has_measured_loss()) {
    text += fmt::format(
        "; audit: {} stopped and run to the end all the same might have held {}, and held {}",
        posterior.audited(), Number(posterior.audited_bound(), 2),
        Number(posterior.measured_loss(), 2));
  }
  return text;
}

}  // namespace

std::string RecordSection(const ReportData& data) {
  const CampaignView& view = data.view;
  const campaign::Campaign& campaign = view.campaign;
  std::string html =
      "<h2>Record</h2>\n<dl>\n" + Entry("campaign", view.status.campaign()) +
      Entry("submitted", DateForPeople(view.status.created_unix_ms())) +
      Entry("model", campaign.precomputed ? "runs made elsewhere" : campaign.model.contact) +
      Entry("shear at unloading", campaign.precomputed
                                      ? "–"
                                      : campaign::WordOf(campaign::kShearUnloadingWords,
                                                         campaign.model.shear_unloading)) +
      Entry("effects", campaign.precomputed && campaign.model.effects.empty()
                           ? "–"
                           : Listed(campaign.model.effects)) +
      Entry("engine", dem::EngineVersion()) + Entry("seed", std::to_string(campaign.seed)) +
      Entry("noise", NoiseSentence(campaign)) +
      Entry("samples", fmt::format("{} per iteration, at most {} iterations", campaign.samples,
                                   campaign.max_iterations)) +
      Entry("stopped early", StoppingSentence(view.posterior)) +
      Entry("effort",
            fmt::format("{} model evaluations, {} core hours", view.posterior.model_evaluations(),
                        Number(view.posterior.core_hours(), 3)));
  for (const campaign::Experiment& experiment : campaign.experiments) {
    html +=
        Entry("experiment " + experiment.name,
              fmt::format("{}; {} readings; {}; {}",
                          experiment.test.empty() ? "–" : NameForPeople(experiment.test),
                          experiment.control.size(), SpecimenSentence(experiment),
                          experiment.role == campaign::Role::kValidate ? "held out" : "fitted"));
  }
  for (const auto& [path, digest] : view.source.files()) {
    html += Entry("file " + path, "SHA-256 " + digest);
  }
  html += "</dl>\n";
  if (!view.source.campaign_file().empty()) {
    html += "<details><summary>The campaign file</summary><pre>" +
            Escape(view.source.campaign_file()) + "</pre></details>\n";
  }
  return html;
}

}  // namespace calib::report
