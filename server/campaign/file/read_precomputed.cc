#include "server/campaign/file/read_precomputed.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/run_states.h"
#include "server/campaign/file/run_table.h"
#include "server/campaign/file/shared/read_user_effects.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

void CheckNames(const MapReader& map, const std::string& key, const NameMap& names,
                const std::vector<std::string>& allowed) {
  for (const auto& [name, value] : names) {
    if (std::find(allowed.begin(), allowed.end(), name) == allowed.end()) {
      map.Problem(key, absl::StrCat(Quoted(name), " is not used in this campaign; ",
                                    Suggestion(name, allowed)));
    }
  }
}

// One column is one parameter.
void CheckColumnsDiffer(const MapReader& map, const NameMap& columns,
                        const std::vector<std::string>& parameters) {
  std::map<std::string, std::string> reader;
  for (const std::string& name : parameters) {
    const std::string column = ColumnOf(columns, name);
    const auto [first, is_new] = reader.emplace(column, name);
    if (!is_new) {
      map.Problem("parameter_columns",
                  absl::StrCat(first->second, " and ", name, " would both be read from the column ",
                               Quoted(column)));
    }
  }
}

// A parameter of an effect that rows have.
struct HeldParameter {
  std::string name;  // dotted
  std::string unit;
  std::optional<double> null;
  double min = 0, max = 0;  // what its sign allows
};

bool Acts(const Campaign& campaign, const std::string& effect) {
  const std::vector<std::string>& acting = campaign.model.effects;
  return std::find(acting.begin(), acting.end(), effect) != acting.end();
}

// Of effects that do not act: the parameters of those that do are the campaign's.
std::vector<HeldParameter> HeldParametersOf(const Campaign& campaign) {
  std::vector<HeldParameter> held;
  for (const dem::UserEffect& effect : campaign.model.user_effects) {
    if (Acts(campaign, effect.info.name)) continue;
    for (const dem::ParameterInfo& own : effect.info.parameters) {
      held.push_back({absl::StrCat(effect.info.name, ".", own.name), own.unit, own.null_value,
                      own.min, own.max});
    }
  }
  return held;
}

// The table of parameters, one row per sample.
class ParametersReader {
 public:
  ParametersReader(MapReader& map, const RunTableKeys& keys, ReadContext& context,
                   Campaign& campaign)
      : map_(map), keys_(keys), context_(context), campaign_(campaign) {}

  void Read() {
    std::vector<std::string> wanted = {keys_.sample};
    for (const CalibratedParameter& parameter : campaign_.parameters) {
      wanted.push_back(ColumnOf(keys_.parameter_columns, parameter.name));
    }
    for (const HeldParameter& own : held_)
      wanted.push_back(ColumnOf(keys_.parameter_columns, own.name));
    const auto table = OpenRunTable(map_, "parameters", keys_.parameters, wanted, context_);
    if (table) ReadParameters(*table);
  }

  // Row of each sample.
  [[nodiscard]] const std::map<int, Eigen::Index>& row_of_sample() const { return row_of_sample_; }

