#include <iostream>

#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {

int Samples(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  client::Client& client = (*session)->client();
  const auto samples = client.GetSamples(arguments.campaign);
  if (!samples.ok()) return Fail(samples.status());
  const auto source = client.GetSource(arguments.campaign);
  if (!source.ok()) return Fail(source.status());
  const auto campaign = client::LoadCampaign(client, *source);
  if (!campaign.ok()) return Fail(campaign.status());
  std::vector<std::string> names;
  std::vector<std::string> columns = {"sample", "iteration", "<status", "weight", "log likelihood"};
  for (const campaign::CalibratedParameter& parameter : campaign->parameters) {
    names.push_back(parameter.name);
    columns.push_back(parameter.name);
  }
  if (arguments.json) {
    std::cout << report::SamplesJson(arguments.campaign, names, *samples);
    return kDone;
  }
  report::TextTable table(columns);
  for (const v1::Sample& s : *samples) {
    std::vector<std::string> row = {std::to_string(s.index()), std::to_string(s.iteration()),
                                    s.status(), report::Number(s.weight(), 3),
                                    report::Number(s.log_likelihood(), 5)};
    for (int k = 0; k < s.parameters_size(); ++k) {
      const campaign::CalibratedParameter& p = campaign->parameters[static_cast<std::size_t>(k)];
      row.push_back(report::NumberWithUnit(s.parameters(k), p.name, p.unit));
    }
    table.AddRow(std::move(row));
  }
  std::cout << table.ToString();
  return kDone;
}

}  // namespace calib::ctl
