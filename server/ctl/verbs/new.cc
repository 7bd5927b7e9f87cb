#include <iostream>

#include "calib/return_if_error.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/report/documents/campaign_outline.h"

namespace calib::ctl {
namespace {

struct NewOptions {
  std::string test, contact;
};

void DeclareNew(OptionList& list, NewOptions& options) {
  list.Text("--test", options.test, "Lab test that is to be reproduced (calibctl tests)")
      .Required();
  list.Text("--contact", options.contact, "Contact law (calibctl contacts)").Required();
}

absl::StatusOr<int> New(const CommonOptions&, const NewOptions& options) {
  ASSIGN_OR_RETURN(const std::string text, report::CampaignOutline(options.test, options.contact));
  std::cout << text;
  return kDone;
}

}  // namespace

Verb NewVerb() {
  return MakeVerb<NewOptions>({.name = "new",
                               .description = "A campaign file to begin with, on standard output",
                               .example = "new --test triaxial_drained --contact hertz_mindlin"},
                              &DeclareNew, &New);
}

}  // namespace calib::ctl
