#include "server/ctl/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "proto/rpc/address.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/utf8.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"

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
    "  with an effect     of the best fit with it: by the screen, or refitted where a p says so\n"
    "  left out           of data that the model was not fitted to, part after part";

// CLI11 wraps negative and too large numbers round.
std::string WholeNumber(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size()) return "";
  return absl::StrCat("'", text, "' is not a whole number from 0 to 18446744073709551615");
}

// What stands where the verb should, if it is none; the values of options before it are passed
// over.
std::optional<std::string> UnknownVerb(const std::vector<std::string>& verbs, int argc,
                                       const char* const* argv) {
  const std::set<std::string> with_value = {"--server", "--state", "--workers"};
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

// Declares one verb after the other; options write into one Arguments.
class Builder {
 public:
  Builder(CLI::App& app, Command& command) : app_(app), command_(command) {}

  // A verb with its one-line description and an example.
  CLI::App* Add(const std::string& name, int (*verb)(const Arguments&),
                const std::string& description, const std::string& example) {
    CLI::App* sub = app_.add_subcommand(name, description);
    sub->footer("Example:\n  calibctl " + example +
                "\n\nWith --help before the verb: options that every verb takes.");
    sub->callback([this, verb] { command_.verb = verb; });
    return sub;
  }

  // For verbs that speak of errors.
  static void ExplainError(CLI::App* sub) { sub->footer(sub->get_footer() + kErrorMeans); }

  CLI::App* AddOnCampaign(const std::string& name, int (*verb)(const Arguments&),
                          const std::string& description, const std::string& more = "") {
    CLI::App* sub = Add(name, verb, description, name + " c1" + more + " --state calib-state");
    sub->add_option("ID", arguments().campaign, "campaign, as shown by `calibctl list`")
        ->required();
    return sub;
  }

  void AddFile(CLI::App* sub) {
    sub->add_option("FILE", arguments().file, "campaign file (YAML)")->required();
  }
  void AddSeed(CLI::App* sub) {
    sub->add_option("--seed", arguments().seed, "replaces the seed of the campaign file")
        ->check(WholeNumber);
  }
  Arguments& arguments() { return command_.arguments; }

 private:
  CLI::App& app_;
  Command& command_;
};

// $CALIB_SERVER is a default, not a wish: it does not stand in the way of --state.
void AddCommonOptions(CLI::App& app, Arguments& a) {
  if (const char* server = std::getenv("CALIB_SERVER"); server != nullptr)
    a.server.address = server;
  auto* server = app.add_option_function<std::string>(
      "--server",
      [&a](const std::string& address) {
        a.server.address = address;
        a.server.given = true;
      },
      "HOST:PORT of calibd [$CALIB_SERVER or 127.0.0.1:7443]");
  server->check([](const std::string& address) { return rpc::ProblemOfAddress(address); });
  app.add_option("--state", a.server.state,
                 "work on this state folder with an embedded server instead of --server")
      ->excludes(server);
  app.add_option("--workers", a.server.workers,
                 "local workers beside the embedded server (run: all cores unless given)")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--json", a.json, "one JSON document on standard output");
}

void AddVerbsOnFiles(Builder& b) {
  auto* simulate = b.Add(
      "simulate", &Simulate, "One model evaluation of each experiment at given parameters",
      "simulate sand.yaml --set young_modulus='2 GPa' --set friction_angle='30 deg' -o states.csv");
  b.AddFile(simulate);
  simulate
      ->add_option("--set", b.arguments().set,
                   "NAME=VALUE with an optional unit; once per calibrated parameter")
      ->allow_extra_args(false);
  simulate->add_option("-o,--output", b.arguments().output,
                       "CSV file, a row per load step [standard output]");
  simulate->add_option("--vtk", b.arguments().vtk,
                       "folder for grains, contacts and walls after each load step, one below it "
                       "per experiment: open grains.pvd in ParaView");
  simulate->add_option("--checkpoint", b.arguments().checkpoint,
                       "folder for a checkpoint per experiment, renewed after each load step: the "
                       "same command again goes on from there, to the same bits");

  auto* run = b.Add("run", &Run,
                    "The whole campaign on this machine: server, workers and answer in one command",
                    "run sand.yaml --workers 2 --state calib-state");
  b.AddFile(run);
  b.AddSeed(run);

  auto* submit = b.Add("submit", &Submit, "Validate and submit; prints the campaign id",
                       "submit sand.yaml --server node1:7443");
  b.AddFile(submit);
  b.AddSeed(submit);

  b.AddFile(b.Add("validate", &Validate, "Everything that submit checks, without a server",
                  "validate sand.yaml"));
}

void AddVerbsOnCampaigns(Builder& b) {
  b.Add("list", &List, "All campaigns", "list");
  b.AddOnCampaign("show", &Show, "State of a campaign");
  b.AddOnCampaign("watch", &Watch, "Live view until the campaign ends");
  b.AddOnCampaign("posterior", &Posterior, "Identified parameters with their uncertainty")
      ->add_option("--iteration", b.arguments().iteration,
                   "as known after this iteration, from 0 [the last complete one]")
      ->check(WholeNumber);
  b.AddOnCampaign("samples", &Samples, "The ensemble with weights and status");
  b.AddOnCampaign("states", &States, "The state history of one sample", " 0")
      ->add_option("SAMPLE", b.arguments().sample, "index, as shown by `calibctl samples`")
      ->required()
      ->check(WholeNumber);
  Builder::ExplainError(b.AddOnCampaign(
      "compare", &Compare, "Model against measurements: where it fits and where it fails"));
  b.AddOnCampaign("sensitivity", &Sensitivity,
                  "Which parameters move what: Sobol indices, correlations with bulk properties");
  b.Add("models", &Models, "Which model do the data favour: evidence, Bayes factors, probabilities",
        "models c1 c2 --state calib-state")
      ->add_option("ID", b.arguments().campaigns, "campaigns on the same data, two or more")
      ->required();
  auto* diagnose = b.AddOnCampaign(
      "diagnose", static_cast<int (*)(const Arguments&)>(&Diagnose),
      "Which physical effect is missing; runs what it needs, and goes on when killed");
  Builder::ExplainError(diagnose);
  diagnose->add_option("--without", b.arguments().effects, "effect that is not to be thought of")
      ->allow_extra_args(false);
  b.AddOnCampaign("extend", &Extend,
                  "A new campaign: this one joined by effects, started from its posterior",
                  " --effect rolling_resistance")
      ->add_option("--effect", b.arguments().effects, "name, as shown by `calibctl effects`")
      ->required()
      ->allow_extra_args(false);
  auto* improve =
      b.AddOnCampaign("improve", &Improve,
                      "Compare, diagnose, extend until the misfit is explained or nothing helps");
  Builder::ExplainError(improve);
  improve->add_option("--max-effects", b.arguments().max_effects, "at most so many are added [3]")
      ->check(CLI::Range(1, 10));
  improve
      ->add_option(
          "--max-evaluations", b.arguments().max_evaluations,
          "model evaluations of all screens, refits and calibrations, those that diagnose "
          "has made already included; held-out tests of a calibration count and may exceed it")
      ->check(CLI::Range(1, 1'000'000'000));
  improve->add_option("--without", b.arguments().effects, "effect that is not to be thought of")
      ->allow_extra_args(false);
  auto* predict = b.AddOnCampaign(
      "predict", &Predict, "The posterior propagated to another test: mean, band, exceedance",
      " --test other.yaml");
  predict
      ->add_option("--test", b.arguments().test,
                   "YAML: one experiment, or a file with experiments, as in a campaign file")
      ->required();
  predict
      ->add_option("--exceed", b.arguments().exceed,
                   "OBSERVABLE=LEVEL with an optional unit: probability to exceed it")
      ->allow_extra_args(false);
  predict->add_option("--draws", b.arguments().draws, "runs from the posterior [20]")
      ->check(CLI::Range(2, 400));
  b.AddOnCampaign("report", &Report, "One self-contained HTML file with plots", " -o c1.html")
      ->add_option("-o,--output", b.arguments().output, "HTML file")
      ->required();
  b.AddOnCampaign("export", &Export, "CSV and JSON of everything", " -o c1")
      ->add_option("-o,--output", b.arguments().output, "folder, created if need be")
      ->required();
  b.AddOnCampaign("pause", &Pause, "Stop handing out work; nothing is lost");
  b.AddOnCampaign("resume", &Resume, "Go on with a paused campaign");
  b.AddOnCampaign("cancel", &Cancel, "End a campaign for good, keeping what it has");
  auto* remove = b.AddOnCampaign("delete", &Delete, "Remove an ended campaign and all its data");
  auto* children =
      remove->add_flag("--with-children", b.arguments().with_children,
                       "everything that diagnose, extend and improve made from it too");
  remove
      ->add_flag("--force", b.arguments().force,
                 "although campaigns come from it, which stay without their parent")
      ->excludes(children);
}

void AddOtherVerbs(Builder& b) {
  b.Add("workers", &Workers, "Nodes, slots, speed, running samples", "workers");
  b.Add("doctor", &Doctor,
        "Checks this node, and a server: build, clock, file systems, time step, certificates",
        "doctor --server node1:7443");
  b.Add("drain", &Drain, "Let a worker finish what it does and leave", "drain node1-4711")
      ->add_option("WORKER", b.arguments().worker, "name, as shown by `calibctl workers`")
      ->required();
  b.Add("effects", &Effects, "Physical effects this build offers", "effects")
      ->add_option("--campaign", b.arguments().file,
                   "file of a campaign, whose user_effects are listed too");
  b.Add("tests", &Tests, "Lab tests this build offers", "tests");
  b.Add("contacts", &Contacts, "Contact laws this build offers", "contacts");
  auto* pack = b.Add("pack", &Pack,
                     "A packing of spheres as one of rigid clumps: same volumes, porosity and cell",
                     "pack spheres.txt --clumps dumbbell:1.4 -o clumps.txt");
  pack->add_option("FILE", b.arguments().file, "packing of single spheres")->required();
  pack->add_option(
          "--clumps", b.arguments().clumps,
          "dumbbell:LENGTH/WIDTH, above 1 and at most 2, or a file with a sphere `x y z r` "
          "per line, in any unit")
      ->required();
  pack->add_option("-o,--output", b.arguments().output, "packing file")->required();
  pack->add_option("--seed", b.arguments().seed, "of the orientations [1]")->check(WholeNumber);
}

}  // namespace

Parsed ParseCommandLine(int argc, const char* const* argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (campaign::FirstByteThatIsNoUtf8(word) == std::string::npos) continue;
    std::cerr << "calibctl: '" << absl::CHexEscape(word)
              << "' is not UTF-8, as names of files and ids have to be\n";
    return {std::nullopt, kBadInput};
  }
  Command command;
  CLI::App app{kDescription, "calibctl"};
  app.require_subcommand(1);
  app.fallthrough();  // common options may stand behind the verb too
  app.get_formatter()->column_width(28);
  AddCommonOptions(app, command.arguments);
  Builder builder(app, command);
  AddVerbsOnFiles(builder);
  AddVerbsOnCampaigns(builder);
  AddOtherVerbs(builder);
  std::vector<std::string> verbs;
  for (const CLI::App* verb : app.get_subcommands({})) verbs.push_back(verb->get_name());
  if (const auto word = UnknownVerb(verbs, argc, argv)) {
    std::cerr << "calibctl: " << campaign::Quoted(*word) << " is not a command; "
              << campaign::Suggestion(*word, verbs) << "\n";
    return {std::nullopt, kBadInput};
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return {std::nullopt, app.exit(error) == 0 ? kDone : kBadInput};
  }
  return {std::move(command), kDone};
}

}  // namespace calib::ctl
