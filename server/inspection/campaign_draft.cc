#include "server/inspection/campaign_draft.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/test_ties.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/inspection/header_words.h"
#include "server/inspection/numbers.h"
#include "server/methods/registry.h"

namespace calib::inspection {
namespace {

using campaign::Quoted;

// Of a reading's range, by which two specimens of one sand differ [-]: the scatter of nine drained
// tests about a plane in density and pressure is 2 % of peak q/p and of volumetric strain
// [Wichtmann & Triantafyllidis 2016, data].
constexpr double kSpecimenScatter = 0.02;
// Of the path, over which such errors go together [-]. Chosen: a specimen is strong or weak for as
// long as a stage lasts.
constexpr double kErrorsTogether = 0.1;
// Void ratios that every recipe of spheres of this spread reaches: the generator finds porosities
// of 0.354 to 0.434 attainable with 400 grains, and stays clear of both ends.
constexpr double kDensest = 0.56;
constexpr double kLoosest = 0.72;
// Young's modulus over confining pressure [-]: softer grains overlap by more than some per cent,
// stiffer ones only cost time [Agnolin & Roux 2007].
constexpr double kSoftest = 1e3;
constexpr double kStiffest = 2e4;
constexpr double kUsualPressure = 100e3;  // [Pa], where nothing says it
constexpr int kSamples = 40;
constexpr int kIterations = 3;
constexpr int kGrains = 400;

// What readings are compared by, the ones that no other follows from first.
constexpr const char* kPreferred[] = {"q_over_p",       "stress_ratio",       "deviatoric_stress",
                                      "axial_stress",   "shear_stress",       "shear_stress_ratio",
                                      "mean_stress",    "volumetric_strain",  "lateral_strain",
                                      "void_ratio",     "porosity",           "pore_pressure",
                                      "lateral_stress", "coordination_number"};

std::string YamlText(const std::string& text) {
  const bool plain = !text.empty() && std::isalpha(static_cast<unsigned char>(text.front())) != 0 &&
                     std::all_of(text.begin(), text.end(), [](unsigned char c) {
                       return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '/';
                     });
  const std::set<std::string> words = {"true", "false", "yes", "no", "on",   "off",   "null",
                                       "y",    "n",     "Y",   "N",  "True", "False", "NaN"};
  if (plain && !words.contains(text)) return text;
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string PathFrom(const std::string& campaign_file, const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder = fs::absolute(campaign_file, error).parent_path();
  const fs::path relative = fs::proximate(fs::absolute(file, error), folder, error);
  return error ? file : relative.generic_string();
}

std::string ExperimentName(const std::string& wanted, std::set<std::string>& taken) {
  std::string name;
  constexpr std::size_t kLongest = 50;
  for (const char c : wanted) {
    const bool allowed = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' ||
                         (!name.empty() && (c == '-' || c == '.' || c == '+'));
    if (name.size() < kLongest) name.push_back(allowed ? c : '_');
  }
  if (name.empty()) name = "test";
  std::string unique = name;
  for (int i = 2; !taken.insert(unique).second; ++i) unique = absl::StrCat(name, "_", i);
  return unique;
}

// One experiment of the draft.
class ExperimentDraft {
 public:
  ExperimentDraft(const InspectedFile& file, std::size_t test, const dem::TestInfo& info,
                  const DraftQuestion& question)
      : file_(file), in_(file.inspection), test_(test), info_(info), question_(question) {}

  absl::Status Read() {
    if (!in_.Has(info_.control)) {
      return absl::InvalidArgumentError(absl::StrCat(
          file_.file, " has no column that is known to be ", info_.control, ", which drives ",
          info_.name, "; if it has one, say so: --meaning COLUMN=", info_.control));
    }
    std::vector<std::string> found;
    for (const char* role : kPreferred) {
      const bool given = std::find(info_.observables.begin(), info_.observables.end(), role) !=
                         info_.observables.end();
      if (!given || role == info_.control || !in_.Has(role)) continue;
      if (campaign::IsHeld(info_.name, {}, info_.control, role)) continue;
      if (!(ExtentOf(in_.Values(test_, role)).range() > 0)) continue;
      found.emplace_back(role);
    }
    const auto follows = campaign::WhatTheyFollowFrom(info_.name, {}, info_.control, found);
    // The void ratio follows the volumetric strain from where it began.
    const bool volume = std::find(found.begin(), found.end(), "volumetric_strain") != found.end();
    for (std::size_t i = 0; i < found.size(); ++i) {
      const bool voids =
          found[i] == "void_ratio" || found[i] == "porosity" || found[i] == "lateral_strain";
      if (follows[i].empty() && !(voids && volume)) observables_.push_back(found[i]);
    }
    if (observables_.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(file_.file, " has nothing that ", info_.name,
                       " can be compared by; say what its columns are: --meaning COLUMN=NAME"));
    }
    ReadPressure();
    ReadVoids();
    return absl::OkStatus();
  }

  [[nodiscard]] double pressure() const { return pressure_; }

  [[nodiscard]] std::string Text(const std::string& name) const {
    std::string text = absl::StrCat("  - name: ", YamlText(name), "\n    test: ", info_.name, "\n");
    const bool takes_pressure =
        std::any_of(info_.settings.begin(), info_.settings.end(),
                    [](const auto& setting) { return setting.name == "confining_pressure"; });
    if (takes_pressure) {
      absl::StrAppend(&text,
                      "    confining_pressure: ", campaign::InWords("lateral_stress", pressure_),
                      "  # confirm: ", pressure_from_, "\n");
    }
    absl::StrAppend(
        &text, "    packing:  # confirm: spheres of about the sand's density, not its grains\n",
        "      generate: {particles: ", kGrains, ", void_ratio: ", absl::StrFormat("%.3f", voids_),
        ", radii: {mean: 1 mm, spread: 0.3}, seed: 1}", "  # confirm: ", voids_from_, "\n");
    absl::StrAppend(&text, DataText(), "    control: ", ControlText(), "\n", "    observables:\n");
    for (const std::string& role : observables_) absl::StrAppend(&text, NoiseText(role));
    return text;
  }

 private:
  const InspectedPart& Part() const { return in_.table.parts[test_]; }

  void ReadPressure() {
    const Extent lateral = ExtentOf(in_.Values(test_, "lateral_stress"));
    const std::vector<double> p = in_.Values(test_, "mean_stress");
    const std::vector<double> q = in_.Values(test_, "deviatoric_stress");
    const std::vector<double> axial = in_.Values(test_, "axial_stress");
    if (lateral.count > 0 && lateral.first > 0) {
      Pressure(lateral.first, absl::StrCat("first reading of ", in_.Find("lateral_stress")->name));
    } else if (!p.empty() && !q.empty() && p.front() - q.front() / 3 > 0) {
      Pressure(p.front() - q.front() / 3, "p - q/3 of the first reading");
    } else if (in_.stated_pressure > 0) {
      Pressure(in_.stated_pressure, "as the file or its name states");
    } else if (ExtentOf(p).count > 0 && ExtentOf(p).first > 0) {
      Pressure(ExtentOf(p).first, absl::StrCat("first reading of ", in_.Find("mean_stress")->name));
    } else if (ExtentOf(axial).count > 0 && ExtentOf(axial).first > 0) {
      Pressure(ExtentOf(axial).first,
               absl::StrCat("first reading of ", in_.Find("axial_stress")->name));
    } else {
      Pressure(kUsualPressure, "NOT IN THE FILE: a mere default, write what the test had");
    }
  }
  void Pressure(double value, const std::string& from) {
    constexpr double kDigits = 1e4;  // four of them
    const double scale = std::pow(10, std::floor(std::log10(value)));
    pressure_ = std::round(value / scale * kDigits) / kDigits * scale;
    pressure_from_ = from;
  }

  void ReadVoids() {
    double e = ExtentOf(in_.Values(test_, "void_ratio")).first;
    const double n = ExtentOf(in_.Values(test_, "porosity")).first;
    if (!(e > 0) && n > 0 && n < 1) e = n / (1 - n);
    if (!(e > 0)) {
      voids_ = 0.65;
      voids_from_ = "the file has no void ratio; a medium dense packing";
      return;
    }
    voids_ = std::clamp(e, kDensest, kLoosest);
    voids_from_ = absl::StrCat(
        "measured ", Short(e),
        voids_ == e
            ? ""
            : "; packings of spheres reach 0.55 to 0.75 only: compare at equal relative density");
  }

  [[nodiscard]] std::string DataText() const {
    std::string text = absl::StrCat(
        "    data:\n      file: ", YamlText(PathFrom(question_.campaign_file, file_.file)), "\n");
    if (!question_.sheet.empty())
      absl::StrAppend(&text, "      sheet: ", YamlText(question_.sheet), "\n");
    const campaign::TableFormat& format = Part().format;
    if (format.skip > 0) absl::StrAppend(&text, "      skip: ", format.skip, "\n");
    if (!format.header) absl::StrAppend(&text, "      header: none\n");
    if (format.last_row) absl::StrAppend(&text, "      rows: 1-", *format.last_row, "\n");
    for (const auto& [column, word] : format.where) {
      absl::StrAppend(&text, "      where: {", YamlText(column), ": ", YamlText(word), "}\n");
    }
    std::vector<std::string> columns;
    std::vector<std::string> units;
    std::vector<std::string> signs;
    std::vector<std::string> roles = {info_.control};
    roles.insert(roles.end(), observables_.begin(), observables_.end());
    std::vector<std::string> formulas;
    std::vector<std::string> why;
    for (const std::string& role : roles) {
      if (const DerivedQuantity* derived = in_.FindDerived(role)) {
        columns.push_back(absl::StrCat(role, ": ", derived->name));
        formulas.push_back(absl::StrCat(derived->name, ": ", YamlText(derived->formula)));
        why.push_back(derived->how);
        if (derived->factor != 1)
          units.push_back(absl::StrCat(role, ": ", YamlText(derived->unit)));
        continue;
      }
      const ColumnMeaning& column = *in_.Find(role);
      why.push_back(absl::StrJoin(column.evidence, "; "));
      columns.push_back(absl::StrCat(role, ": ", YamlText(column.name)));
      if (column.factor != 1) {
        units.push_back(absl::StrCat(role, ": ", YamlText(column.unit)));
      }
      if (column.sign < 0) signs.push_back(absl::StrCat(role, ": -1"));
    }
    absl::StrAppend(&text, "      columns:  # confirm each\n");
    for (std::size_t i = 0; i < roles.size(); ++i) {
      absl::StrAppend(&text, "        ", columns[i], "  # ", OneLine(why[i]), "\n");
    }
    if (!formulas.empty()) {
      absl::StrAppend(&text, "      formulas: {", absl::StrJoin(formulas, ", "), "}  # confirm\n");
    }
    if (!units.empty()) absl::StrAppend(&text, "      units: {", absl::StrJoin(units, ", "), "}\n");
    if (!signs.empty()) {
      absl::StrAppend(&text, "      sign: {", absl::StrJoin(signs, ", "),
                      "}  # confirm: compression is positive here\n");
    }
    absl::StrAppend(&text, "      strain: ", in_.logarithmic ? "logarithmic" : "engineering",
                    in_.logarithmic ? "  # by the void ratio\n"
                                    : "  # confirm: as laboratories compute it, or logarithmic\n");
    return text;
  }

  static std::string OneLine(std::string text) {
    for (char& c : text) {
      if (std::iscntrl(static_cast<unsigned char>(c)) != 0) c = ' ';
    }
    return text;
  }

  [[nodiscard]] double Noise(const std::string& role) const {
    if (in_.Find(role) == nullptr) return 0;
    const ColumnMeaning& column = *in_.Find(role);
    const InspectedTest& test = in_.tests[test_];
    const auto at = test.noise.find(column.name);
    return at != test.noise.end() ? at->second * column.factor : 0;
  }

  [[nodiscard]] std::string ControlText() const { return info_.control; }

  [[nodiscard]] std::string NoiseText(const std::string& role) const {
    const double own = Noise(role);
    const double range = ExtentOf(in_.Values(test_, role)).range();
    const double sd = std::max(own, kSpecimenScatter * range);
    const Extent control = ExtentOf(in_.tests[test_].control);
    return absl::StrCat("      ", role, ": {noise: {absolute: ", campaign::InWords(role, sd),
                        ", correlation_length: ",
                        campaign::InWords(info_.control, kErrorsTogether * control.range()),
                        "}}  # confirm: ",
                        own >= sd ? "as neighbouring readings scatter"
                                  : absl::StrCat("2 % of its range, as specimens differ; "
                                                 "neighbouring readings scatter by ",
                                                 campaign::InWords(role, own)),
                        "\n");
  }

  const InspectedFile& file_;
  const Inspection& in_;
  std::size_t test_;
  const dem::TestInfo& info_;
  const DraftQuestion& question_;
  std::vector<std::string> observables_;
  double pressure_ = 0;
  std::string pressure_from_;
  double voids_ = 0;
  std::string voids_from_;
};

// Of the stages of one test the one in which its control goes furthest.
std::vector<std::size_t> TestsToUse(const Inspection& inspection) {
  std::vector<std::size_t> tests;
  tests.reserve(inspection.tests.size());
  for (std::size_t i = 0; i < inspection.tests.size(); ++i) tests.push_back(i);
  if (!inspection.table.names_stages) return tests;
  const auto furthest =
      std::max_element(tests.begin(), tests.end(), [&](std::size_t a, std::size_t b) {
        return ExtentOf(inspection.tests[a].control).range() <
               ExtentOf(inspection.tests[b].control).range();
      });
  return {*furthest};
}

std::string StemOf(const std::string& file) { return std::filesystem::path(file).stem().string(); }

}  // namespace

absl::StatusOr<std::string> CampaignDraft(const std::vector<InspectedFile>& files,
                                          const DraftQuestion& question) {
  const dem::TestInfo* info = dem::FindTest(question.test);
  if (info == nullptr) {
    std::vector<std::string> names;
    names.reserve(dem::Tests().size());
    for (const dem::TestInfo& test : dem::Tests()) names.push_back(test.name);
    return absl::InvalidArgumentError(absl::StrCat("--test: ", Quoted(question.test),
                                                   " is not a lab test; ",
                                                   campaign::Suggestion(question.test, names)));
  }
  if (!dem::InPeriodicCell(*info)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--test: ", info->name,
                     " has settings that no table says, and a campaign is written for tests of a "
                     "specimen alone: triaxial, oedometric, isotropic, simple shear; `calibctl new "
                     "--test ",
                     info->name, " --contact hertz_mindlin` writes one in which they stand"));
  }
  std::string experiments;
  std::set<std::string> taken;
  double least = HUGE_VAL;
  double most = 0;
  for (const InspectedFile& file : files) {
    const bool several = file.inspection.tests.size() > 1 && !file.inspection.table.names_stages;
    for (const std::size_t test : TestsToUse(file.inspection)) {
      ExperimentDraft draft(file, test, *info, question);
      RETURN_IF_ERROR(draft.Read());
      least = std::min(least, draft.pressure());
      most = std::max(most, draft.pressure());
      const std::string wanted = several ? file.inspection.tests[test].name : StemOf(file.file);
      absl::StrAppend(&experiments, draft.Text(ExperimentName(wanted, taken)));
    }
  }
  return absl::StrCat(
      "# Written by calibctl inspect. What is marked \"confirm\" is a guess or a default: see to "
      "it,\n"
      "# then calibctl validate and calibctl run.\n",
      "name: ", YamlText(StemOf(question.campaign_file)),
      "\nmodel:\n"
      "  contact: hertz_mindlin\n"
      "  effects: [rolling_resistance]  # confirm: grains that are no spheres resist rolling\n"
      "  density: 2650000 kg/m^3  # that of quartz a thousandfold: the tests are quasi-static, and "
      "runs are shorter\n"
      "  fixed: {poisson_ratio: 0.2, rolling_resistance.stiffness_ratio: 0.5}  # confirm\n"
      "parameters:  # confirm: what is thought possible before the test is looked at\n"
      "  young_modulus: {prior: log_uniform, min: ",
      Short(kSoftest * least / 1e6), " MPa, max: ", Short(kStiffest * most / 1e6),
      " MPa}  # 1e3 to 2e4 times the confining pressure\n"
      "  friction_coefficient: {prior: uniform, min: 0.1, max: 1.0}\n"
      "  rolling_resistance.friction: {prior: uniform, min: 0.0, max: 0.5}\n"
      "experiments:\n",
      experiments, "noise: given\ninference: {method: ", methods::All().standard()->name(),
      ", samples: ", kSamples, ", max_iterations: ", kIterations, "}\nseed: 1\n");
}

}  // namespace calib::inspection
