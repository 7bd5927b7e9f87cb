#include "server/ctl/prediction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/catalog/catalog.h"
#include "server/campaign/campaign_file.h"
#include "server/campaign/derive.h"
#include "server/campaign/quantity.h"
#include "server/campaign/sha256.h"
#include "server/campaign/suggestion.h"
#include "server/campaign/yaml_text.h"
#include "server/ctl/text_table.h"
#include "server/report/discrepancies.h"
#include "server/report/people_units.h"

namespace calib::ctl {
namespace {

using campaign::YamlNode;
using Eigen::Index;
using Kind = YamlNode::Kind;
using Json = nlohmann::json;

constexpr int kMostReadings = 10000;
constexpr double kStays = 0.95;  // probability of a discrepancy that is spoken of

absl::StatusOr<std::string> ReadText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::InvalidArgumentError(absl::StrCat(path, ": no such file"));
  return std::string(std::istreambuf_iterator<char>(file), {});
}

absl::Status ProblemIn(const std::string& path, int line, const std::string& text) {
  return absl::InvalidArgumentError(absl::StrCat(path, ":", line, ": ", text));
}

// control: {column, to, readings} as a table of its own.
absl::Status SpellOutControl(const std::string& path, YamlNode& experiment,
                             std::map<std::string, std::string>& files) {
  const YamlNode* control = campaign::YamlFind(experiment, "control");
  const YamlNode* to = control != nullptr ? campaign::YamlFind(*control, "to") : nullptr;
  if (to == nullptr) return absl::OkStatus();
  const YamlNode* column = campaign::YamlFind(*control, "column");
  const YamlNode* readings = campaign::YamlFind(*control, "readings");
  if (campaign::YamlFind(experiment, "data") != nullptr) {
    return ProblemIn(path, control->line,
                     "control.to stands for the readings of a file; give data or to, not both");
  }
  const std::string name = column != nullptr ? column->scalar : "";
  const dem::ObservableInfo* info = dem::FindObservable(name);
  if (info == nullptr) {
    return ProblemIn(path, control->line,
                     "control.column names what drives the test, e.g. axial_strain");
  }
  const auto end = campaign::ParseQuantity(to->scalar, info->unit);
  if (!end.ok()) {
    return ProblemIn(path, to->line,
                     absl::StrCat("control.to: ", std::string(end.status().message())));
  }
  int count = 20;
  if (readings != nullptr) {
    const auto number = campaign::ParseQuantity(readings->scalar, "1");
    if (!number.ok() || *number != std::floor(*number) || *number < 1 || *number > kMostReadings) {
      return ProblemIn(
          path, readings->line,
          absl::StrCat("control.readings is a whole number from 1 to ", kMostReadings));
    }
    count = static_cast<int>(*number);
  }
  std::string table = name + "\n";
  for (int i = 1; i <= count; ++i) table += fmt::format("{:.17g}\n", *end * i / count);
  const std::string file =
      absl::StrCat("control-", campaign::Sha256Hex(table).substr(0, 16), ".csv");
  campaign::YamlAt(experiment, "data") = campaign::YamlMap(
      {{"file", campaign::YamlScalar(file)}, {"strain", campaign::YamlScalar("logarithmic")}});
  campaign::YamlAt(experiment, "control") = campaign::YamlScalar(name);
  files[file] = table;
  return absl::OkStatus();
}

// Draws of the posterior, row by row, with the sample each run is to be like.
struct Draws {
  Eigen::MatrixXd parameters;
  std::vector<int> like;
};

Draws DrawsOf(const report::CampaignView& parent, int wanted) {
  const auto d = static_cast<Index>(parent.campaign.parameters.size());
  Draws draws;
  if (parent.posterior.draws_size() > 0) {
    const Index n = parent.posterior.draws_size() / d;
    const Index count = std::min<Index>(wanted, n);
    draws.parameters.resize(count, d);
    for (Index i = 0; i < count; ++i) {
      for (Index j = 0; j < d; ++j) {
        draws.parameters(i, j) = parent.posterior.draws(static_cast<int>((i * n / count) * d + j));
      }
      draws.like.push_back(static_cast<int>(i));
    }
    return draws;
  }
  // Systematic resampling of the weighted samples.
  double total = 0;
  for (const v1::Sample& sample : parent.samples) {
    if (sample.weight() > 0) total += sample.weight();
  }
  std::vector<const v1::Sample*> chosen;
  double mass = 0;
  for (const v1::Sample& sample : parent.samples) {
    if (!(sample.weight() > 0) || sample.parameters_size() != d) continue;
    mass += sample.weight() / total * wanted;
    while (static_cast<double>(chosen.size()) + 0.5 < mass) chosen.push_back(&sample);
  }
  draws.parameters.resize(static_cast<Index>(chosen.size()), d);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    for (Index j = 0; j < d; ++j) {
      draws.parameters(static_cast<Index>(i), j) = chosen[i]->parameters(static_cast<int>(j));
    }
    draws.like.push_back(static_cast<int>(i));
  }
  return draws;
}

