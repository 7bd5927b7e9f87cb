#include "server/campaign/file/program/read_program.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/file/shared/read_bytes.h"
#include "server/campaign/file/shared/read_user_effects.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/race.h"
#include "server/campaign/model/sha256.h"

namespace calib::campaign {
namespace {

/// Files that one program brings at most: as many as a submission may name, with room for its data
/// and packings.
constexpr std::size_t kMostFiles = 3000;
/// Files of a run that stay with it at most, as v1::ProgramRun has them.
constexpr std::size_t kMostKept = 64;
/// What {NAME} stands for in every command and template.
constexpr std::array kReserved = {"scratch", "threads", "seed"};

// A file's name in the scratch folder: as it is named, or what it is called where that leads out of
// the campaign's folder.
std::string NameInScratch(const std::string& path) {
  const std::filesystem::path normal = std::filesystem::path(path).lexically_normal();
  const bool leads_out = normal.is_absolute() || path.find('$') != std::string::npos ||
                         (!normal.empty() && *normal.begin() == "..");
  std::string name = (leads_out ? normal.filename() : normal).string();
  while (name.ends_with('/')) name.pop_back();
  return name;
}

// Reads what a key names, file by file.
class FilesReader {
 public:
  FilesReader(MapReader& map, ReadContext& context, Program& program)
      : map_(map), context_(context), program_(program) {}

  void Read(const std::string& key, bool is_template) {
    const auto paths = map_.TextList(key);
    if (!paths) return;
    for (const std::string& path : *paths) ReadOne(key, path, is_template);
  }

 private:
  void ReadOne(const std::string& key, const std::string& path, bool is_template) {
    std::string plain = path;
    while (plain.size() > 1 && plain.ends_with('/')) plain.pop_back();
    const std::string* listing = context_.ReadNamedFile(map_, key, plain + "/");
    if (listing == nullptr) return;
    const std::string name = NameInScratch(plain);
    if (name.empty() || name == ".") {
      map_.Problem(key, absl::StrCat(Quoted(path),
                                     " names no file or folder of its own; name what "
                                     "the program needs one by one"));
      return;
    }
    std::istringstream lines(*listing);
    for (std::string line; std::getline(lines, line);) {
      if (line.size() < 2) continue;
      const std::string below = line.substr(2);
      if (program_.files.size() == kMostFiles) {
        map_.Problem(key, absl::StrCat("brings more than ", kMostFiles,
                                       " files; pack them into an archive that the program opens"));
        return;
      }
      Add(key, below.empty() ? plain : absl::StrCat(plain, "/", below),
          below.empty() ? name : absl::StrCat(name, "/", below), line[0] == 'x', is_template);
    }
  }

  void Add(const std::string& key, const std::string& path, const std::string& name,
           bool executable, bool is_template) {
    if (!names_.insert(name).second) {
      map_.Problem(key, absl::StrCat(Quoted(name), " would stand in the scratch folder twice"));
      return;
    }
    if (const std::string* content = context_.ReadNamedFile(map_, key, path)) {
      program_.files.push_back({.path = path,
                                .name = name,
                                .digest = Sha256Hex(*content),
                                .executable = executable,
                                .is_template = is_template});
    }
  }

