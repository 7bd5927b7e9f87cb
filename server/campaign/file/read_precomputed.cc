#include "server/campaign/file/read_precomputed.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

using NameMap = std::vector<std::pair<std::string, std::string>>;

// How the two tables are to be understood.
struct Description {
  std::string parameters, states;  // paths
  std::string sample = "sample";
  std::string step = "step";
  std::string experiment;    // column of the states table; empty: there is one experiment
  std::string log_proposal;  // column of the parameter table; empty: drawn from the prior
  NameMap parameter_columns, parameter_units, state_columns, state_units;
  std::vector<std::string> absolute;  // parameters whose sign the simulation ignored
};

Description ReadDescription(MapReader& map) {
  Description d;
  d.parameters = map.RequiredText("parameters", "the table with one row per sample").value_or("");
  d.states =
      map.RequiredText("states", "the table with one row per sample and load step").value_or("");
  d.sample = map.Text("sample").value_or(d.sample);
  d.step = map.Text("step").value_or(d.step);
  d.experiment = map.Text("experiment").value_or("");
  d.log_proposal = map.Text("log_proposal").value_or("");
  d.parameter_columns = map.TextMap("parameter_columns").value_or(NameMap{});
  d.parameter_units = map.TextMap("parameter_units").value_or(NameMap{});
  d.state_columns = map.TextMap("state_columns").value_or(NameMap{});
  d.state_units = map.TextMap("state_units").value_or(NameMap{});
  d.absolute = map.TextList("absolute").value_or(std::vector<std::string>{});
  map.Finish();
  return d;
}

const std::string* FindName(const NameMap& names, const std::string& name) {
  for (const auto& [key, value] : names) {
    if (key == name) return &value;
  }
  return nullptr;
}

std::string ColumnOf(const NameMap& names, const std::string& name) {
  const std::string* column = FindName(names, name);
  return column != nullptr ? *column : name;
}

void CheckNames(const MapReader& map, const std::string& key, const NameMap& names,
                const std::vector<std::string>& allowed) {
  for (const auto& [name, value] : names) {
    if (std::find(allowed.begin(), allowed.end(), name) == allowed.end()) {
      map.Problem(key, absl::StrCat(Quoted(name), " is not used in this campaign; ",
                                    Suggestion(name, allowed)));
    }
  }
}

// Factor to SI of a column under our name; the unit has to measure what si_unit does.
double FactorOf(const MapReader& map, const std::string& key, const NameMap& units,
                const std::string& name, const std::string& si_unit) {
  const std::string* text = FindName(units, name);
  if (text == nullptr) return 1;
  const auto unit = ParseUnit(*text);
  if (!unit.ok()) {
    map.Problem(key, absl::StrCat(name, ": ", std::string(unit.status().message())));
    return 1;
  }
  const auto wanted = ParseUnit(si_unit);
  if (wanted.ok() && !SameKind(unit->dimension, wanted->dimension)) {
    map.Problem(key, absl::StrCat(name, ": ", *text, " is ", KindOfUnit(*text), ", expected ",
                                  KindOfUnit(si_unit)));
  }
  return unit->factor;
}

// A column of whole numbers of at least 0.
std::vector<int> KeyColumn(const std::string& path, const DataTable& table,
                           const std::string& column, ReadContext& context) {
  std::vector<TableProblem> found;
  const std::vector<double> numbers = table.Column(column, found);
  std::vector<int> keys;
  constexpr double kLargest = 1e9;
  for (std::size_t i = 0; found.empty() && i < numbers.size(); ++i) {
    if (numbers[i] < 0 || numbers[i] > kLargest || numbers[i] != std::floor(numbers[i])) {
      found.push_back({table.LineOf(i), column,
                       absl::StrCat(numbers[i], " is not a whole number of at least 0")});
    }
    keys.push_back(static_cast<int>(numbers[i]));
  }
  context.AddTableProblems(path, found);
  return found.empty() ? keys : std::vector<int>();
}

class TableReader {
 public:
  TableReader(MapReader& map, ReadContext& context, Campaign& campaign)
      : map_(map), context_(context), campaign_(campaign), description_(ReadDescription(map)) {}