struct Level {
  std::string observable;
  double value = 0;
};

absl::StatusOr<std::vector<Level>> ReadLevels(const std::vector<std::string>& texts,
                                              const campaign::Campaign& predicted) {
  std::vector<std::string> known;
  for (const campaign::Experiment& e : predicted.experiments) {
    for (const campaign::MeasuredObservable& o : e.observables) known.push_back(o.name);
  }
  std::vector<Level> levels;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    const std::string name = text.substr(0, equals);
    if (equals == std::string::npos || std::find(known.begin(), known.end(), name) == known.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", campaign::Quoted(text),
                       " is not OBSERVABLE=LEVEL with an observable of the test: ",
                       campaign::Suggestion(name, known)));
    }
    const dem::ObservableInfo* info = dem::FindObservable(name);
    const auto value =
        campaign::ParseQuantity(text.substr(equals + 1), info != nullptr ? info->unit : "1");
    if (!value.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", name, ": ", std::string(value.status().message())));
    }
    levels.push_back({name, *value});
  }
  return levels;
}

// Runs x readings of one observable; rows of runs that did not finish are left out.
struct RunsOfObservable {
  Eigen::MatrixXd parameters, values;
};

RunsOfObservable Collect(const report::CampaignView& view, const campaign::Experiment& experiment,
                         const std::string& observable) {
  const auto t = static_cast<Index>(experiment.control.size());
  const auto d = static_cast<Index>(view.campaign.parameters.size());
  RunsOfObservable runs{.parameters = Eigen::MatrixXd(0, d), .values = Eigen::MatrixXd(0, t)};
  for (const v1::Sample& sample : view.samples) {
    const auto found = view.states.find({experiment.name, sample.index()});
    if (found == view.states.end() || sample.parameters_size() != d) continue;
    const auto& names = found->second.observables;
    const auto at = std::find(names.begin(), names.end(), observable) - names.begin();
    Eigen::RowVectorXd row = Eigen::RowVectorXd::Constant(t, std::nan(""));
    for (const v1::State& state : found->second.states) {
      if (state.load_step() < t && at < state.values_size()) {
        row[state.load_step()] = state.values(static_cast<int>(at));
      }
    }
    if (!row.allFinite()) continue;
    runs.parameters.conservativeResize(runs.parameters.rows() + 1, d);
    runs.values.conservativeResize(runs.values.rows() + 1, t);
    for (Index j = 0; j < d; ++j) {
      const auto index = static_cast<std::size_t>(j);
      runs.parameters(runs.parameters.rows() - 1, j) =
          view.campaign.parameters[index].prior.ToStandard(sample.parameters(static_cast<int>(j)));
    }
    runs.values.row(runs.values.rows() - 1) = row;
  }
  return runs;
}

std::string UnitOf(const std::string& observable) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return info != nullptr ? info->unit : "1";
}

// What the model is known to miss where it was calibrated.
struct Misfit {
  const report::CampaignView* parent = nullptr;
  std::vector<report::FittedDiscrepancy> discrepancies;
};

