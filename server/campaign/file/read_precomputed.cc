#include "server/campaign/file/read_precomputed.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/run_states.h"
#include "server/campaign/file/run_table.h"
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
    const auto table = OpenRunTable(map_, "parameters", keys_.parameters, wanted, context_);
    if (table) ReadParameters(*table);
  }

  // Row of each sample.
  [[nodiscard]] const std::map<int, Eigen::Index>& row_of_sample() const { return row_of_sample_; }

 private:
  void ReadParameters(const DataTable& table) {
    const std::string& path = keys_.parameters;
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
    campaign_.samples = static_cast<int>(parameters.rows());
    if (context_.is_new()) RefuseOneSet(path);
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
  std::map<int, Eigen::Index> row_of_sample_;
};

// Names in the keys are those of the campaign.
void CheckKeyNames(const MapReader& map, const RunTableKeys& keys, const Campaign& campaign) {
  std::vector<std::string> parameters;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    parameters.push_back(parameter.name);
  }
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
  const RunTableKeys keys = ReadRunTableKeys(*map);
  CheckKeyNames(*map, keys, campaign);
  ParametersReader parameters(*map, keys, context, campaign);
  parameters.Read();
  campaign.precomputed->values =
      ReadRunStates(*map, keys, campaign, parameters.row_of_sample(), context);
}

}  // namespace calib::campaign
