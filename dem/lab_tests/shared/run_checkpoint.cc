#include "dem/lab_tests/shared/run_checkpoint.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/dynamics/archive.h"
#include "dem/model/engine_version.h"
#include "dem/model/test_entry.h"

namespace calib::dem {
namespace {

constexpr const char* kMagic = "calib checkpoint of a run, form 1";

/// FNV-1a over words of eight bytes, the last one filled with zeros.
/// [Fowler, Noll & Vo, IETF draft-eastlake-fnv]
std::uint64_t Checksum(const char* bytes, std::size_t size) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (std::size_t at = 0; at < size; at += sizeof hash) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + at, std::min(sizeof word, size - at));
    hash = (hash ^ word) * 1099511628211ULL;
  }
  return hash;
}

/// A part of what determines a run, under the name it has in messages.
struct Part {
  std::string name, bytes;

  template <class Archive>
  void Visit(Archive& archive) {
    archive(name, bytes);
  }
};

struct Head {
  std::string magic = kMagic, engine = EngineVersion();
  std::vector<Part> parts{};

  template <class Archive>
  void Visit(Archive& archive) {
    archive(magic, engine, parts);
  }
};

void Put(SaveArchive& archive, const std::map<std::string, double>& values) {
  for (auto [name, value] : values) {
    std::string key = name;
    archive(key, value);
  }
}

void Put(SaveArchive& archive, const std::optional<double>& value) {
  bool given = value.has_value();
  double number = value.value_or(0);
  archive(given, number);
}

std::string EffectsOf(Model model) {
  SaveArchive archive;
  archive(model.effects);
  for (UserEffect& effect : model.user_effects) {
    archive(effect.info.name, effect.action, effect.target, effect.formula);
    for (ParameterInfo& parameter : effect.info.parameters) {
      archive(parameter.name, parameter.min, parameter.max);
      Put(archive, parameter.default_value);
    }
  }
  return std::move(archive.bytes());
}

template <class... T>
std::string Bytes(T... members) {
  SaveArchive archive;
  archive(members...);
  return std::move(archive.bytes());
}

std::string MapBytes(const std::map<std::string, double>& values) {
  SaveArchive archive;
  Put(archive, values);
  return std::move(archive.bytes());
}

std::string OptionalBytes(const std::vector<std::optional<double>>& values) {
  SaveArchive archive;
  for (const auto& value : values) {
    Put(archive, value);
  }
  return std::move(archive.bytes());
}

std::string StagingBytes(const Staging& staging) {
  std::string bytes = OptionalBytes({staging.rate, staging.step, staging.damping_loading,
                                     staging.damping_settling, staging.unbalanced});
  return staging.adaptive ? bytes + "adaptive" : bytes;
}

/// Member by member: what lies between them is anything.
std::string PathBytes(const std::vector<ControlPoint>& path) {
  SaveArchive archive;
  for (ControlPoint point : path) {
    archive(point.target, point.load_step);
  }
  return std::move(archive.bytes());
}

std::string MeshBytes(const std::map<std::string, TriangleMesh>& meshes) {
  SaveArchive archive;
  for (auto [name, mesh] : meshes) {
    std::string key = name;
    archive(key, mesh.vertex, mesh.triangle);
  }
  return std::move(archive.bytes());
}

std::string MaterialBytes(const Scenario& s) {
  SaveArchive archive;
  std::vector<std::string> names = s.model.materials;
  std::vector<std::string> grains = s.packing.material;
  archive(names, grains);
  for (auto [body, name] : s.materials.bodies) {
    std::string key = body;
    archive(key, name);
  }
  Put(archive, s.materials.grains);
  std::uint64_t seed = s.materials.seed;
  archive(seed);
  return std::move(archive.bytes());
}