absl::Status AddExperiment(const report::CampaignView& view, const campaign::Experiment& experiment,
                           const std::vector<Level>& levels, const Misfit& misfit,
                           Prediction& prediction) {
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    const RunsOfObservable runs = Collect(view, experiment, observable.name);
    const auto t = static_cast<Index>(experiment.control.size());
    if (runs.values.rows() < 2) {
      return absl::FailedPreconditionError(
          absl::StrCat("fewer than two of ", view.samples.size(), " runs of ", experiment.name,
                       " have finished: nothing can be predicted from them"));
    }
    Eigen::VectorXd error = Eigen::VectorXd::Zero(t);
    if (!observable.sd.empty()) error = Eigen::Map<const Eigen::VectorXd>(observable.sd.data(), t);
    auto quantity = inference::PredictQuantity(runs.parameters, runs.values, error);
    if (!quantity.ok()) return quantity.status();
    inference::DiscrepancyBand discrepancy = report::DiscrepancyAt(
        *misfit.parent, misfit.discrepancies, experiment, observable.name, quantity->mean);
    if (discrepancy.mean.size() > 0) {
      quantity = inference::WithModelError(*std::move(quantity), discrepancy.rms);
    }
    PredictedObservable out{.experiment = experiment.name,
                            .observable = observable.name,
                            .control_name = experiment.control_name,
                            .control = experiment.control,
                            .quantity = *std::move(quantity),
                            .measured = observable.values,
                            .discrepancy = std::move(discrepancy),
                            .exceedance = {}};
    for (const Level& level : levels) {
      if (level.observable != observable.name) continue;
      const auto reach = (runs.values.array() >= level.value).rowwise().any().count();
      out.exceedance.push_back(
          {.level = level.value,
           .probability = inference::ExceedanceProbability(out.quantity, level.value),
           .anywhere = static_cast<double>(reach) / static_cast<double>(runs.values.rows())});
    }
    prediction.runs = static_cast<int>(runs.values.rows());
    prediction.failed =
        std::max(prediction.failed, static_cast<int>(view.samples.size()) - prediction.runs);
    prediction.observables.push_back(std::move(out));
  }
  return absl::OkStatus();
}

Json At(const Eigen::VectorXd& values, Index k) {
  return k < values.size() ? Json(values[k]) : Json(nullptr);
}

Json OrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

absl::StatusOr<PredictedTests> ReadTests(Client& client, const std::string& path,
                                         const report::CampaignView& parent) {
  const auto text = ReadText(path);
  if (!text.ok()) return text.status();
  campaign::YamlParse parse = campaign::ParseYaml(*text);
  if (parse.error) return ProblemIn(path, parse.error->line, parse.error->message);
  if (parse.root->kind != Kind::kMap) {
    return ProblemIn(path, 1, "is no map; one experiment, or a map with experiments, is expected");
  }
  PredictedTests tests;
  YamlNode list;
  if (const YamlNode* given = campaign::YamlFind(*parse.root, "experiments"); given != nullptr) {
    if (given->kind != Kind::kSequence || given->items.empty()) {
      return ProblemIn(path, given->line, "experiments is no list with at least one experiment");
    }
    list = *given;
  } else if (campaign::YamlFind(*parse.root, "test") != nullptr) {
    list = campaign::YamlList({*parse.root});
  } else {
    return ProblemIn(
        path, 1, "has neither the key test (of one experiment) nor experiments (a list of them)");
  }
  campaign::YamlParse own = campaign::ParseYaml(parent.source.campaign_file());
  const YamlNode* first = own.error ? nullptr : campaign::YamlFind(*own.root, "experiments");
  for (YamlNode& experiment : list.items) {
    if (experiment.kind != Kind::kMap) return ProblemIn(path, experiment.line, "is no experiment");
    campaign::YamlErase(experiment, "role");
    if (auto spelled = SpellOutControl(path, experiment, tests.files); !spelled.ok()) {
      return spelled;
    }
    for (const char* key : {"packing", "realizations"}) {
      const YamlNode* inherited = first != nullptr && !first->items.empty()
                                      ? campaign::YamlFind(first->items.front(), key)
                                      : nullptr;
      const bool has_packing =
          campaign::YamlFind(experiment, "packing") != nullptr && std::string(key) == "packing";
      if (has_packing) break;
      if (inherited != nullptr && campaign::YamlFind(experiment, key) == nullptr) {
        campaign::YamlAt(experiment, key) = *inherited;
      }
    }
  }
  tests.experiments = list.items;
  // Whatever the experiments name is read once, so that problems are found here and files travel.
  const auto derived =
      campaign::Derive(parent.source.campaign_file(),
                       {.name = "prediction",
                        .lineage = {.parent = parent.status.campaign(), .purpose = "prediction"},
                        .experiments = tests.experiments,
                        .rows = {{.like = 0, .values = [&parent] {
                                    std::map<std::string, double> values;
                                    for (const auto& p : parent.campaign.parameters) {
                                      values[p.name] = p.prior.Quantile(0.5);
                                    }
                                    return values;
                                  }()}}});
  if (!derived.ok()) return derived.status();
  const campaign::FileReader disk = campaign::DiskReader(path);
  std::map<std::string, std::string>& files = tests.files;
  const campaign::FileReader reader = [&](const std::string& name) -> absl::StatusOr<std::string> {
    if (const auto known = files.find(name); known != files.end()) return known->second;
    auto content = disk(name);
    if (content.ok()) files[name] = *content;
    const auto inherited = parent.source.files().find(name);
    if (!content.ok() && inherited != parent.source.files().end()) {
      return client.GetBlob(inherited->second);
    }
    return content;
  };
  const campaign::ReadOutcome outcome = campaign::ReadCampaign(*derived, path, reader);
  std::vector<std::string> lines;
  for (campaign::Problem problem : outcome.problems) {
    problem.line = 0;  // of a text the user has not written
    lines.push_back(campaign::ToString(problem));
  }
  if (!lines.empty()) return absl::InvalidArgumentError(absl::StrJoin(lines, "\n"));
  return tests;
}