  MapReader& map_;
  ReadContext& context_;
  Program& program_;
  std::set<std::string> names_;
};

const ProgramFile* FindFile(const Program& program, const std::string& name) {
  for (const ProgramFile& file : program.files) {
    if (file.name == name) return &file;
  }
  return nullptr;
}

// The program itself is found on a worker's PATH, or is brought along.
void CheckCommand(const MapReader& map, ReadContext& context, const Program& program) {
  if (program.command.empty() || program.command.front().empty()) {
    map.Problem("command", "is empty; it names a program and its arguments: [python3, spring.py]");
    return;
  }
  const std::string& first = program.command.front();
  if (program.command.size() == 1 && first.find(' ') != std::string::npos) {
    map.Problem("command", absl::StrCat("is one text with blanks, and would be the name of one "
                                        "program; write a list: [",
                                        first.substr(0, first.find(' ')), ", ...]"));
    return;
  }
  const bool has_folder = first.find('/') != std::string::npos;
  const std::string name = NameInScratch(first);
  const ProgramFile* const brought = FindFile(program, name);
  if (!has_folder && brought != nullptr) {
    map.Problem("command", absl::StrCat(first,
                                        " is one of the files that are brought along, and a "
                                        "program is looked for on PATH; write ./",
                                        first));
  } else if (has_folder && !first.starts_with('/') && brought == nullptr) {
    map.Problem("command", absl::StrCat(Quoted(first),
                                        " is none of model.files, which are all "
                                        "that a run finds beside it"));
  } else if (has_folder && brought != nullptr && !brought->executable) {
    map.Problem("command", absl::StrCat(first, " may not be executed; chmod +x ", brought->path));
  }
  if (!context.is_new()) return;
  for (std::size_t k = 1; k < program.command.size(); ++k) {
    const std::string& argument = program.command[k];
    if (argument.empty() || argument.front() == '-' || argument.front() == '/' ||
        argument.find('{') != std::string::npos || FindFile(program, NameInScratch(argument)))
      continue;
    if (context.IsFile(argument)) {
      map.Problem("command", absl::StrCat(argument,
                                          " lies beside the campaign file and is not among "
                                          "model.files: a run would not find it; add it there"));
    }
  }
}

void ReadLimitsOf(MapReader& model, ProgramLimits& limits) {
  auto map = model.Map("limits");
  if (!map) return;
  limits.wall = map->Quantity("wall");
  limits.silence = map->Quantity("silence");
  limits.memory = ReadBytes(*map, "memory");
  limits.disk = ReadBytes(*map, "disk");
  map->Finish();
}

std::optional<ProgramTable> ReadStatesTable(MapReader& model) {
  auto map = model.Map("states");
  if (!map) return std::nullopt;
  ProgramTable table;
  table.file = map->RequiredText("file", "the table that the program writes").value_or("");
  for (const auto& [name, column] :
       map->TextMap("columns").value_or(std::vector<std::pair<std::string, std::string>>{})) {
    table.columns[name] = column;
  }
  if (auto units = map->Map("units")) {
    for (const std::string& name : units->Keys()) {
      const auto text = units->Text(name);
      if (!text) continue;
      const auto unit = ParseUnit(*text);
      if (!unit.ok()) {
        units->Problem(name, std::string(unit.status().message()));
      } else {
        table.factors[name] = unit->factor;
      }
    }
    units->Finish();
  }
  map->Finish();
  return table;
}

void ReadNumerics(MapReader& model, Program& program) {
  auto map = model.Map("numerics");
  if (!map) return;
  for (const std::string& name : map->Keys()) {
    auto one = map->Map(name);
    if (!one) continue;
    const auto null = one->Quantity("null");
    const auto sd = one->Quantity("sd");
    if (!one->Has("null")) one->Problem("null", "is missing; it is the value that runs have");
    if (!one->Has("sd")) one->Problem("sd", "is missing; it says how far the value may lie off");
    one->Finish();
    if (null && sd) program.numerics[name] = {.null = *null, .sd = *sd};
  }
  map->Finish();
}

// A name of the numerics stands for one thing in a request and a design.
void CheckNumerics(const MapReader& campaign_map, const Campaign& campaign,
                   const std::set<std::string>& parameters) {
  const auto& declared = campaign.model.user_effects;
  const std::string prefix = absl::StrCat(kNumerics, ".");
  for (const auto& [name, choice] : campaign.program->numerics) {
    if (std::find(kReserved.begin(), kReserved.end(), name) != kReserved.end()) {
      campaign_map.Problem("model",
                           absl::StrCat("numerics.", name, " is a reserved name; call it another"));
    }
    if (parameters.contains(name)) {
      campaign_map.Problem("model", absl::StrCat("numerics.", name,
                                                 " is a parameter as well: what is calibrated "
                                                 "matters; keep one of them"));
    }
    if (!RunsAreAdded(campaign) && parameters.contains(prefix + name)) {
      campaign_map.Problem(
          "parameters", absl::StrCat(prefix, name, " is what diagnose calls the change of ", name,
                                     "; call the parameter another"));
    }
  }
  if (!campaign.program->numerics.empty() && dem::FindEffect(declared, kNumerics) != nullptr) {
    campaign_map.Problem("model", absl::StrCat("effects.", kNumerics,
                                               " is what diagnose calls changes of the numerics; "
                                               "call the effect another"));
  }
}

// Names of files of the scratch folder.
std::vector<std::string> ReadKeep(MapReader& model) {
  std::vector<std::string> names = model.TextList("keep").value_or(std::vector<std::string>{});
  std::set<std::string> seen;
  for (const std::string& name : names) {
    const std::filesystem::path path(name);
    if (name.empty() || path.is_absolute() || path.lexically_normal() != path ||
        *path.begin() == ".." || path.filename().empty()) {
      model.Problem("keep", absl::StrCat(Quoted(name),
                                         " is no name of a file of the scratch "
                                         "folder: dump.vtk, out/dump.vtk"));
    } else if (!seen.insert(name).second) {
      model.Problem("keep", absl::StrCat(Quoted(name), " stands here twice; keep one"));
    }
  }
  if (names.size() > kMostKept) {
    model.Problem("keep", absl::StrCat("names ", names.size(), " files, and a run keeps ",
                                       kMostKept, "; let the program pack them"));
  }
  return names;
}

}  // namespace

bool NamesProgram(const MapReader& model) { return model.Has("command"); }

void ReadProgram(MapReader& model, ReadContext& context, Campaign& campaign) {
  Program& program = campaign.program.emplace();
  for (const char* key : {"contact", "density", "fixed", "shear_unloading", "user_effects",
                          "materials", "pairs", "precomputed"}) {
    model.Ignore({key});
    if (model.Has(key)) {
      model.Problem(key, "is of this program's own DEM, and the model is a command; remove it");
    }
  }
  program.command = model.TextList("command").value_or(std::vector<std::string>{});
  FilesReader files(model, context, program);
  files.Read("files", false);
  files.Read("templates", true);
  program.keep = ReadKeep(model);
  program.checkpoint = model.TrueOrFalse("checkpoint").value_or(false);
  program.persistent = model.TrueOrFalse("persistent").value_or(false);
  program.states = ReadStatesTable(model);
  program.version = model.Text("version").value_or("");
  ReadLimitsOf(model, program.limits);
  ReadHeldEffects(model, context.is_new(), "the program of the campaign", campaign.model);
  ReadNumerics(model, program);
  model.Ignore({"next"});  // read behind the experiments
  if (model.Has("command")) CheckCommand(model, context, program);
  if (program.persistent && program.states) {
    model.Problem("states",
                  "cannot be told apart by run where a process stays (persistent); let it print "
                  "its states, or leave persistent out");
  }
  model.Finish();
}

void CheckProgram(const MapReader& campaign_map, const Campaign& campaign) {
  std::set<std::string> parameters;
  for (const CalibratedParameter& parameter : campaign.parameters) {
    parameters.insert(parameter.name);
    for (const char* reserved : kReserved) {
      if (parameter.name != reserved) continue;
      campaign_map.Problem("parameters",
                           absl::StrCat(reserved, " is a reserved name: {", reserved,
                                        "} stands for what the worker says; call it another"));
    }
  }
  CheckNumerics(campaign_map, campaign, parameters);
  for (const auto& [name, choice] : campaign.program->numerics) parameters.insert(name);
  std::vector<Experiment> experiments = campaign.experiments;
  experiments.insert(experiments.end(), campaign.next.begin(), campaign.next.end());
  for (const Experiment& experiment : experiments) {
    std::set<std::string> told;
    for (const auto& [name, value] : experiment.told) told.insert(name);
    for (const Specimen& specimen : experiment.specimens) {
      if (const auto* one = std::get_if<ProgramSpecimen>(&specimen)) {
        for (const auto& [name, value] : one->settings) told.insert(name);
      }
    }
    for (const std::string& name : told) {
      if (parameters.contains(name)) {
        campaign_map.Problem("experiments",
                             absl::StrCat(experiment.name, ": ", name,
                                          " is the name of a setting and of a parameter; {", name,
                                          "} could be either; call one of them another"));
      }
      if (std::find(kReserved.begin(), kReserved.end(), name) != kReserved.end()) {
        campaign_map.Problem("experiments",
                             absl::StrCat(experiment.name, ": ", name,
                                          " is a reserved name; call the setting another"));
      }
    }
  }
  for (const std::string& missing : NotCalibratedOfActing(campaign)) {
    campaign_map.Problem("parameters", absl::StrCat(missing,
                                                    " is not calibrated; add it to "
                                                    "parameters"));
  }
}

}  // namespace calib::campaign
