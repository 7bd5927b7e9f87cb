#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dem/registry/catalog.h"
#include "server/campaign/model/words.h"
#include "server/messages/read_words.h"
#include "server/report/documents/record.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

std::string Listed(const std::vector<std::string>& parts) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  }
  return text;
}

// Numbers references in the order in which they are cited first.
class Citations {
 public:
  std::string Cite(const std::string& reference) {
    const auto found = std::find(references_.begin(), references_.end(), reference);
    const auto index = found - references_.begin();
    if (found == references_.end()) references_.push_back(reference);
    return fmt::format(" [{}]", index + 1);
  }
  std::vector<std::string> Take() { return std::move(references_); }

 private:
  std::vector<std::string> references_;
};

std::string PriorInWords(const campaign::CalibratedParameter& p) {
  const auto shown = [&p](double value) { return NumberWithUnit(value, p.name, p.unit, 4); };
  const inference::Prior& prior = p.prior;
  std::string bounds = std::isfinite(prior.min) && std::isfinite(prior.max)
                           ? fmt::format("from {} to {}", shown(prior.min), shown(prior.max))
                           : "";
  const std::string inside = bounds.empty() ? "" : ", " + bounds;
  switch (prior.kind) {
    case inference::PriorKind::kUniform:
      return "uniform " + bounds;
    case inference::PriorKind::kLogUniform:
      return "log-uniform " + bounds;
    case inference::PriorKind::kNormal:
      return fmt::format("normal, {} ± {}{}", shown(prior.mean), shown(prior.sd), inside);
    case inference::PriorKind::kLogNormal:
      return fmt::format("log-normal about {}, sd of the logarithm {}{}",
                         shown(std::exp(prior.mean)), Number(prior.sd, 3), inside);
  }
  return bounds;
}

std::string PopulationSentence(const campaign::Campaign& campaign,
                               const campaign::Population& population) {
  const campaign::CalibratedParameter& spread = campaign.parameters[population.spread];
  return fmt::format(
      "{} has a value for each {} ({}), normally distributed about this common one; the prior of "
      "the standard deviation is half normal, of sd {}.",
      NameForPeople(population.name), campaign::WordOf(campaign::kPerWords, population.per),
      Listed(population.labels),
      NumberWithUnit(spread.prior.sd, population.name, population.unit, 4));
}

std::string ModelSentence(const campaign::Campaign& campaign, Citations& cited) {
  if (campaign.precomputed) {
    return fmt::format("The model was known by {} runs made beforehand.",
                       campaign.precomputed->parameters.rows());
  }
  if (campaign.program) {
    const campaign::Program& program = *campaign.program;
    std::string text = fmt::format("Simulated by {}", fmt::join(program.command, " "));
    if (!program.version.empty()) text += ", version " + program.version;
    if (!campaign.model.effects.empty()) {
      text += fmt::format(", with {}", fmt::join(campaign.model.effects, ", "));
    }
    return text + ".";
  }
  std::string text = "Simulated by the discrete element method" +
                     cited.Cite(
                         "Cundall PA, Strack ODL (1979) A discrete numerical model for "
                         "granular assemblies. Géotechnique 29:47–65") +
                     " with the contact law " + NameForPeople(campaign.model.contact);
  const dem::ContactInfo* contact = dem::FindContact(campaign.model.contact);
  if (contact != nullptr && !contact->reference.empty()) text += cited.Cite(contact->reference);
  std::vector<std::string> effects;
  for (const std::string& name : campaign.model.effects) {
    const dem::EffectInfo* effect = dem::FindEffect(name);
    effects.push_back(NameForPeople(name) + (effect == nullptr || effect->reference.empty()
                                                 ? ""
                                                 : cited.Cite(effect->reference)));
  }
  if (!effects.empty()) text += ", and " + Listed(effects);
  return text + fmt::format(" (calib, mechanics {}).", dem::EngineVersion());
}