  void Read() {
    std::vector<std::string> parameters;
    for (const CalibratedParameter& parameter : campaign_.parameters) {
      parameters.push_back(parameter.name);
    }
    std::vector<std::string> observables;
    for (const Experiment& experiment : campaign_.experiments) {
      for (const MeasuredObservable& observable : experiment.observables) {
        observables.push_back(observable.name);
      }
    }
    CheckNames(map_, "parameter_columns", description_.parameter_columns, parameters);
    CheckNames(map_, "parameter_units", description_.parameter_units, parameters);
    NameMap absolute;
    for (const std::string& name : description_.absolute) absolute.emplace_back(name, "");
    CheckNames(map_, "absolute", absolute, parameters);
    CheckNames(map_, "state_columns", description_.state_columns, observables);
    CheckNames(map_, "state_units", description_.state_units, observables);
    if (const auto table =
            Open("parameters", description_.parameters, ParameterColumns(parameters))) {
      ReadParameters(*table);
    }
    if (const auto table = Open("states", description_.states, StateColumns(observables))) {
      ReadStates(*table);
    }
  }

 private:
  std::vector<std::string> ParameterColumns(const std::vector<std::string>& names) const {
    std::vector<std::string> columns = {description_.sample};
    for (const std::string& name : names) {
      columns.push_back(ColumnOf(description_.parameter_columns, name));
    }
    return columns;
  }

  std::vector<std::string> StateColumns(const std::vector<std::string>& names) const {
    std::vector<std::string> columns = {description_.sample, description_.step};
    for (const std::string& name : names) {
      columns.push_back(ColumnOf(description_.state_columns, name));
    }
    return columns;
  }

  std::unique_ptr<DataTable> Open(const std::string& key, const std::string& path,
                                  const std::vector<std::string>& wanted) {
    if (path.empty()) return nullptr;
    const std::string* text = context_.ReadNamedFile(map_, key, path);
    if (text == nullptr) return nullptr;
    std::vector<TableProblem> found;
    auto table = std::make_unique<DataTable>(*text, wanted, found);
    context_.AddTableProblems(path, found);
    return found.empty() ? std::move(table) : nullptr;
  }

  std::vector<double> NumberColumn(const std::string& path, const DataTable& table,
                                   const std::string& column) {
    std::vector<TableProblem> found;
    std::vector<double> values = table.Column(column, found);
    context_.AddTableProblems(path, found);
    return values;
  }

  void ReadParameters(const DataTable& table) {
    const std::string& path = description_.parameters;
    const std::vector<int> samples = KeyColumn(path, table, description_.sample, context_);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (!row_of_sample_.emplace(samples[i], static_cast<Eigen::Index>(i)).second) {
        context_.problems().AddIn(
            path, table.LineOf(i), description_.sample,
            absl::StrCat("sample ", samples[i], " stands here for the second time"));
      }
    }
    Eigen::MatrixXd& parameters = campaign_.precomputed->parameters;
    parameters.resize(static_cast<Eigen::Index>(table.rows()),
                      static_cast<Eigen::Index>(campaign_.parameters.size()));
    for (std::size_t k = 0; k < campaign_.parameters.size(); ++k) {
      const CalibratedParameter& parameter = campaign_.parameters[k];
      const double factor = FactorOf(map_, "parameter_units", description_.parameter_units,
                                     parameter.name, parameter.unit);
      const bool absolute = std::find(description_.absolute.begin(), description_.absolute.end(),
                                      parameter.name) != description_.absolute.end();
      const auto column =
          NumberColumn(path, table, ColumnOf(description_.parameter_columns, parameter.name));
      for (std::size_t i = 0; i < column.size(); ++i) {
        parameters(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
            factor * (absolute ? std::abs(column[i]) : column[i]);
      }
    }
    if (!description_.log_proposal.empty()) {
      const auto column = NumberColumn(path, table, description_.log_proposal);
      campaign_.precomputed->log_proposal = Eigen::Map<const Eigen::VectorXd>(
          column.data(), static_cast<Eigen::Index>(column.size()));
    }
    samples_ = parameters.rows();
    campaign_.samples = static_cast<int>(samples_);
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

  void ReadStates(const DataTable& table) {
    const std::string& path = description_.states;
    const std::vector<int> samples = KeyColumn(path, table, description_.sample, context_);
    const std::vector<int> steps = KeyColumn(path, table, description_.step, context_);
    const bool several = campaign_.experiments.size() > 1;
    if (several && description_.experiment.empty()) {
      map_.Problem(
          "states",
          "holds several experiments; name the column that says which: experiment: COLUMN");
      return;
    }
    if (samples.empty() || steps.empty()) return;
    const std::vector<std::string> names = table.Texts(description_.experiment);
    if (!description_.experiment.empty() && names.empty()) {
      map_.Problem("experiment",
                   absl::StrCat(Quoted(description_.experiment), " is not a column of ", path, "; ",
                                Suggestion(description_.experiment, table.columns())));
      return;
    }
    auto& values = campaign_.precomputed->values;
    for (const Experiment& experiment : campaign_.experiments) {
      std::vector<std::size_t> rows;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        if (names.empty() || names[i] == experiment.name) rows.push_back(i);
      }
      values.push_back(StatesOf(experiment, table, rows, samples, steps));
    }
  }

