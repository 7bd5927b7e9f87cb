#include <iostream>
#include <set>
#include <string>

#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/client/documents.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct StatesOptions {
  std::string campaign;
  int sample = 0;
};

void Print(const std::string& experiment, const report::StateHistory& history) {
  std::vector<std::string> columns = {"step"};
  columns.insert(columns.end(), history.observables.begin(), history.observables.end());
  std::set<std::string> others;  // that a program told besides
  for (const v1::State& state : history.states) {
    for (const auto& [name, value] : state.others()) others.insert(name);
  }
  columns.insert(columns.end(), others.begin(), others.end());
  report::TextTable table(columns);
  for (const v1::State& state : history.states) {
    std::vector<std::string> row = {std::to_string(state.load_step())};
    for (int k = 0; k < state.values_size(); ++k) {
      const std::string& name = history.observables[static_cast<std::size_t>(k)];
      const dem::ObservableInfo* info = dem::FindObservable(name);
      row.push_back(
          report::NumberWithUnit(state.values(k), name, info != nullptr ? info->unit : "1"));
    }
    for (const std::string& name : others) {
      const auto told = state.others().find(name);
      row.push_back(told == state.others().end() ? "" : report::Number(told->second, 5));
    }
    table.AddRow(std::move(row));
  }
  std::cout << experiment << "\n" << table.ToString() << "\n";
}

void Declare(OptionList& list, StatesOptions& options) {
  list.Campaign(options.campaign);
  list.WholeNumber("SAMPLE", options.sample, "index, as shown by `calibctl samples`").Required();
}

absl::StatusOr<int> States(const CommonOptions& common, const StatesOptions& options) {
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  if (common.json) {
    ASSIGN_OR_RETURN(const auto document,
                     client::StatesDocument(session->client(), options.campaign, options.sample));
    std::cout << document;
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto states,
                   client::LoadStates(session->client(), options.campaign, options.sample));
  std::map<std::string, report::StateHistory> by_experiment;
  for (const auto& [key, history] : states) by_experiment[key.first] = history;
  if (by_experiment.empty()) std::cout << "Sample " << options.sample << " has no states yet.\n";
  for (const auto& [experiment, history] : by_experiment) Print(experiment, history);
  return kDone;
}

}  // namespace

Verb StatesVerb() {
  return MakeVerb<StatesOptions>({.name = "states",
                                  .description = "The state history of one sample",
                                  .example = "states c1 0 --state calib-state"},
                                 &Declare, &States);
}

}  // namespace calib::ctl
