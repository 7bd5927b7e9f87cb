#include <iostream>

#include "dem/catalog/catalog.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

void Print(const std::string& experiment, const report::StateHistory& history) {
  std::vector<std::string> columns = {"step"};
  columns.insert(columns.end(), history.observables.begin(), history.observables.end());
  report::TextTable table(columns);
  for (const v1::State& state : history.states) {
    std::vector<std::string> row = {std::to_string(state.load_step())};
    for (int k = 0; k < state.values_size(); ++k) {
      const std::string& name = history.observables[static_cast<std::size_t>(k)];
      const dem::ObservableInfo* info = dem::FindObservable(name);
      row.push_back(
          report::NumberWithUnit(state.values(k), name, info != nullptr ? info->unit : "1"));
    }
    table.AddRow(std::move(row));
  }
  std::cout << experiment << "\n" << table.ToString() << "\n";
}

}  // namespace

int States(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  const auto states =
      client::LoadStates((*session)->client(), arguments.campaign, arguments.sample);
  if (!states.ok()) return Fail(states.status());
  std::map<std::string, report::StateHistory> by_experiment;
  for (const auto& [key, history] : *states) by_experiment[key.first] = history;
  if (arguments.json) {
    std::cout << report::StatesJson(arguments.campaign, arguments.sample, by_experiment);
    return kDone;
  }
  if (by_experiment.empty()) std::cout << "Sample " << arguments.sample << " has no states yet.\n";
  for (const auto& [experiment, history] : by_experiment) Print(experiment, history);
  return kDone;
}

}  // namespace calib::ctl
