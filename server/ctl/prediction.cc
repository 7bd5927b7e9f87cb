#include "server/ctl/prediction.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/excitation.h"
#include "server/messages/read_words.h"
#include "server/methods/registry.h"
#include "server/report/views/discrepancies.h"
#include "server/report/views/warnings.h"

namespace calib::ctl {
namespace {

using Eigen::Index;

constexpr double kStays = 0.95;  // probability of a discrepancy that is spoken of

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

// For each draw the scores of labels that the tests have and the campaign lacks, by name: draws
// from the population of that draw, within its bounds.
std::vector<std::map<std::string, double>> DrawUnseen(const campaign::Campaign& campaign,
                                                      const PredictedTests& tests,
                                                      const Draws& draws) {
  std::vector<std::map<std::string, double>> all(static_cast<std::size_t>(draws.parameters.rows()));
  for (std::size_t k = 0; k < tests.unseen.size(); ++k) {
    const campaign::Population& population = campaign.populations[tests.unseen[k].population];
    const std::string score = campaign::ScoreName(population.name, tests.unseen[k].label);
    for (std::size_t i = 0; i < all.size(); ++i) {
      inference::PhiloxStream stream({.seed = campaign.seed,
                                      .purpose = inference::StreamPurpose::kUnseenMember,
                                      .iteration = k,
                                      .sample = i});
      const auto row = static_cast<Index>(i);
      const double common = draws.parameters(row, static_cast<Index>(population.common));
      const double spread = draws.parameters(row, static_cast<Index>(population.spread));
      all[i][score] = campaign::DrawScore(population, common, spread, stream);
    }
  }
  return all;
}

struct Level {
  std::string observable;
  double value = 0;
};

absl::StatusOr<std::vector<Level>> ReadLevels(
    const std::vector<std::string>& texts, const std::map<std::string, std::string>& observables) {
  std::vector<std::string> known;
  known.reserve(observables.size());
  for (const auto& [name, unit] : observables) known.push_back(name);
  std::vector<Level> levels;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    const std::string name = text.substr(0, equals);
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", campaign::Quoted(text),
                       " gives no level: OBSERVABLE=LEVEL is expected, e.g. --exceed ",
                       observables.contains(name) ? name : known.front(), "=0.5"));
    }
    if (!observables.contains(name)) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", campaign::Quoted(text),
                       " names no observable of the test: ", campaign::Suggestion(name, known)));
    }
    // A program's observable that is only predicted has no unit here: what stands there is one.
    const std::string& unit = observables.at(name);
    const auto written = campaign::SplitQuantity(text.substr(equals + 1));
    const auto own = campaign::ParseUnit(written.ok() ? written->unit : "");
    const bool free = unit == "1" && dem::FindObservable(name) == nullptr && own.ok();
    const auto value = campaign::ParseQuantity(text.substr(equals + 1),
                                               free ? campaign::SiName(own->dimension) : unit);
    if (!value.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", name, ": ", std::string(value.status().message())));
    }
    if (!std::isfinite(*value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("--exceed ", name, ": the level is a finite number"));
    }
    levels.push_back({name, *value});
  }
  return levels;
}

// Runs x readings of one observable; rows of runs that did not finish are left out.
struct RunsOfObservable {
  Eigen::MatrixXd parameters, values;
};

// Places of the parameters that an experiment's runs read: of a population the common one, where
// ValuesIn() puts the value of the experiment's label.
std::vector<std::size_t> ReadByRuns(const campaign::Campaign& campaign) {
  std::vector<std::size_t> places;
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    if (!campaign.parameters[j].of_population) places.push_back(j);
  }
  return places;
}

RunsOfObservable Collect(const report::CampaignView& view, const campaign::Experiment& experiment,
                         const std::string& observable) {
  const auto t = static_cast<Index>(experiment.control.size());
  const std::vector<std::size_t> read = ReadByRuns(view.campaign);
  const auto d = static_cast<Index>(read.size());
  RunsOfObservable runs{.parameters = Eigen::MatrixXd(0, d), .values = Eigen::MatrixXd(0, t)};
  for (const v1::Sample& sample : view.samples) {
    const auto found = view.states.find({experiment.name, sample.index()});
    if (found == view.states.end() ||
        sample.parameters_size() != static_cast<int>(view.campaign.parameters.size())) {
      continue;
    }
    const std::vector<double> own = campaign::ValuesIn(
        view.campaign, experiment, {sample.parameters().data(), view.campaign.parameters.size()});
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
      const std::size_t place = read[static_cast<std::size_t>(j)];
      runs.parameters(runs.parameters.rows() - 1, j) =
          view.campaign.parameters[place].prior.ToStandard(own[place]);
    }
    runs.values.row(runs.values.rows() - 1) = row;
  }
  return runs;
}

