#include <iostream>

#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/methods/registry.h"
#include "server/report/documents/campaign_schema.h"

namespace calib::ctl {
namespace {

struct SchemaOptions {
  bool reference = false;
};

void DeclareSchema(OptionList& list, SchemaOptions& options) {
  list.Flag("--reference", options.reference, "The same as a table of all keys, in Markdown");
}

absl::StatusOr<int> Schema(const CommonOptions&, const SchemaOptions& options) {
  std::cout << (options.reference ? report::KeyReference(methods::All())
                                  : report::CampaignSchema(methods::All()));
  return kDone;
}

}  // namespace

Verb SchemaVerb() {
  return MakeVerb<SchemaOptions>(
      {.name = "schema",
       .description = "JSON Schema of the campaign file, by which editors complete and check",
       .example = "schema > campaign.schema.json"},
      &DeclareSchema, &Schema);
}

}  // namespace calib::ctl
