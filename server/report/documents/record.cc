#include "server/report/documents/record.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "dem/registry/catalog.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/campaign/model/words.h"
#include "server/report/documents/json_text.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

using Json = nlohmann::ordered_json;

std::string NamesOf(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + NameForPeople(word);
  return text.empty() ? "none" : text;
}

std::string NoiseInWords(const campaign::Campaign& campaign) {
  switch (campaign.filter.noise) {
    case inference::NoiseMode::kGiven:
      return "given: the standard deviations stated in the campaign file";
    case inference::NoiseMode::kInferred:
      return "inferred: one variance factor per observable, marginalised";
    case inference::NoiseMode::kModelError:
      return "given, and an inferred error of the model beside it, marginalised";
    case inference::NoiseMode::kEssTarget:
      break;
  }
  return fmt::format("ess_target {}: tempered until that share of the samples counts",
                     campaign.filter.ess_target);
}

std::string SpecimenInWords(const campaign::Experiment& experiment) {
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
  if (std::holds_alternative<campaign::ProgramSpecimen>(experiment.specimens.front())) {
    return fmt::format("{} realization(s)", experiment.specimens.size());
  }
  return "bodies by the test's settings";
}

// A program, and by what its files and version are known.
std::string ProgramInWords(const campaign::Program& program) {
  std::string text = fmt::format("{}", fmt::join(program.command, " "));
  if (!program.version.empty()) text += ", version " + program.version;
  constexpr std::size_t kShown = 12;  // of a digest: tells files apart
  for (const campaign::ProgramFile& file : program.files) {
    text += fmt::format("; {} {}", file.name, file.digest.substr(0, kShown));
  }
  return text;
}

// What early stopping saved is in the effort; this says what it may have lost.
std::string StoppingInWords(const v1::Posterior& posterior) {
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

Json Entries(const CampaignView& view) {
  const campaign::Campaign& campaign = view.campaign;
  Json entries = Json::array();
  const auto add = [&entries](const std::string& term, const std::string& text) {
    entries.push_back({term, text});
  };
  add("campaign", view.status.campaign());
  add("submitted", DateForPeople(view.status.created_unix_ms()));
  if (campaign.precomputed) {
    add("model", "runs made elsewhere");
  } else if (campaign.program) {
    add("model", ProgramInWords(*campaign.program));
    if (!campaign.model.effects.empty()) add("effects", NamesOf(campaign.model.effects));
  } else {
    add("contact law", NameForPeople(campaign.model.contact));
    add("shear at unloading", NameForPeople(campaign::WordOf(campaign::kShearUnloadingWords,
                                                             campaign.model.shear_unloading)));
    add("effects", NamesOf(campaign.model.effects));
    add("engine", dem::EngineVersion());
  }
  add("seed", std::to_string(campaign.seed));
  if (!campaign::RunsRowsOnly(campaign)) {
    add("errors", NoiseInWords(campaign));
    add("samples", campaign.method->RunsInWords(campaign));
    add("stopped early", StoppingInWords(view.posterior));
  }
  add("effort", fmt::format("{} model evaluations, {} core hours", view.status.model_evaluations(),
                            Number(view.status.core_hours(), 3)));
  for (const campaign::Experiment& experiment : campaign.experiments) {
    add("experiment " + experiment.name,
        fmt::format("{}; {} readings; {}; {}",
                    experiment.test.empty() ? "–" : NameForPeople(experiment.test),
                    experiment.control.size(), SpecimenInWords(experiment),
                    experiment.role == campaign::Role::kValidate ? "held out" : "fitted"));
  }
  return entries;
}

Json Iterations(const CampaignView& view) {
  Json iterations = Json::array();
  for (const v1::Posterior& p : view.iterations) {
    Json parameters = Json::object();
    for (const auto& q : p.parameters()) {
      parameters[q.name()] = {
          {"mean", q.mean()}, {"q05", q.q05()}, {"q95", q.q95()}, {"unit", q.unit()}};
    }
    iterations.push_back({{"iteration", p.iteration()},
                          {"ess", p.ess()},
                          {"pareto_k", p.pareto_k()},
                          {"log_evidence", p.log_evidence()},
                          {"log_evidence_se", p.log_evidence_se()},
                          {"model_evaluations", p.model_evaluations()},
                          {"parameters", parameters}});
  }
  return iterations;
}

}  // namespace

std::string RecordJson(const CampaignView& view) {
  Json files = Json::array();
  for (const auto& [path, digest] : view.source.files()) {
    files.push_back({{"path", path}, {"sha256", digest}});
  }
  const Methods methods = MethodsOf(view);
  const Json json = {
      {"campaign", view.status.campaign()},
      {"entries", Entries(view)},
      {"files", files},
      {"campaign_file", view.source.campaign_file()},
      {"iterations", Iterations(view)},
      {"methods", {{"sentences", methods.sentences}, {"references", methods.references}}},
      {"latex", LatexTable(view)}};
  return Dump(json);
}

}  // namespace calib::report