  // Takes the rows that have effects out of the runs that calibrate.
  void TakeOutEffects() {
    Precomputed& runs = *campaign_.precomputed;
    RunsWithEffects& with = runs.with_effects;
    if (held_.empty() || !is_sound_) return;
    std::vector<Eigen::Index> own, others;
    for (Eigen::Index i = 0; i < effects_.rows(); ++i) {
      bool has_effect = false;
      for (std::size_t k = 0; k < held_.size(); ++k) {
        has_effect = has_effect ||
                     (held_[k].null && effects_(i, static_cast<Eigen::Index>(k)) != *held_[k].null);
      }
      (has_effect ? others : own).push_back(i);
    }
    for (const HeldParameter& parameter : held_) with.names.push_back(parameter.name);
    const auto d = runs.parameters.cols();
    with.parameters.resize(static_cast<Eigen::Index>(others.size()), d + effects_.cols());
    with.parameters.leftCols(d) = runs.parameters(others, Eigen::all);
    with.parameters.rightCols(effects_.cols()) = effects_(others, Eigen::all);
    runs.parameters = Eigen::MatrixXd(runs.parameters(own, Eigen::all));
    if (runs.log_proposal) runs.log_proposal = Eigen::VectorXd((*runs.log_proposal)(own));
    for (auto& states : runs.values) {
      const auto take = [&states](const std::vector<Eigen::Index>& rows) {
        std::vector<std::vector<double>> taken;
        taken.reserve(rows.size());
        for (const Eigen::Index i : rows) taken.push_back(states[static_cast<std::size_t>(i)]);
        return taken;
      };
      with.values.push_back(take(others));
      states = take(own);
    }
    if (own.empty()) {
      context_.problems().AddIn(keys_.parameters, 0, "",
                                "every row has an effect; a calibration needs runs without one, "
                                "whose effects are all at their null");
    } else if (others.empty() && campaign_.model.effects.empty()) {
      context_.problems().AddIn(keys_.parameters, 0, "",
                                "no row has an effect: all are at their null; leave `effects` out "
                                "or give the runs that have them");
    }
  }

  // How many samples calibrate.
  void Count() {
    const Eigen::MatrixXd& parameters = campaign_.precomputed->parameters;
    campaign_.samples = static_cast<int>(parameters.rows());
    if (context_.is_new()) RefuseOneSet(keys_.parameters);
  }

 private:
  void ReadParameters(const DataTable& table) {
    const std::string& path = keys_.parameters;
    const std::size_t before = context_.problems().size();
    const std::vector<int> samples = KeyColumn(path, table, keys_.sample, context_);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (!row_of_sample_.emplace(samples[i], static_cast<Eigen::Index>(i)).second) {
        context_.problems().AddIn(
            path, table.LineOf(i), keys_.sample,
            absl::StrCat("sample ", samples[i], " stands here for the second time"));
      }
    }
    Eigen::MatrixXd& parameters = campaign_.precomputed->parameters;
    parameters.resize(static_cast<Eigen::Index>(table.rows()),
                      static_cast<Eigen::Index>(campaign_.parameters.size()));
    for (std::size_t k = 0; k < campaign_.parameters.size(); ++k) {
      const CalibratedParameter& parameter = campaign_.parameters[k];
      const double factor =
          FactorOf(map_, "parameter_units", keys_.parameter_units, parameter.name, parameter.unit);
      const bool absolute = std::find(keys_.absolute.begin(), keys_.absolute.end(),
                                      parameter.name) != keys_.absolute.end();
      const auto column =
          NumberColumn(path, table, ColumnOf(keys_.parameter_columns, parameter.name), context_);
      for (std::size_t i = 0; i < column.size(); ++i) {
        parameters(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
            factor * (absolute ? std::abs(column[i]) : column[i]);
      }
    }
    if (!keys_.log_proposal.empty()) {
      const auto column = NumberColumn(path, table, keys_.log_proposal, context_);
      campaign_.precomputed->log_proposal = Eigen::Map<const Eigen::VectorXd>(
          column.data(), static_cast<Eigen::Index>(column.size()));
    }
    effects_.resize(parameters.rows(), static_cast<Eigen::Index>(held_.size()));
    for (std::size_t k = 0; k < held_.size(); ++k) {
      const HeldParameter& own = held_[k];
      const double factor =
          FactorOf(map_, "parameter_units", keys_.parameter_units, own.name, own.unit);
      const auto column =
          NumberColumn(path, table, ColumnOf(keys_.parameter_columns, own.name), context_);
      for (std::size_t i = 0; i < column.size(); ++i) {
        const double value = factor * column[i];
        effects_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = value;
        const bool is_outside = value < own.min || value > own.max;  // NaN: told by its cell
        if (!is_outside) continue;
        context_.problems().AddIn(
            path, table.LineOf(i), ColumnOf(keys_.parameter_columns, own.name),
            absl::StrCat(own.name, " is ", value, ", on the other side of its null ", *own.null,
                         "; sign: either allows both"));
        break;
      }
    }
    is_sound_ = parameters.rows() > 0 && context_.problems().size() == before;
  }

