#include <algorithm>
#include <iostream>
#include <sstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/client/documents.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/messages/read_words.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

struct SamplesOptions {
  std::string campaign;
  bool rows = false;
};

void Declare(OptionList& list, SamplesOptions& options) {
  list.Campaign(options.campaign);
  list.Flag(
      "--rows", options.rows,
      "its finished runs as `rows` for `inference` of another campaign file, which takes them "
      "over without running them again");
}

// With every digit: the runs are known by them. Empty: none has finished.
std::string RowsOf(const campaign::Campaign& campaign, const std::vector<v1::Sample>& samples) {
  std::vector<campaign::YamlNode> rows;
  for (const v1::Sample& sample : samples) {
    if (messages::StatusOf(sample) != campaign::EvaluationStatus::kFinished ||
        messages::PurposeOf(sample) != campaign::SamplePurpose::kEnsemble)
      continue;
    const int stream =
        sample.has_stream() ? sample.stream() : campaign::StreamOf(campaign, sample.index());
    campaign::YamlNode row =
        campaign::YamlMap({{"like", campaign::YamlScalar(std::to_string(stream))}});
    for (int k = 0; k < sample.parameters_size(); ++k) {
      const std::string& name = campaign.parameters[static_cast<std::size_t>(k)].name;
      campaign::YamlAt(row, name) = campaign::YamlNumber(sample.parameters(k));
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) return "";
  return campaign::ToYaml(campaign::YamlMap({{"rows", campaign::YamlList(std::move(rows))}}));
}

absl::StatusOr<int> Samples(const CommonOptions& common, const SamplesOptions& options) {
  if (options.rows && common.json) {
    return absl::InvalidArgumentError("--rows are lines of a campaign file; leave --json out");
  }
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  if (common.json) {
    ASSIGN_OR_RETURN(const auto document, client::SamplesDocument(client, options.campaign));
    std::cout << document;
    return kDone;
  }
  ASSIGN_OR_RETURN(const auto samples, client.GetSamples(options.campaign));
  ASSIGN_OR_RETURN(const auto source, client.GetSource(options.campaign));
  ASSIGN_OR_RETURN(const auto campaign, client::LoadCampaign(client, source));
  if (options.rows) {
    const std::string rows = RowsOf(campaign, samples);
    if (rows.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("no sample of ", options.campaign, " has finished yet"));
    }
    std::cout << rows;
    return kDone;
  }
  std::vector<std::string> columns = {"sample", "iteration", "<status", "weight", "log likelihood"};
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    columns.push_back(parameter.name);
  }
  report::TextTable table(columns);
  for (const v1::Sample& s : samples) {
    std::vector<std::string> row = {std::to_string(s.index()), std::to_string(s.iteration()),
                                    s.status(), report::Number(s.weight(), 3),
                                    report::Number(s.log_likelihood(), 5)};
    for (int k = 0; k < s.parameters_size(); ++k) {
      const campaign::CalibratedParameter& p = campaign.parameters[static_cast<std::size_t>(k)];
      row.push_back(report::NumberWithUnit(s.parameters(k), p.name, p.unit));
    }
    table.AddRow(std::move(row));
  }
  std::cout << table.ToString();
  for (const v1::Sample& s : samples) {
    if (s.words().empty()) continue;
    std::cout << "\nsample " << s.index() << ", " << s.status()
              << (s.reason().empty() ? "" : ": " + s.reason())
              << "\n  its program printed last on standard error:\n";
    std::istringstream lines(s.words());
    for (std::string line; std::getline(lines, line);) std::cout << "  | " << line << "\n";
  }
  const auto keeps = [](const v1::Sample& s) { return s.kept_size() > 0; };
  if (std::any_of(samples.begin(), samples.end(), keeps)) {
    std::cout << "\nFiles of the program that stay with a sample: calibctl kept "
              << options.campaign << " SAMPLE.\n";
  }
  return kDone;
}

}  // namespace

Verb SamplesVerb() {
  return MakeVerb<SamplesOptions>({.name = "samples",
                                   .description = "The ensemble with weights and status",
                                   .example = "samples c1 --state calib-state"},
                                  &Declare, &Samples);
}

}  // namespace calib::ctl