  // [sample][reading * observables + observable] of one experiment, from its rows of the table.
  std::vector<std::vector<double>> StatesOf(const Experiment& experiment, const DataTable& table,
                                            const std::vector<std::size_t>& rows,
                                            const std::vector<int>& samples,
                                            const std::vector<int>& steps) {
    const std::string& path = description_.states;
    const std::size_t readings = experiment.control.size();
    const std::size_t width = experiment.observables.size();
    std::vector<std::vector<double>> states(static_cast<std::size_t>(samples_),
                                            std::vector<double>(readings * width, std::nan("")));
    if (rows.empty()) {
      context_.problems().AddIn(path, 0, description_.experiment,
                                absl::StrCat("holds no states of ", experiment.name));
      return states;
    }
    std::vector<std::vector<double>> columns;
    for (const MeasuredObservable& observable : experiment.observables) {
      const dem::ObservableInfo* info = dem::FindObservable(observable.name);
      const double factor = FactorOf(map_, "state_units", description_.state_units, observable.name,
                                     info != nullptr ? info->unit : "1");
      columns.push_back(
          NumberColumn(path, table, ColumnOf(description_.state_columns, observable.name)));
      for (double& value : columns.back()) value *= factor;
    }
    // Steps count from 0, or from 1 where no row has step 0 and one has as many as there are
    // readings.
    const auto [low, high] =
        std::minmax_element(rows.begin(), rows.end(),
                            [&steps](std::size_t a, std::size_t b) { return steps[a] < steps[b]; });
    const int first = steps[*low] == 1 && steps[*high] == static_cast<int>(readings) ? 1 : 0;
    if (readings > 0 &&
        (steps[*low] != first || steps[*high] - first + 1 != static_cast<int>(readings))) {
      context_.problems().AddIn(
          path, table.LineOf(*high), description_.step,
          absl::StrCat("the steps run from ", steps[*low], " to ", steps[*high], ", but ",
                       experiment.name, " has ", readings, " readings"));
      return states;
    }
    std::set<std::pair<int, int>> seen;
    for (const std::size_t row : rows) {
      if (!seen.emplace(samples[row], steps[row]).second) {
        context_.problems().AddIn(path, table.LineOf(row), description_.step,
                                  absl::StrCat("step ", steps[row], " of sample ", samples[row],
                                               " stands here for the second time"));
        return states;
      }
      const auto sample = row_of_sample_.find(samples[row]);
      if (sample == row_of_sample_.end()) {
        context_.problems().AddIn(
            path, table.LineOf(row), description_.sample,
            absl::StrCat("sample ", samples[row], " is not in ", description_.parameters));
        return states;
      }
      const auto reading = static_cast<std::size_t>(steps[row] - first);
      for (std::size_t j = 0; j < width && reading < readings; ++j) {
        states[static_cast<std::size_t>(sample->second)][reading * width + j] = columns[j][row];
      }
    }
    return states;
  }

  MapReader& map_;
  ReadContext& context_;
  Campaign& campaign_;
  Description description_;
  Eigen::Index samples_ = 0;  // rows of the parameter table
  std::map<int, Eigen::Index> row_of_sample_;
};

}  // namespace

void ReadPrecomputed(MapReader& campaign_map, ReadContext& context, Campaign& campaign) {
  auto model = campaign_map.Map("model");
  if (!model) return;
  auto map = model->Map("precomputed");
  if (!map) return;
  TableReader(*map, context, campaign).Read();
}

std::vector<std::string> RepeatedRunWarnings(const Campaign& campaign) {
  if (!campaign.precomputed) return {};
  const Eigen::MatrixXd& rows = campaign.precomputed->parameters;
  std::set<std::vector<double>> different;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Eigen::VectorXd row = rows.row(i);
    different.emplace(row.begin(), row.end());
  }
  const Eigen::Index repeats = rows.rows() - static_cast<Eigen::Index>(different.size());
  if (repeats == 0) return {};
  return {absl::StrCat(repeats, " of the ", rows.rows(),
                       " runs made elsewhere repeat the parameters of another one. Each counts as "
                       "a draw of its own: the intervals are narrower and the effective samples "
                       "more than the ",
                       different.size(), " different sets tell.")};
}

}  // namespace calib::campaign
