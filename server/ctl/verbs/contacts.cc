#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verb.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

absl::StatusOr<int> Contacts(const CommonOptions& common) {
  if (common.json) {
    std::cout << report::ContactsJson();
    return kDone;
  }
  for (const dem::ContactInfo& contact : dem::Contacts()) {
    std::cout << contact.name << "\n"
              << report::Wrapped(contact.description, "  ", "  ")
              << report::Wrapped(contact.reference, "  ", "  ")
              << ParameterTable(contact.parameters) << "\n";
  }
  return kDone;
}

}  // namespace

Verb ContactsVerb() {
  return {.help = {.name = "contacts",
                   .description = "Contact laws this build offers",
                   .example = "contacts"},
          .run = &Contacts};
}

}  // namespace calib::ctl