// A sentence; empty: none says why.
std::string WhyOneFailed(const report::CampaignView& view) {
  for (const v1::Sample& sample : view.samples) {
    if (messages::StatusOf(sample) == campaign::EvaluationStatus::kFinished ||
        sample.reason().empty())
      continue;
    return absl::StrCat("Sample ", sample.index(), ": ", sample.reason());
  }
  return "";
}

// Of a measurement of what the runs predict on average; empty: the test states none.
Eigen::VectorXd StatedError(const campaign::MeasuredObservable& observable,
                            const Eigen::MatrixXd& runs) {
  const Index t = runs.cols();
  if (!observable.sd.empty()) return Eigen::Map<const Eigen::VectorXd>(observable.sd.data(), t);
  if (!observable.noise || runs.rows() == 0) return {};
  return runs.colwise().mean().transpose().unaryExpr(
      [&law = *observable.noise](double value) { return campaign::ErrorOf(law, value); });
}

// Standard deviation of the model error that the calibration inferred for this observable, the
// relative part of what the runs predict on average; the mean variance where tests have their own.
Eigen::VectorXd InferredModelError(const report::CampaignView& parent,
                                   const std::string& observable, const Eigen::VectorXd& mean) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(mean.size());
  int found = 0;
  for (const v1::Posterior::ModelError& error : parent.posterior.model_error()) {
    const bool own = std::any_of(
        error.observables().begin(), error.observables().end(),
        [&observable](const std::string& name) { return absl::EndsWith(name, "." + observable); });
    if (!own) continue;
    sum.array() +=
        error.relative().mean_square() * mean.array().square() + error.absolute().mean_square();
    ++found;
  }
  return found == 0 ? sum : Eigen::VectorXd((sum / found).cwiseSqrt());
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
    const auto wanted = static_cast<Index>(view.samples.size());
    if (runs.values.rows() < 2 || 2 * runs.values.rows() < wanted) {
      return absl::FailedPreconditionError(absl::StrCat(
          "only ", runs.values.rows(), " of ", wanted, " runs of ", experiment.name,
          " have finished, and those that do are no fair sample of the posterior: nothing is "
          "predicted from fewer than half of them. ",
          WhyOneFailed(view)));
    }
    const Eigen::VectorXd stated = StatedError(observable, runs.values);
    const Eigen::VectorXd error = stated.size() > 0 ? stated : Eigen::VectorXd::Zero(t);
    ASSIGN_OR_RETURN(auto quantity,
                     inference::PredictQuantity(runs.parameters, runs.values, error,
                                                !campaign::MakesItsBodies(experiment)));
    inference::DiscrepancyBand discrepancy = report::DiscrepancyAt(
        *misfit.parent, misfit.discrepancies, experiment, observable.name, quantity.mean);
    Eigen::VectorXd missed = Eigen::VectorXd::Zero(t);
    if (discrepancy.mean.size() > 0) {
      missed = discrepancy.rms;
      quantity = inference::WithModelError(std::move(quantity), missed);
    }
    const Eigen::VectorXd off = InferredModelError(*misfit.parent, observable.name, quantity.mean);
    if (off.any()) quantity = inference::WithModelError(std::move(quantity), off);
    PredictedObservable out{.experiment = experiment.name,
                            .observable = observable.name,
                            .control_name = experiment.control_name,
                            .unit = observable.unit,
                            .control_unit = experiment.control_unit,
                            .control = experiment.control,
                            .quantity = std::move(quantity),
                            .sd_noise = stated,
                            .measured = observable.values,
                            .discrepancy = std::move(discrepancy),
                            .exceedance = {}};
    for (const Level& level : levels) {
      if (level.observable != observable.name) continue;
      out.exceedance.push_back(
          {.level = level.value,
           .probability = inference::ExceedanceProbability(out.quantity, level.value),
           .parts = inference::PartsOfExceedance(out.quantity, level.value),
           .anywhere = inference::ExceedanceAnywhere(
               out.quantity, runs.values, missed, (error.cwiseAbs2() + off.cwiseAbs2()).cwiseSqrt(),
               level.value)});
    }
    prediction.runs = static_cast<int>(runs.values.rows());
    prediction.failed =
        std::max(prediction.failed, static_cast<int>(view.samples.size()) - prediction.runs);
    prediction.observables.push_back(std::move(out));
  }
  return absl::OkStatus();
}

