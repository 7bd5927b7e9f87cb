#include "server/ctl/state_table.h"

#include <algorithm>
#include <memory>

#include "server/campaign/file/text/data_file.h"

namespace calib::ctl {

std::string JoinStateTables(const std::vector<std::pair<std::string, std::string>>& tables) {
  std::vector<std::unique_ptr<campaign::DataTable>> parsed;
  std::vector<std::string> observables;
  for (const auto& [experiment, text] : tables) {
    std::vector<campaign::TableProblem> ignored;  // no rows: nothing was reached
    const std::string whole = text.substr(0, text.rfind('\n') + 1);
    parsed.push_back(
        std::make_unique<campaign::DataTable>(whole, std::vector<std::string>(), ignored));
    for (const std::string& column : parsed.back()->columns()) {
      const bool known =
          std::find(observables.begin(), observables.end(), column) != observables.end();
      if (column != "load_step" && !known) observables.push_back(column);
    }
  }
  std::string csv = "experiment,load_step";
  for (const std::string& observable : observables) csv += "," + observable;
  csv += "\n";
  for (std::size_t e = 0; e < tables.size(); ++e) {
    std::vector<std::vector<std::string>> columns = {parsed[e]->Texts("load_step")};
    for (const std::string& observable : observables) {
      columns.push_back(parsed[e]->Texts(observable));
    }
    for (std::size_t row = 0; row < parsed[e]->rows(); ++row) {
      csv += tables[e].first;
      for (const auto& column : columns) csv += "," + (column.empty() ? "" : column[row]);
      csv += "\n";
    }
  }
  return csv;
}

}  // namespace calib::ctl