std::vector<Part> PartsOf(const Scenario& s) {
  std::optional<double> axial;
  std::optional<double> lateral;
  if (s.initial_stress) {
    axial = s.initial_stress->axial;
    lateral = s.initial_stress->lateral;
  }
  const Packing& grains = s.packing;
  std::vector<Part> parts = {
      {"contact law", Bytes(s.model.contact)},
      {"effects", EffectsOf(s.model)},
      {"density", Bytes(s.model.density)},
      {"parameters", MapBytes(s.model.parameters)},
      {"test", Bytes(s.test)},
      {"settings", MapBytes(s.settings)},
      {"packing", Bytes(grains.length[0], grains.length[1], grains.length[2], grains.x, grains.y,
                        grains.z, grains.radius, grains.clump)},
      {"consolidation",
       OptionalBytes({s.consolidation.friction_coefficient, s.consolidation.porosity})},
      {"initial stress", OptionalBytes({axial, lateral})},
      {"loading rate", OptionalBytes({s.loading_rate})},
      {"staging", StagingBytes(s.staging)},
      {"control path", PathBytes(s.path)},
      {"seed", Bytes(s.seed)},
      {"meshes", MeshBytes(s.meshes)}};
  if (!s.model.materials.empty()) {
    parts.push_back({"materials", MaterialBytes(s)});
  }
  if (s.model.shear_unloading != ShearUnloading::kAsPublished) {
    parts.push_back({"shear at unloading", Bytes(s.model.shear_unloading)});
  }
  return parts;
}

std::vector<std::string> Differences(const std::vector<Part>& found,
                                     const std::vector<Part>& wanted) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    if (k >= found.size() || found[k].name != wanted[k].name || found[k].bytes != wanted[k].bytes) {
      names.push_back(wanted[k].name);
    }
  }
  for (std::size_t k = wanted.size(); k < found.size(); ++k) {
    names.push_back(found[k].name);
  }
  return names;
}

}  // namespace

std::string CheckpointHead(const Scenario& scenario) {
  SaveArchive archive;
  Head head{.parts = PartsOf(scenario)};
  archive(head);
  return std::move(archive.bytes());
}

std::string PackCheckpoint(const std::string& head, RunCheckpoint checkpoint) {
  SaveArchive archive;
  archive.bytes() = head;
  std::uint64_t next = checkpoint.next;
  std::uint64_t states = checkpoint.states.size();
  archive(next, checkpoint.procedure, states);
  for (State& state : checkpoint.states) {
    archive(state.load_step, state.values);
  }
  std::uint64_t checksum = Checksum(archive.bytes().data(), archive.bytes().size());
  archive(checksum);
  return std::move(archive.bytes());
}

absl::StatusOr<RunCheckpoint> UnpackCheckpoint(const Scenario& scenario, const std::string& bytes) {
  LoadArchive archive(bytes);
  Head head;
  archive(head.magic);
  if (!archive.ok() || head.magic != kMagic) {
    return absl::InvalidArgumentError("this is no checkpoint of a run");
  }
  std::uint64_t checksum = 0;
  const std::size_t before = bytes.size() - sizeof checksum;
  std::memcpy(&checksum, bytes.data() + before, sizeof checksum);
  if (checksum != Checksum(bytes.data(), before)) {
    return absl::InvalidArgumentError("the checkpoint is damaged or cut off");
  }
  archive(head.engine, head.parts);
  if (head.engine != EngineVersion()) {
    return absl::InvalidArgumentError(absl::StrCat("the checkpoint was written by engine ",
                                                   head.engine, ", this is engine ",
                                                   EngineVersion()));
  }
  if (const auto names = Differences(head.parts, PartsOf(scenario)); !names.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the checkpoint belongs to another run; what differs: ", absl::StrJoin(names, ", ")));
  }
  RunCheckpoint checkpoint;
  std::uint64_t next = 0;
  std::uint64_t states = 0;
  archive(next, checkpoint.procedure, states);
  for (std::uint64_t k = 0; k < states && archive.ok(); ++k) {
    State state;
    archive(state.load_step, state.values);
    checkpoint.states.push_back(std::move(state));
  }
  checkpoint.next = next;
  archive(checksum);
  if (!archive.complete() || next == 0 || next > scenario.path.size()) {
    return absl::InvalidArgumentError("the checkpoint is damaged or cut off");
  }
  return checkpoint;
}

}  // namespace calib::dem
