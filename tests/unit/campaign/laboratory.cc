#include "tests/unit/campaign/laboratory.h"

#include "absl/strings/str_cat.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {

using testing::ReaderOf;

ReadOutcome Read(const Laboratory& lab, CampaignIs is) {
  const bool poured = lab.test == "angle_of_repose" || lab.test == "silo_discharge";
  const std::string yaml = absl::StrCat(
      "name: a\nmodel:\n  contact: hertz_mindlin\n  density: 2600 kg/m^3\n",
      "  effects: [rolling_resistance, viscous_damping]\n",
      "  fixed: {poisson_ratio: 0.2, young_modulus: 5 MPa, rolling_resistance.stiffness: 0.5, ",
      "rolling_resistance.friction: 0.1, viscous_damping.ratio: 0.3}\n",
      "parameters: {friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}}\n",
      "experiments:\n  - name: tx\n    test: ", lab.test, "\n",
      lab.settings.empty() ? "" : "    " + lab.settings + "\n", "    packing: {generate: {",
      poured ? "diameters: {mean: 2 mm, spread: 0.2}, seed: 1, " : "", lab.grains, "}}\n",
      "    data: {file: d.csv, ", lab.data, "}\n    control: ", lab.control,
      "\n    observables: ", lab.observables, "\n",
      "noise: given\ninference: {method: sqmc, samples: 4}\nseed: 7\n");
  return ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf({{"d.csv", lab.file}}), std::nullopt,
                      is);
}

std::string ProblemsIn(const ReadOutcome& outcome) {
  std::string text;
  for (const Problem& problem : outcome.problems) text += ToString(problem) + "\n";
  return text;
}

std::string WarningsIn(const ReadOutcome& outcome) {
  std::string text;
  for (const Warning& warning : outcome.warnings) {
    absl::StrAppend(&text, WordOf(kWarningKindWords, warning.kind), " ", Sentence(warning), "\n");
  }
  return text;
}

std::string OnlyWarning(const ReadOutcome& outcome) {
  if (!outcome.problems.empty()) return ProblemsIn(outcome);
  if (outcome.warnings.size() != 1) return WarningsIn(outcome);
  return absl::StrCat(WordOf(kWarningKindWords, outcome.warnings[0].kind), " ",
                      outcome.warnings[0].name);
}

std::string KindOfProblem(const ReadOutcome& outcome) {
  return outcome.problems.size() == 1 ? outcome.problems[0].kind : ProblemsIn(outcome);
}

const MeasuredObservable& First(const ReadOutcome& outcome) {
  return outcome.campaign.experiments.at(0).observables.at(0);
}

}  // namespace calib::campaign
