// Certificates of an installation, on folders alone: no server is asked.
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/return_if_error.h"
#include "server/access/authority.h"
#include "server/access/certificate.h"
#include "server/access/role.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

struct CertsOptions {
  std::string action;  ///< init | issue | revoke
  std::string authority;
  std::string name{};
  std::string role{};
  std::vector<std::string> hosts{};
  std::optional<int> days{};
  std::string output{};
};

void Declare(OptionList& list, CertsOptions& options) {
  list.Text("ACTION", options.action, "init, issue or revoke").Required();
  list.Text("CA", options.authority, "folder of the authority, which only its owner may enter")
      .Required();
  list.Text("NAME", options.name,
            "of issue and revoke: whose certificate, as node7 or anna@example.org");
  list.Text("--role", options.role, absl::StrCat("of issue: ", access::RoleNames()));
  list.Texts("--host", options.hosts,
             "of a server: a name or address by which it is reached, beside localhost; may be "
             "given more than once");
  list.WholeNumber("--days", options.days, "validity of the certificate, 1 to 3650 [365]");
  list.Text("-o,--output", options.output,
            "of issue: folder for ca.pem, cert.pem, key.pem, crl.pem; one that holds a "
            "certificate of NAME is renewed");
}

/// Options that belong to `issue` and were given to another action.
std::vector<std::string> Misplaced(const CertsOptions& options) {
  std::vector<std::string> problems;
  for (const auto& [option, given] :
       {std::pair("--role", !options.role.empty()), std::pair("--host", !options.hosts.empty()),
        std::pair("--days", options.days.has_value()), std::pair("-o", !options.output.empty())}) {
    if (given) problems.push_back(absl::StrCat(option, " belongs to `certs issue`"));
  }
  return problems;
}

std::vector<std::string> Problems(const CertsOptions& options) {
  if (options.action == "init") {
    std::vector<std::string> problems = Misplaced(options);
    if (!options.name.empty()) {
      problems.push_back("init makes an authority and takes no NAME: `certs init CA`");
    }
    return problems;
  }
  if (options.action == "revoke") {
    std::vector<std::string> problems = Misplaced(options);
    if (options.name.empty()) problems.push_back("whose certificate? `certs revoke CA NAME`");
    return problems;
  }
  if (options.action != "issue") {
    return {absl::StrCat("certs \"", options.action, "\" is none of init, issue, revoke")};
  }
  std::vector<std::string> problems;
  if (options.name.empty()) {
    problems.push_back("whose certificate? `certs issue CA --role ROLE NAME -o FOLDER`");
  }
  if (!access::RoleOf(options.role)) {
    problems.push_back(
        options.role.empty()
            ? absl::StrCat("--role is missing: one of ", access::RoleNames())
            : absl::StrCat("--role \"", options.role, "\" is none of ", access::RoleNames()));
  }
  if (options.output.empty()) problems.push_back("-o is missing: the folder for the certificate");
  return problems;
}

int Refuse(const std::vector<std::string>& problems) {
  for (const std::string& problem : problems) std::cerr << "calibctl: " << problem << "\n";
  return kBadInput;
}

/// A folder or a name that was given and is not there is bad input; so is a request with problems,
/// each on a line.
absl::StatusOr<int> Answer(const absl::Status& status) {
  if (absl::IsInvalidArgument(status) || absl::IsNotFound(status)) {
    return Refuse(absl::StrSplit(std::string(status.message()), '\n'));
  }
  return status;
}

std::vector<std::string> Paths(const std::string& folder, const std::vector<std::string>& names) {
  std::vector<std::string> paths;
  paths.reserve(names.size());
  for (const std::string& name : names) {
    paths.push_back((std::filesystem::path(folder) / name).string());
  }
  return paths;
}