void AddNotes(const report::CampaignView& view, const Misfit& misfit, Prediction& prediction) {
  for (const std::string& warning : report::Warnings(*misfit.parent)) {
    prediction.notes.push_back(absl::StrCat("Of ", prediction.parent, ": ", warning));
  }
  bool errors = true;
  bool separated = true;
  for (const PredictedObservable& o : prediction.observables) {
    errors &= o.sd_noise.size() > 0;
    separated &= o.quantity.separated;
  }
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
    const bool carried = std::any_of(
        prediction.observables.begin(), prediction.observables.end(), [&d](const auto& o) {
          return o.observable == d.observable && o.discrepancy.mean.size() > 0;
        });
    if (carried && d.fit.probability() > kStays) {
      prediction.notes.push_back(
          absl::StrCat(d.observable,
                       ": the model misses the fitted measurements by a smooth misfit beyond noise "
                       "and scatter (see `calibctl compare ",
                       prediction.parent, "`); it is carried as model error here."));
    }
  }
  if (!separated) {
    prediction.notes.emplace_back(
        "Too few runs to tell the uncertainty of the parameters from the scatter of packings: "
        "use more --draws.");
  }
  if (prediction.failed > 0) {
    prediction.notes.push_back(absl::StrCat(prediction.failed, " of ", view.samples.size(),
                                            " runs did not finish and are left out."));
  }
}

}  // namespace

absl::StatusOr<Prediction> Predict(client::Laboratory& laboratory,
                                   const report::CampaignView& parent, const PredictedTests& tests,
                                   const PredictionOptions& options) {
  const std::string& id = parent.status.campaign();
  if (parent.campaign.precomputed) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the runs of ", id, " were made elsewhere: there is no model to run another test with"));
  }
  if (parent.posterior.posterior_from().empty() ||
      messages::SourceOf(parent.posterior) == campaign::PosteriorSource::kNone) {
    return absl::FailedPreconditionError(absl::StrCat(
        "campaign ", id, " has no posterior to predict from: see `calibctl posterior ", id, "`"));
  }
  ASSIGN_OR_RETURN(const auto levels, ReadLevels(options.exceed, tests.observables));
  const Draws draws = DrawsOf(parent, options.draws);
  campaign::Derivation derivation{
      .name = absl::StrCat(parent.campaign.name, ": prediction"),
      .lineage = {.parent = id, .purpose = ToString(campaign::DerivedFor::kPrediction)},
      .experiments = tests.experiments,
      .new_labels = true};
  const std::vector<std::map<std::string, double>> unseen =
      DrawUnseen(parent.campaign, tests, draws);
  for (Index i = 0; i < draws.parameters.rows(); ++i) {
    const auto number = static_cast<std::size_t>(i);
    campaign::Derivation::Row row{.like = draws.like[number], .values = unseen[number]};
    for (std::size_t j = 0; j < parent.campaign.parameters.size(); ++j) {
      row.values[parent.campaign.parameters[j].name] = draws.parameters(i, static_cast<Index>(j));
    }
    derivation.rows.push_back(std::move(row));
  }
  ASSIGN_OR_RETURN(const auto text,
                   campaign::Derive(methods::All(), parent.source.campaign_file(), derivation));
  ASSIGN_OR_RETURN(const auto view, laboratory.Run(parent, text, "prediction", tests.files));

  Prediction prediction;
  prediction.parent = id;
  prediction.campaign = view.status.campaign();
  const Misfit misfit{
      .parent = &parent,
      .discrepancies = report::FitDiscrepancies(parent, report::PredictReadings(parent))};
  for (const campaign::Experiment& experiment : view.campaign.experiments) {
    RETURN_IF_ERROR(AddExperiment(view, experiment, levels, misfit, prediction));
  }
  AddNotes(view, misfit, prediction);
  for (const UnseenLabel& label : tests.unseen) {
    const std::string& name = parent.campaign.populations[label.population].name;
    prediction.notes.push_back(absl::StrCat(campaign::MemberName(name, label.label),
                                            " was not fitted: each run draws it ",
                                            "from the population of ", name, "."));
  }
  return prediction;
}

}  // namespace calib::ctl
