#include "server/campaign/file/run_states.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/control_check.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

/// Part of the range of the control within which a run stands where the measurement does [-].
/// Chosen: digits that tables are printed with.
constexpr double kSameControl = 1e-3;

struct ControlSpan {
  double least = 0, most = 0;

  [[nodiscard]] double slack() const { return kSameControl * (most - least); }
  [[nodiscard]] bool Reaches(const ControlSpan& other) const {
    return least <= other.least + other.slack() && most >= other.most - other.slack();
  }
};

std::string ToText(const ControlSpan& span, const std::string& control) {
  return absl::StrCat("from ", InWords(control, span.least), " to ", InWords(control, span.most));
}

// The rows of one experiment in the table, and what they say.
struct StateRows {
  std::vector<std::size_t> rows;
  std::vector<std::vector<double>> columns;  // of each observable, over the whole table, SI
  std::vector<double> control;               // likewise; empty: the table does not have it
};

class StatesReader {
 public:
  StatesReader(MapReader& map, const RunTableKeys& keys, const Campaign& campaign,
               const std::map<int, Eigen::Index>& row_of_sample, const DataTable& table,
               ReadContext& context)
      : map_(map),
        keys_(keys),
        campaign_(campaign),
        row_of_sample_(row_of_sample),
        table_(table),
        context_(context),
        samples_(KeyColumn(keys.states, table, keys.sample, context)),
        steps_(KeyColumn(keys.states, table, keys.step, context)) {}

