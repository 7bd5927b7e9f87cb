#include <iostream>

#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/answer_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/views/model_comparison.h"

namespace calib::ctl {
namespace {

absl::StatusOr<report::RivalModel> LoadRival(client::Client& client, const std::string& id) {
  const auto source = client.GetSource(id);
  if (!source.ok()) return source.status();
  auto read = client::LoadCampaign(client, *source);
  if (!read.ok()) return read.status();
  auto posterior = client.GetPosterior(id, std::nullopt);
  if (!posterior.ok()) return posterior.status();
  return report::RivalModel{.campaign = *std::move(read), .posterior = *std::move(posterior)};
}

}  // namespace

int Models(const Arguments& arguments) {
  const auto session = client::Session::Open(arguments.server);
  if (!session.ok()) return Fail(session.status());
  std::vector<report::RivalModel> rivals;
  for (const std::string& id : arguments.campaigns) {
    auto rival = LoadRival((*session)->client(), id);
    if (!rival.ok()) return Fail(rival.status());
    rivals.push_back(*std::move(rival));
  }
  const auto comparison = report::CompareModels(rivals);
  if (!comparison.ok()) return Fail(comparison.status());
  std::cout << (arguments.json ? report::ModelsJson(*comparison) : ModelsText(*comparison));
  return kDone;
}

}  // namespace calib::ctl