  // One run told many times says nothing of any other parameters.
  void RefuseOneSet(const std::string& path) {
    const Eigen::MatrixXd& rows = campaign_.precomputed->parameters;
    if (rows.rows() < 2 || !rows.allFinite() || (rows.rowwise() - rows.row(0)).any()) return;
    std::string set;
    for (std::size_t k = 0; k < campaign_.parameters.size(); ++k) {
      const CalibratedParameter& parameter = campaign_.parameters[k];
      absl::StrAppend(&set, k == 0 ? "" : ", ", parameter.name, " ",
                      rows(0, static_cast<Eigen::Index>(k)),
                      parameter.unit == "1" ? "" : absl::StrCat(" ", parameter.unit));
    }
    context_.problems().AddIn(path, 0, "",
                              absl::StrCat("all ", rows.rows(), " rows hold the same parameters: ",
                                           set, "; a calibration needs runs at different ones"));
  }

  MapReader& map_;
  const RunTableKeys& keys_;
  ReadContext& context_;
  Campaign& campaign_;
  std::vector<HeldParameter> held_ = HeldParametersOf(campaign_);
  Eigen::MatrixXd effects_;  // of all rows
  bool is_sound_ = false;    // the table could be read
  std::map<int, Eigen::Index> row_of_sample_;
};

// Names in the keys are those of the campaign.
void CheckKeyNames(const MapReader& map, const RunTableKeys& keys, const Campaign& campaign,
                   bool is_new) {
  std::vector<std::string> parameters;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    parameters.push_back(parameter.name);
  }
  for (const HeldParameter& own : HeldParametersOf(campaign)) parameters.push_back(own.name);
  std::vector<std::string> of_states;  // observables, and what tells how far a run has come
  for (const Experiment& experiment : campaign.experiments) {
    for (const MeasuredObservable& observable : experiment.observables) {
      of_states.push_back(observable.name);
    }
  }
  for (const Experiment& experiment : campaign.experiments) {
    if (!experiment.control_name.empty()) of_states.push_back(experiment.control_name);
  }
  CheckNames(map, "parameter_columns", keys.parameter_columns, parameters);
  if (is_new) CheckColumnsDiffer(map, keys.parameter_columns, parameters);
  CheckNames(map, "parameter_units", keys.parameter_units, parameters);
  NameMap absolute;
  for (const std::string& name : keys.absolute) absolute.emplace_back(name, "");
  CheckNames(map, "absolute", absolute, parameters);
  CheckNames(map, "state_columns", keys.state_columns, of_states);
  CheckNames(map, "state_units", keys.state_units, of_states);
}

}  // namespace

void ReadPrecomputed(MapReader& campaign_map, ReadContext& context, Campaign& campaign) {
  auto model = campaign_map.Map("model");
  if (!model) return;
  auto map = model->Map("precomputed");
  if (!map) return;
  ReadHeldEffects(*map, context.is_new(), "runs made elsewhere", campaign.model);
  for (const std::string& missing : NotCalibratedOfActing(campaign)) {
    map->Problem("effects",
                 absl::StrCat("parameter ", missing, " is not calibrated; add it to parameters"));
  }
  const RunTableKeys keys = ReadRunTableKeys(*map);
  CheckKeyNames(*map, keys, campaign, context.is_new());
  ParametersReader parameters(*map, keys, context, campaign);
  parameters.Read();
  campaign.precomputed->values =
      ReadRunStates(*map, keys, campaign, parameters.row_of_sample(), context);
  parameters.TakeOutEffects();
  parameters.Count();
}

}  // namespace calib::campaign