absl::StatusOr<int> Init(const CommonOptions& common, const CertsOptions& options) {
  RETURN_IF_ERROR(access::InitAuthority(options.authority));
  ASSIGN_OR_RETURN(const std::int64_t end, access::EndOfAuthority(options.authority));
  if (common.json) {
    const nlohmann::json answer = {
        {"authority", options.authority},
        {"not_after_unix_s", end},
        {"written", Paths(options.authority, {"ca.pem", "ca-key.pem", "crl.pem", "issued.csv"})}};
    std::cout << answer.dump(2) << "\n";
    return kDone;
  }
  std::cout << options.authority << ": a new authority, valid until " << access::DateOf(end)
            << ". Who can read ca-key.pem can issue any role: keep the folder off shared disks.\n"
            << "Next: calibctl certs issue " << options.authority
            << " --role server --host HOST NAME -o FOLDER\n";
  return kDone;
}

std::string NextOf(const access::Holder& holder, const std::string& folder) {
  switch (holder.role) {
    case access::Role::kServer:
      return absl::StrCat("calibd --tls ", folder);
    case access::Role::kWorker:
      return absl::StrCat("calib-worker --tls ", folder);
    case access::Role::kViewer:
    case access::Role::kSubmitter:
    case access::Role::kOperator:
      return absl::StrCat("calibctl --tls ", folder, " list");
  }
  return "";
}

absl::StatusOr<int> Issue(const CommonOptions& common, const CertsOptions& options) {
  access::Request request{
      .name = options.name, .role = *access::RoleOf(options.role), .hosts = options.hosts};
  if (options.days) request.days = *options.days;
  ASSIGN_OR_RETURN(const access::Holder holder,
                   access::Issue(options.authority, request, options.output));
  if (common.json) {
    const nlohmann::json answer = {
        {"name", holder.name},
        {"role", access::NameOf(holder.role)},
        {"serial", holder.serial},
        {"hosts", holder.hosts},
        {"not_before_unix_s", holder.not_before_unix_s},
        {"not_after_unix_s", holder.not_after_unix_s},
        {"folder", options.output},
        {"written", Paths(options.output, {"ca.pem", "cert.pem", "key.pem", "crl.pem"})}};
    std::cout << answer.dump(2) << "\n";
    return kDone;
  }
  std::cout << options.output << ": ca.pem, cert.pem, key.pem and crl.pem of " << holder.name
            << " (" << access::NameOf(holder.role) << "), valid until "
            << access::DateOf(holder.not_after_unix_s) << "; the same command renews them.\n";
  if (!holder.hosts.empty()) {
    std::cout << "It answers to " << absl::StrJoin(holder.hosts, ", ") << ".\n";
  }
  std::cout << "Next: copy the folder to its user, who alone may read key.pem; then "
            << NextOf(holder, options.output) << "\n";
  return kDone;
}

absl::StatusOr<int> Revoke(const CommonOptions& common, const CertsOptions& options) {
  ASSIGN_OR_RETURN(const int revoked, access::Revoke(options.authority, options.name));
  const std::string list = Paths(options.authority, {"crl.pem"})[0];
  if (common.json) {
    const nlohmann::json answer = {
        {"name", options.name},
        {"revoked", revoked},
        {"written", revoked > 0 ? std::vector{list} : std::vector<std::string>{}}};
    std::cout << answer.dump(2) << "\n";
    return kDone;
  }
  if (revoked == 0) {
    std::cout << options.name << " holds no certificate that is still valid; " << list
              << " says all.\n";
  } else {
    std::cout << revoked << (revoked == 1 ? " certificate of " : " certificates of ")
              << options.name << " revoked in " << list << ".\n";
  }
  std::cout << "Next: copy " << list << " into the folder that calibd --tls names (the list of a "
            << "server: into those of all who ask it); it is read again by itself.\n";
  return kDone;
}

absl::StatusOr<int> Certs(const CommonOptions& common, const CertsOptions& options) {
  if (const auto problems = Problems(options); !problems.empty()) return Refuse(problems);
  const auto done = options.action == "init"    ? Init(common, options)
                    : options.action == "issue" ? Issue(common, options)
                                                : Revoke(common, options);
  return done.ok() ? done : Answer(done.status());
}

}  // namespace

Verb CertsVerb() {
  return MakeVerb<CertsOptions>(
      {.name = "certs",
       .description = "Certificates for server, workers and people: an authority issues and "
                      "revokes them",
       .example = "certs issue CA --role server --host node1 head -o head-tls"},
      &Declare, &Certs);
}

}  // namespace calib::ctl