absl::StatusOr<Prediction> Predict(Laboratory& laboratory, const report::CampaignView& parent,
                                   const PredictedTests& tests, const PredictionOptions& options) {
  const std::string& id = parent.status.campaign();
  if (parent.campaign.precomputed) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the runs of ", id, " were made elsewhere: there is no model to run another test with"));
  }
  if (parent.posterior.posterior_from().empty() || parent.posterior.posterior_from() == "none") {
    return absl::FailedPreconditionError(absl::StrCat(
        "campaign ", id, " has no posterior to predict from: see `calibctl posterior ", id, "`"));
  }
  const Draws draws = DrawsOf(parent, options.draws);
  campaign::Derivation derivation{.name = absl::StrCat(parent.campaign.name, ": prediction"),
                                  .lineage = {.parent = id, .purpose = "prediction"},
                                  .experiments = tests.experiments};
  for (Index i = 0; i < draws.parameters.rows(); ++i) {
    campaign::Derivation::Row row{.like = draws.like[static_cast<std::size_t>(i)], .values = {}};
    for (std::size_t j = 0; j < parent.campaign.parameters.size(); ++j) {
      row.values[parent.campaign.parameters[j].name] = draws.parameters(i, static_cast<Index>(j));
    }
    derivation.rows.push_back(std::move(row));
  }
  const auto text = campaign::Derive(parent.source.campaign_file(), derivation);
  if (!text.ok()) return text.status();
  const auto view = laboratory.Run(parent, *text, "prediction", tests.files);
  if (!view.ok()) return view.status();
  const auto levels = ReadLevels(options.exceed, view->campaign);
  if (!levels.ok()) return levels.status();

  Prediction prediction;
  prediction.parent = id;
  prediction.campaign = view->status.campaign();
  const Misfit misfit{
      .parent = &parent,
      .discrepancies = report::FitDiscrepancies(parent, report::PredictReadings(parent))};
  bool errors = true;
  bool separated = true;
  for (const campaign::Experiment& experiment : view->campaign.experiments) {
    if (auto added = AddExperiment(*view, experiment, *levels, misfit, prediction); !added.ok()) {
      return added;
    }
    for (const auto& observable : experiment.observables) errors &= !observable.sd.empty();
  }
  for (const PredictedObservable& o : prediction.observables) separated &= o.quantity.separated;
  if (!errors) {
    prediction.notes.emplace_back(
        "Where the test states no noise of an observable, its prediction is that of a perfectly "
        "measured specimen.");
  }
  for (const PredictedObservable& o : prediction.observables) {
    if (o.discrepancy.mean.size() == 0) {
      prediction.notes.push_back(absl::StrCat(
          o.experiment, ", ", o.observable, ": the campaign was not fitted to it along ",
          o.control_name,
          " with stated errors, so that nothing is known of what the model misses there."));
    }
  }
  for (const report::FittedDiscrepancy& d : misfit.discrepancies) {
    if (d.fit.probability() > kStays) {
      prediction.notes.push_back(
          absl::StrCat(d.observable,
                       ": the model misses the fitted measurements by a smooth misfit beyond noise "
                       "and scatter (see `calibctl compare ",
                       id, "`); it is carried as model error here."));
    }
  }
  if (!separated) {
    prediction.notes.emplace_back(
        "Too few runs to tell the uncertainty of the parameters from the scatter of packings: "
        "use more --draws.");
  }
  if (prediction.failed > 0) {
    prediction.notes.push_back(absl::StrCat(prediction.failed, " of ", view->samples.size(),
                                            " runs did not finish and are left out."));
  }
  return prediction;
}

