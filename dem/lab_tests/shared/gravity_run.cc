#include "dem/lab_tests/shared/gravity_run.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/lab_tests/shared/alterations.h"
#include "dem/model/test_entry.h"
#include "dem/model/test_meshes.h"
#include "dem/particles/disk_pair.h"
#include "dem/particles/material_shares.h"

namespace calib::dem {

ClumpTemplate GrainShape(double aspect, bool disks) {
  if (!(aspect > 1)) {
    return {{{{0, 0, 0}, 1}}};
  }
  return disks ? DiskPairTemplate(aspect) : DumbbellTemplate(aspect);
}

GravityRun::GravityRun(const TestRun& run)
    : scenario_(run.scenario),
      record_(run.record),
      stop_(run.stop),
      test_(run.test),
      entries_(run.entries),
      aspect_(PreparationOf(run.scenario.model, run.entries).aspect),
      shape_(GrainShape(aspect_, run.scenario.settings.contains("thickness") &&
                                     run.scenario.settings.at("thickness") > 0)) {
  double sum = 0;
  for (const double r : radii()) {
    sum += 2 * r;
    largest_diameter_ = std::max(largest_diameter_, 2 * r);
  }
  mean_diameter_ = sum / static_cast<double>(radii().size());
  if (resumed()) {
    LoadArchive archive(record_.procedure_state());
    archive(summary_.steps, summary_.contact_updates, summary_.time_step, state_);
    if (!archive.complete()) {
      Abandon(DoesNotFit());
    }
  }
}

absl::Status GravityRun::DoesNotFit() {
  return absl::InvalidArgumentError("the checkpoint does not fit the procedure of the test");
}

StageEnd GravityRun::Abandon(absl::Status status) {
  status_ = std::move(status);
  return StageEnd::kDiverged;
}

StageEnd GravityRun::WriteCheckpoint(std::size_t next, std::string state) {
  SaveArchive archive;
  archive(summary_.steps, summary_.contact_updates, summary_.time_step, state);
  status_ = record_.WriteCheckpoint(next, std::move(archive.bytes()));
  return status_.ok() ? StageEnd::kDone : StageEnd::kDiverged;
}

StageEnd GravityRun::Walk(const std::function<StageEnd(const ControlPoint& point)>& visit,
                          const std::function<std::string()>& state) {
  StageEnd end = status_.ok() ? StageEnd::kDone : StageEnd::kDiverged;
  for (std::size_t k = record_.next_point(); k < path().size() && end == StageEnd::kDone; ++k) {
    end = visit(path()[k]);
    if (end == StageEnd::kDone && record_.wants_checkpoints()) {
      end = WriteCheckpoint(k + 1, state ? state() : "");
    }
  }
  return end;
}

double GravityRun::Setting(const std::string& name) const {
  if (const auto it = scenario_.settings.find(name); it != scenario_.settings.end()) {
    return it->second;
  }
  const auto& settings = test_.settings;
  const auto info = std::find_if(settings.begin(), settings.end(),
                                 [&](const ParameterInfo& s) { return s.name == name; });
  return *info->default_value;
}

double GravityRun::SettingOr(const std::string& name, double chosen) const {
  const double given = Setting(name);
  return given > 0 ? given : chosen;
}

const TriangleMesh* GravityRun::Mesh(const std::string& name) const {
  const auto it = scenario_.meshes.find(name);
  return it == scenario_.meshes.end() ? nullptr : &it->second;
}

double GravityRun::fall_time() const { return std::sqrt(mean_diameter_ / gravity()); }

double GravityRun::solid_volume() const {
  double sum = 0;
  for (const double r : radii()) {
    sum += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  return sum;
}

std::string GravityRun::MaterialOf(const std::string& body) const {
  const auto it = scenario_.materials.bodies.find(body);
  return it == scenario_.materials.bodies.end() ? "" : it->second;
}

Packing GravityRun::Fill(const FillRegion& region, std::uint64_t seed) const {
  return aspect_ > 1 ? RandomFill(radii(), shape_, region, seed) : LooseFill(radii(), region, seed);
}

void GravityRun::MixMaterials(Packing& grains) const {
  DrawMaterials(scenario_.materials.grains, scenario_.materials.seed, grains);
}

Assembly GravityRun::MakeAssembly(const Packing& grains, Surroundings surroundings) const {
  surroundings.gravity = {0, 0, -gravity()};
  surroundings.material = MaterialOf("walls");
  ContactModel model(scenario_.model, entries_, surroundings.thickness);
  Packing mixture = grains;
  if (mixture.material.empty()) {
    MixMaterials(mixture);
  }
  return {mixture, scenario_.model.density, std::move(model), std::move(surroundings),
          scenario_.threads};
}

Flow GravityRun::MakeFlow(Assembly& assembly, FlowOptions options) const {
  options.damping = Setting("local_damping");
  options.drag = Setting("drag");
  return {assembly, options, stop_};
}

StageEnd GravityRun::Fail(std::string reason) {
  reason_ = std::move(reason);
  return StageEnd::kDiverged;
}

StageEnd GravityRun::WalkFrom(Assembly& assembly, const FlowOptions& options, double longest,
                              const std::function<StageEnd(const ControlPoint& point)>& visit) {
  StageEnd end = StageEnd::kDone;
  if (resumed()) {
    end = RestoreState(assembly);
  } else {
    Flow filling = MakeFlow(assembly, options);
    end = AddToSummary(filling.Settle(longest, kSettling), filling, {}, "filling");
  }
  const auto filled = [&assembly] {
    SaveArchive archive;
    archive(assembly);
    return std::move(archive.bytes());
  };
  return end == StageEnd::kDone ? Walk(visit, filled) : end;
}

StageEnd GravityRun::Report(const ControlPoint& point, const std::vector<double>& values,
                            const Assembly& assembly) {
  if (point.load_step < 0) {
    return StageEnd::kDone;
  }
  for (std::size_t v = 0; v < values.size(); ++v) {
    if (!std::isfinite(values[v])) {
      return Fail(absl::StrCat("load step ", point.load_step, ": ", test_.observables[v],
                               " is not finite"));
    }
  }
  status_ = record_.ReportLoadStep({.load_step = point.load_step, .values = values}, &assembly);
  return status_.ok() ? StageEnd::kDone : StageEnd::kDiverged;
}

StageEnd GravityRun::AddToSummary(StageEnd end, const Flow& flow, const Mark& first,
                                  const std::string& where) {
  const Mark last = MarkOf(flow.assembly());
  summary_.steps += last.steps - first.steps;
  summary_.contact_updates += last.updates - first.updates;
  summary_.time_step = flow.time_step();
  if (end == StageEnd::kDiverged && reason_.empty()) {
    reason_ = absl::StrCat(where, ": ", flow.reason());
  }
  return end;
}

absl::StatusOr<Summary> GravityRun::Finish(StageEnd end) const {
  if (!status_.ok()) {
    return status_;
  }
  Summary summary = summary_;
  summary.outcome = end == StageEnd::kDone      ? Outcome::kCompleted
                    : end == StageEnd::kStopped ? Outcome::kStopped
                                                : Outcome::kDiverged;
  summary.reason = end == StageEnd::kDiverged ? reason_ : "";
  return summary;
}

std::function<absl::StatusOr<Summary>(const TestRun&)> GravityProcedure(
    StageEnd (*walk)(GravityRun&)) {
  return [walk](const TestRun& test) -> absl::StatusOr<Summary> {
    GravityRun run(test);
    if (auto problem = MeshSizeProblem(test.scenario, run.largest_diameter()); !problem.empty()) {
      return run.Finish(run.Fail(std::move(problem)));
    }
    return run.Finish(walk(run));
  };
}

}  // namespace calib::dem