  std::vector<std::vector<std::vector<double>>> Read() {
    std::vector<std::vector<std::vector<double>>> values;
    if (campaign_.experiments.size() > 1 && keys_.experiment.empty()) {
      map_.Problem(
          "states",
          "holds several experiments; name the column that says which: experiment: COLUMN");
      return values;
    }
    if (samples_.empty() || steps_.empty()) return values;
    const std::vector<std::string> names = table_.Texts(keys_.experiment);
    if (!keys_.experiment.empty() && names.empty()) {
      map_.Problem("experiment",
                   absl::StrCat(Quoted(keys_.experiment), " is not a column of ", keys_.states,
                                "; ", Suggestion(keys_.experiment, table_.columns())));
      return values;
    }
    for (const Experiment& experiment : campaign_.experiments) {
      std::vector<std::size_t> rows;
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        if (names.empty() || names[i] == experiment.name) rows.push_back(i);
      }
      values.push_back(StatesOf(experiment, std::move(rows)));
    }
    return values;
  }

 private:
  using States = std::vector<std::vector<double>>;  // of each sample

  // A column under our name, SI.
  std::vector<double> Column(const std::string& name) {
    const dem::ObservableInfo* info = dem::FindObservable(name);
    const double factor =
        FactorOf(map_, "state_units", keys_.state_units, name, info != nullptr ? info->unit : "1");
    std::vector<double> values =
        NumberColumn(keys_.states, table_, ColumnOf(keys_.state_columns, name), context_);
    for (double& value : values) value *= factor;
    return values;
  }

  States StatesOf(const Experiment& experiment, std::vector<std::size_t> rows) {
    const std::size_t before = context_.problems().size();
    const std::size_t numbers = experiment.control.size() * experiment.observables.size();
    const auto samples = static_cast<std::size_t>(campaign_.precomputed->parameters.rows());
    States states(samples, std::vector<double>(numbers, std::nan("")));
    if (rows.empty()) {
      context_.problems().AddIn(keys_.states, 0, keys_.experiment,
                                absl::StrCat("holds no states of ", experiment.name));
      return states;
    }
    StateRows found{.rows = std::move(rows), .columns = {}, .control = {}};
    for (const MeasuredObservable& observable : experiment.observables) {
      found.columns.push_back(Column(observable.name));
    }
    const std::string& control = experiment.control_name;
    if (!context_.by_first_rules() && !control.empty() &&
        table_.Has(ColumnOf(keys_.state_columns, control))) {
      found.control = Column(control);
    }
    CheckKeys(found);
    if (context_.problems().size() > before || row_of_sample_.empty()) return states;
    if (const auto apart = FirstElsewhere(experiment, found)) {
      if (CanInterpolate(experiment, found, *apart)) Interpolate(experiment, found, states);
    } else {
      Pair(experiment, found, states);
    }
    return states;
  }

  // Each step of each sample once, and of no other samples.
  void CheckKeys(const StateRows& found) {
    std::set<std::pair<int, int>> seen;
    for (const std::size_t row : found.rows) {
      if (!seen.emplace(samples_[row], steps_[row]).second) {
        context_.problems().AddIn(keys_.states, table_.LineOf(row), keys_.step,
                                  absl::StrCat("step ", steps_[row], " of sample ", samples_[row],
                                               " stands here for the second time"));
        return;
      }
      if (!row_of_sample_.empty() && !row_of_sample_.contains(samples_[row])) {
        context_.problems().AddIn(
            keys_.states, table_.LineOf(row), keys_.sample,
            absl::StrCat("sample ", samples_[row], " is not in ", keys_.parameters));
        return;
      }
    }
  }

  struct StepSpan {
    std::size_t lowest = 0, highest = 0;  // rows
  };
  StepSpan StepsOf(const StateRows& found) const {
    const auto [low, high] =
        std::minmax_element(found.rows.begin(), found.rows.end(),
                            [this](std::size_t a, std::size_t b) { return steps_[a] < steps_[b]; });
    return {*low, *high};
  }

  static ControlSpan SpanOf(const std::vector<double>& control) {
    const auto [low, high] = std::minmax_element(control.begin(), control.end());
    return {*low, *high};
  }

  // The first row whose control is not that of the reading of its step; empty: all agree, or the
  // table does not say.
  std::optional<std::size_t> FirstElsewhere(const Experiment& experiment, const StateRows& found) {
    if (found.control.empty() || experiment.control.empty()) return std::nullopt;
    const double slack = SpanOf(experiment.control).slack();
    const int first = steps_[StepsOf(found).lowest];
    const auto apart =
        std::find_if(found.rows.begin(), found.rows.end(), [&](const std::size_t row) {
          const auto reading = static_cast<std::size_t>(steps_[row] - first);
          return reading >= experiment.control.size() ||
                 std::abs(found.control[row] - experiment.control[reading]) > slack;
        });
    if (apart == found.rows.end()) return std::nullopt;
    return *apart;
  }

  // A path that turns back cannot be compared between steps, and nothing is known beyond the runs.
  bool CanInterpolate(const Experiment& experiment, const StateRows& found, std::size_t apart) {
    const ControlSpan readings = SpanOf(experiment.control);
    ControlSpan runs{found.control[found.rows.front()], found.control[found.rows.front()]};
    for (const std::size_t row : found.rows) {
      runs = {std::min(runs.least, found.control[row]), std::max(runs.most, found.control[row])};
    }
    const bool turns = TurningPointsOf(experiment) > 0;
    if (runs.Reaches(readings) && !turns) return true;
    const std::string& name = experiment.control_name;
    const bool strain = name.ends_with("_strain");
    context_.problems().AddIn(
        keys_.states, table_.LineOf(apart), ColumnOf(keys_.state_columns, name),
        absl::StrCat("the runs go ", ToText(runs, name), ", the readings of ", experiment.name, " ",
                     ToText(readings, name),
                     turns ? " and back: on a path that turns the steps have to be the readings"
                           : "; runs have to reach what was measured",
                     strain ? " (strains of runs are logarithmic; data.strain says what the "
                              "readings' are)"
                            : ""),
        "control_mismatch");
    return false;
  }

  // Straight lines between the steps of each run; NaN beyond them.
  void Interpolate(const Experiment& experiment, const StateRows& found, States& states) {
    std::map<int, std::map<int, std::size_t>> runs;  // sample, step: row
    for (const std::size_t row : found.rows) runs[samples_[row]][steps_[row]] = row;
    const std::size_t width = found.columns.size();
    for (const auto& [sample, run] : runs) {
      std::vector<double>& state = states[static_cast<std::size_t>(row_of_sample_.at(sample))];
      for (std::size_t i = 0; i < experiment.control.size(); ++i) {
        const double at = experiment.control[i];
        for (auto step = run.begin(); step != run.end(); ++step) {
          const auto next = std::next(step) == run.end() ? step : std::next(step);
          const double from = found.control[step->second];
          const double to = found.control[next->second];
          if (std::min(from, to) > at || std::max(from, to) < at) continue;
          const double part = to != from ? (at - from) / (to - from) : 0;
          for (std::size_t j = 0; j < width; ++j) {
            const double a = found.columns[j][step->second];
            state[i * width + j] = a + part * (found.columns[j][next->second] - a);
          }
          break;
        }
      }
    }
  }

  // Steps count from 0, or from 1 where no row has step 0 and one has as many as there are
  // readings.
  void Pair(const Experiment& experiment, const StateRows& found, States& states) {
    const std::size_t readings = experiment.control.size();
    const StepSpan span = StepsOf(found);
    const int low = steps_[span.lowest];
    const int high = steps_[span.highest];
    const int first = low == 1 && high == static_cast<int>(readings) ? 1 : 0;
    if (readings > 0 && (low != first || high - first + 1 != static_cast<int>(readings))) {
      context_.problems().AddIn(keys_.states, table_.LineOf(span.highest), keys_.step,
                                absl::StrCat("the steps run from ", low, " to ", high, ", but ",
                                             experiment.name, " has ", readings, " readings"));
      return;
    }
    const std::size_t width = found.columns.size();
    for (const std::size_t row : found.rows) {
      const auto reading = static_cast<std::size_t>(steps_[row] - first);
      const auto sample = static_cast<std::size_t>(row_of_sample_.at(samples_[row]));
      for (std::size_t j = 0; j < width && reading < readings; ++j) {
        states[sample][reading * width + j] = found.columns[j][row];
      }
    }
  }

  MapReader& map_;
  const RunTableKeys& keys_;
  const Campaign& campaign_;
  const std::map<int, Eigen::Index>& row_of_sample_;
  const DataTable& table_;
  ReadContext& context_;
  std::vector<int> samples_, steps_;  // of each row
};

}  // namespace

std::vector<std::vector<std::vector<double>>> ReadRunStates(
    MapReader& map, const RunTableKeys& keys, const Campaign& campaign,
    const std::map<int, Eigen::Index>& row_of_sample, ReadContext& context) {
  std::vector<std::string> wanted = {keys.sample, keys.step};
  for (const Experiment& experiment : campaign.experiments) {
    for (const MeasuredObservable& observable : experiment.observables) {
      wanted.push_back(ColumnOf(keys.state_columns, observable.name));
    }
  }
  const auto table = OpenRunTable(map, "states", keys.states, wanted, context);
  if (!table) return {};
  return StatesReader(map, keys, campaign, row_of_sample, *table, context).Read();
}

}  // namespace calib::campaign