std::string PredictionJson(const Prediction& prediction) {
  Json observables = Json::array();
  for (const PredictedObservable& o : prediction.observables) {
    Json points = Json::array();
    for (std::size_t i = 0; i < o.control.size(); ++i) {
      const auto k = static_cast<Index>(i);
      points.push_back({{"load_step", i},
                        {"control", o.control[i]},
                        {"mean", o.quantity.mean[k]},
                        {"sd", o.quantity.sd[k]},
                        {"q05", o.quantity.q05[k]},
                        {"q50", o.quantity.q50[k]},
                        {"q95", o.quantity.q95[k]},
                        {"sd_parameters", OrNull(o.quantity.sd_parameters[k])},
                        {"sd_model_error", OrNull(o.quantity.sd_model[k])},
                        {"sd_discrepancy", At(o.discrepancy.rms, k)},
                        {"discrepancy_mean", At(o.discrepancy.mean, k)},
                        {"measured", o.measured.empty() ? Json(nullptr) : Json(o.measured[i])}});
    }
    Json exceedance = Json::array();
    for (const auto& e : o.exceedance) {
      exceedance.push_back(
          {{"level", e.level},
           {"probability", std::vector<double>(e.probability.begin(), e.probability.end())},
           {"anywhere", e.anywhere}});
    }
    observables.push_back({{"experiment", o.experiment},
                           {"observable", o.observable},
                           {"unit", UnitOf(o.observable)},
                           {"control", o.control_name},
                           {"points", points},
                           {"exceedance", exceedance}});
  }
  return Json{{"campaign", prediction.parent},
              {"prediction", prediction.campaign},
              {"runs", prediction.runs},
              {"predictions", observables},
              {"notes", prediction.notes}}
             .dump(2) +
         "\n";
}

std::string PredictionText(const Prediction& prediction) {
  std::string text = fmt::format("Prediction {} from the posterior of {}: {} runs.\n",
                                 prediction.campaign, prediction.parent, prediction.runs);
  for (const PredictedObservable& o : prediction.observables) {
    TextTable table({o.control_name, "mean", "5 %", "95 %", "± parameters", "± model", "measured"});
    const std::string unit = UnitOf(o.observable);
    const auto shown = [&](double value) {
      return std::isfinite(value) ? report::NumberWithUnit(value, o.observable, unit, 4) : "–";
    };
    for (std::size_t i = 0; i < o.control.size(); ++i) {
      const auto k = static_cast<Index>(i);
      table.AddRow({report::NumberWithUnit(o.control[i], o.control_name, UnitOf(o.control_name), 4),
                    shown(o.quantity.mean[k]), shown(o.quantity.q05[k]), shown(o.quantity.q95[k]),
                    shown(o.quantity.sd_parameters[k]), shown(o.quantity.sd_model[k]),
                    o.measured.empty() ? "–" : shown(o.measured[i])});
    }
    text += fmt::format("\n{}, {}\n{}", o.experiment, o.observable, table.ToString());
    for (const auto& e : o.exceedance) {
      text += fmt::format("Probability to exceed {}: at most {} at a reading, {} of the runs do.\n",
                          shown(e.level), report::Number(e.probability.maxCoeff(), 3),
                          report::Percent(e.anywhere, 3));
    }
  }
  for (const std::string& note : prediction.notes) text += "! " + note + "\n";
  return text;
}

}  // namespace calib::ctl
