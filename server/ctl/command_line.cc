#include "server/ctl/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/address.h"
#include "proto/rpc/digest.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/utf8.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"

namespace calib::ctl {
namespace {

constexpr const char* kDescription =
    "Calibrates discrete element models of granular materials against laboratory tests.\n\n"
    "First steps:\n"
    "  calibctl validate sand.yaml                     is the campaign file right?\n"
    "  calibctl run sand.yaml                          the whole calibration on this machine\n"
    "  calibctl report c1 --state calib-state -o r.html\n";

constexpr const char* kErrorMeans =
    "\n\nError: root mean square over readings of (model - measurement) / sd, where sd is that of "
    "a\n"
    "measurement: its noise and, where it is known, the scatter between packings. 1 is as "
    "expected.\n"
    "  fitted, held out   of the model at its posterior, by the role of the experiments\n"
    "  of the best fit    of the point of the parameter space that comes closest (diagnose)\n"
    "  with an effect     of the best fit with it alone";

// As that of calib-worker, in lines.
std::string VersionText() {
  return absl::StrCat("calibctl ", CALIB_VERSION, "\nmechanics ", dem::EngineVersion(),
                      "\ncatalogue ", rpc::Sha256Hex(dem::CatalogText()));
}

// What stands where the verb should, if it is none; the values of options before it are passed
// over.
std::optional<std::string> UnknownVerb(const std::vector<std::string>& verbs, int argc,
                                       const char* const* argv) {
  const std::set<std::string> with_value = {"--server", "--state", "--workers", "--tls", "--token"};
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (with_value.contains(word)) {
      ++i;
    } else if (!word.starts_with('-')) {
      const bool known = std::find(verbs.begin(), verbs.end(), word) != verbs.end();
      return known ? std::nullopt : std::optional(word);
    }
  }
  return std::nullopt;
}

void AddVerb(const Verb& verb, CLI::App& app, std::optional<Verb>& chosen) {
  CLI::App* const sub = app.add_subcommand(verb.help.name, verb.help.description);
  sub->footer("Example:\n  calibctl " + verb.help.example +
              "\n\nWith --help before the verb: options that every verb takes." +
              (verb.help.speaks_of_errors ? kErrorMeans : ""));
  sub->callback([&chosen, verb] { chosen = verb; });
  if (verb.declare) {
    OptionList options(sub);
    verb.declare(options);
  }
}

// $CALIB_SERVER is a default, not a wish: it does not stand in the way of --state.
void AddCommonOptions(CLI::App& app, CommonOptions& common) {
  if (const char* server = std::getenv("CALIB_SERVER"); server != nullptr)
    common.server.address = server;
  auto* server = app.add_option_function<std::string>(
      "--server",
      [&common](const std::string& address) {
        common.server.address = address;
        common.server.given = true;
      },
      "HOST:PORT of calibd, or unix:/PATH [$CALIB_SERVER or 127.0.0.1:7443]");
  server->check([](const std::string& address) { return rpc::ProblemOfAddress(address); });
  app.add_option("--state", common.server.state,
                 "work on this state folder with an embedded server instead of --server")
      ->excludes(server);
  app.add_option("--tls", common.server.tls,
                 "folder of a certificate, from `calibctl certs issue` [$CALIB_TLS]");
  app.add_option("--token", common.server.token,
                 "file with the token of a calibd without certificates [$CALIB_TOKEN, or where a "
                 "server of this account leaves it]");
  app.add_option("--workers", common.server.workers,
                 "local workers beside the embedded server (run: all cores unless given)")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--json", common.json, "one JSON document on standard output");
  app.set_version_flag("--version", VersionText(),
                       "version, mechanics and catalogue of this build");
}

void MakeApp(const std::vector<Verb>& verbs, CLI::App& app, CommonOptions& common,
             std::optional<Verb>& chosen) {
  app.require_subcommand(1);
  app.fallthrough();  // common options may stand behind the verb too
  app.get_formatter()->column_width(28);
  AddCommonOptions(app, common);
  for (const Verb& verb : verbs) AddVerb(verb, app, chosen);
}

std::vector<OptionEntry> OptionsOf(const CLI::App& app) {
  std::vector<OptionEntry> entries;
  for (const CLI::Option* option : app.get_options()) {
    OptionEntry entry{.help = option->get_description(),
                      .at_its_place = option->get_positional(),
                      .takes_value = option->get_items_expected_max() > 0,
                      .required = option->get_required()};
    if (entry.at_its_place) entry.names.push_back(option->get_name(/*positional=*/true));
    for (const std::string& name : option->get_snames()) entry.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) entry.names.push_back("--" + name);
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace

Parsed ParseCommandLine(const std::vector<Verb>& verbs, int argc, const char* const* argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (campaign::FirstByteThatIsNoUtf8(word) == std::string::npos) continue;
    std::cerr << "calibctl: '" << absl::CHexEscape(word)
              << "' is not UTF-8, as names of files and ids have to be\n";
    return {std::nullopt, kBadInput};
  }
  CommonOptions common;
  std::optional<Verb> chosen;
  CLI::App app{kDescription, "calibctl"};
  MakeApp(verbs, app, common, chosen);
  std::vector<std::string> names;
  names.reserve(verbs.size());
  for (const Verb& verb : verbs) names.push_back(verb.help.name);
  if (const auto word = UnknownVerb(names, argc, argv)) {
    std::cerr << "calibctl: " << campaign::Quoted(*word) << " is not a command; "
              << campaign::Suggestion(*word, names) << "\n";
    return {std::nullopt, kBadInput};
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return {std::nullopt, app.exit(error) == 0 ? kDone : kBadInput};
  }
  return {Command{*std::move(chosen), std::move(common)}, kDone};
}

CommandTree DescribeCommands(const std::vector<Verb>& verbs) {
  CommonOptions common;
  std::optional<Verb> chosen;
  CLI::App app{kDescription, "calibctl"};
  MakeApp(verbs, app, common, chosen);
  CommandTree tree{.version = VersionText(), .common = OptionsOf(app)};
  for (const Verb& verb : verbs) {
    VerbEntry entry{
        .name = verb.help.name, .description = verb.help.description, .example = verb.help.example};
    for (OptionEntry& option : OptionsOf(*app.get_subcommand(verb.help.name))) {
      const bool is_help = option.names.back() == "--help";  // common to all
      if (!is_help) entry.options.push_back(std::move(option));
    }
    tree.verbs.push_back(std::move(entry));
  }
  return tree;
}

}  // namespace calib::ctl
