#include <iostream>

#include "server/ctl/catalog_text.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/report/documents/json_documents.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {

int Contacts(const Arguments& arguments) {
  if (arguments.json) {
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

}  // namespace calib::ctl