std::string DataSentence(const campaign::Campaign& campaign) {
  std::vector<std::string> fitted, held_out;
  for (const campaign::Experiment& e : campaign.experiments) {
    std::size_t readings = 0;
    for (const auto& observable : e.observables) readings += campaign::ReadingsOf(observable);
    std::string one = e.test.empty() ? e.name : e.name + " (" + NameForPeople(e.test) + ")";
    one += fmt::format(", {} readings", readings);
    (e.role == campaign::Role::kValidate ? held_out : fitted).push_back(std::move(one));
  }
  std::string text = "Fitted to " + Listed(fitted);
  if (!held_out.empty()) text += "; held out of every fit and choice: " + Listed(held_out);
  return text + ".";
}

std::string ErrorSentence(const campaign::Campaign& campaign) {
  switch (campaign.filter.noise) {
    case inference::NoiseMode::kGiven:
      return "Errors of readings are normal with the standard deviations stated; the scatter "
             "between packings adds to them where it is known.";
    case inference::NoiseMode::kInferred:
      return "The variance of the errors was inferred, one factor per observable, and "
             "marginalised.";
    case inference::NoiseMode::kModelError:
      return "Errors of readings are normal with the standard deviations stated; an error of the "
             "model beside them was inferred and marginalised.";
    case inference::NoiseMode::kEssTarget:
      break;
  }
  return fmt::format(
      "The variance of the errors was chosen so that an effective share of {} of the samples "
      "counts; it states no error of the measurement.",
      campaign.filter.ess_target);
}

std::string MethodSentence(const CampaignView& view, Citations& cited) {
  const campaign::Campaign& campaign = view.campaign;
  const std::string runs = fmt::format("{} model evaluations, seed {}",
                                       view.posterior.model_evaluations(), campaign.seed);
  const campaign::MethodInWords method =
      campaign.method->InWords(campaign, view.posterior.iterations());
  if (!method.name.empty()) {
    std::string cites;
    for (const std::string& reference : method.references) cites += cited.Cite(reference);
    return fmt::format("{}{}{}; {}.", method.name, cites, method.detail, runs);
  }
  return fmt::format("A table of {} parameter sets was run.", view.samples.size());
}

const char* SourceSentence(const v1::Posterior& posterior) {
  switch (messages::SourceOf(posterior).value_or(campaign::PosteriorSource::kNone)) {
    case campaign::PosteriorSource::kEmulator:
      return "The posterior was sampled on an emulator of these runs, whose error is part of it.";
    case campaign::PosteriorSource::kWeights:
    case campaign::PosteriorSource::kTmcmc:
      return "The posterior is that of the runs themselves.";
    case campaign::PosteriorSource::kNone:
      break;
  }
  return "";
}

}  // namespace

Methods MethodsOf(const CampaignView& view) {
  Citations cited;
  Methods methods;
  const campaign::Campaign& campaign = view.campaign;
  const auto say = [&methods](std::string sentence) {
    if (!sentence.empty()) methods.sentences.push_back(std::move(sentence));
  };
  say(ModelSentence(campaign, cited));
  std::vector<std::string> priors;
  for (const auto& p : campaign.parameters) {
    if (p.of_population) continue;
    priors.push_back(NameForPeople(p.name) + " (" + PriorInWords(p) +
                     (p.nuisance ? "; nuisance)" : ")"));
  }
  if (!priors.empty()) say("Calibrated, with these priors: " + Listed(priors) + ".");
  for (const campaign::Population& population : campaign.populations) {
    say(PopulationSentence(campaign, population));
  }
  std::vector<std::string> tied;
  tied.reserve(campaign.tied.size());
  for (const auto& t : campaign.tied) tied.push_back(NameForPeople(t.name) + " = " + t.text);
  if (!tied.empty()) say("Tied to others: " + Listed(tied) + ".");
  std::vector<std::string> fixed;
  fixed.reserve(campaign.model.parameters.size());
  for (const auto& [name, value] : campaign.model.parameters) {
    fixed.push_back(NameForPeople(name) + " = " + Number(value));
  }
  if (!fixed.empty()) say("Held fixed (SI): " + Listed(fixed) + ".");
  say(DataSentence(campaign));
  if (!campaign::RunsRowsOnly(campaign)) say(ErrorSentence(campaign));
  say(MethodSentence(view, cited));
  if (view.posterior.parameters_size() > 0) say(SourceSentence(view.posterior));
  methods.references = cited.Take();
  return methods;
}

}  // namespace calib::report
