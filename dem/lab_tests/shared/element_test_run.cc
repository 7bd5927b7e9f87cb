#include "dem/lab_tests/shared/element_test_run.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/dynamics/archive.h"
#include "dem/dynamics/contact_model.h"
#include "dem/dynamics/crushing.h"
#include "dem/dynamics/quasi_static.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/alterations.h"
#include "dem/lab_tests/shared/consolidation.h"
#include "dem/lab_tests/shared/shape_change.h"
#include "dem/measure/observables.h"
#include "dem/measure/reading_formulas.h"
#include "dem/model/staging.h"
#include "dem/model/test_entry.h"
#include "dem/particles/material_shares.h"

namespace calib::dem {
namespace {

/// Share of the strain that is missing to a reading that one step may take [-]. Chosen: the reading
/// is approached from one side (dem/DECISIONS.md, the reading drives the test).
constexpr double kFollowGain = 0.3;
/// Strain within which a reading counts as met [-]. Chosen; what comes of it is in
/// dem/VERIFICATION.md, effects on readings and initial state.
constexpr double kReadingTolerance = 1e-6;

class ElementTestRun {
 public:
  ElementTestRun(const TestRun& run, PlanElementTest plan, const Packing& packing,
                 const Alterations& alterations)
      : scenario_(run.scenario),
        test_(run.test),
        plan_(plan),
        assembly_(packing, run.scenario.model.density,
                  ContactModel(run.scenario.model, run.entries), run.scenario.threads),
        staging_(ResolveStaging(run.scenario, assembly_.mean_diameter())),
        stages_(assembly_, OptionsFrom(staging_), run.stop),
        apparatus_(alterations.apparatus),
        preparation_(alterations.preparation),
        formulas_(run.scenario.model) {
    const Scenario& scenario = run.scenario;
    context_.settings = scenario.settings;
    for (const ParameterInfo& setting : test_.settings) {
      if (setting.default_value) {
        context_.settings.emplace(setting.name, *setting.default_value);
      }
    }
    context_.stress_driven = IsStressDriven(test_, scenario.settings);
    const double pressure = scenario.settings.at("confining_pressure");
    context_.lateral_stress = scenario.initial_stress ? scenario.initial_stress->lateral : pressure;
    context_.axial_stress = scenario.initial_stress ? scenario.initial_stress->axial : pressure;
    const CrushingLaw law{.weakness = preparation_.weakness,
                          .weibull_modulus = preparation_.weibull_modulus,
                          .reference_diameter = preparation_.reference_diameter,
                          .size_loss = preparation_.size_loss};
    if (law.Acts()) {
      crushing_.emplace(law, scenario.seed, assembly_);
    }
    SetStage();
    if (crushing_ || assembly_.model().stage() != nullptr) {
      stages_.SetIntervention([this](Assembly& assembly) {
        if (crushing_ && crushing_->Crush(assembly) > 0) {
          RETURN_IF_ERROR(crushing_->FinesFit(assembly));
        }
        SetStage();
        return absl::OkStatus();
      });
    }
  }

  absl::StatusOr<Summary> Run(RunRecord& record) {
    if (!record.resumed()) {
      if (const auto ended = Prepare()) {
        return *ended;
      }
    } else if (!Restore(record.procedure_state())) {
      return absl::InvalidArgumentError("the checkpoint does not fit the specimen");
    }
    FollowReadings();
    if (scenario_.loading_rate) {
      stages_.options().rate = *scenario_.loading_rate;
    }
    for (std::size_t k = record.next_point(); k < scenario_.path.size(); ++k) {
      const ControlPoint& point = scenario_.path[k];
      const std::string where = absl::StrCat(
          "path point ", k, " (", ControlOf(test_, scenario_.settings), " ", point.target, ")");
      if (const StageEnd end = MoveToPoint(point.target); end != StageEnd::kDone) {
        return Finish(end, where);
      }
      if (point.load_step >= 0) {
        State state;
        state.load_step = point.load_step;
        if (const std::string problem = ReadInto(state); !problem.empty()) {
          Summary summary = Finish(StageEnd::kDiverged, where);
          summary.reason = absl::StrCat(where, ": ", problem);
          return summary;
        }
        RETURN_IF_ERROR(record.ReportLoadStep(state, &assembly_));
      }
      if (record.wants_checkpoints()) {
        SaveArchive archive;
        archive(*this);
        RETURN_IF_ERROR(record.WriteCheckpoint(k + 1, std::move(archive.bytes())));
      }
    }
    return Finish(StageEnd::kDone, "");
  }

  /// What follows from neither scenario nor packing, for archives.
  template <class Archive>
  void Visit(Archive& archive) {
    archive(assembly_, stages_, rig_start_, reference_, control_);
    if (StageState* const stage = assembly_.model().stage(); stage != nullptr) {
      archive(*stage);
    }
  }

 private:
  bool Restore(const std::string& bytes) {
    LoadArchive archive(bytes);
    archive(*this);
    return archive.complete();
  }

  /// Consolidation, to where loading begins; the answer of a run that ended here.
  std::optional<absl::StatusOr<Summary>> Prepare() {
    StageEnd end = StageEnd::kDone;
    const ConsolidationPlan plan{.pressure = scenario_.settings.at("confining_pressure"),
                                 .consolidation = scenario_.consolidation,
                                 .initial_stress = scenario_.initial_stress,
                                 .preparation = preparation_};
    assembly_.SetViscous(false);
    if (auto s = Consolidate(plan, stages_, end); !s.ok()) {
      if (preparation_.densification == 0) {
        return s;
      }
      Summary summary = Finish(StageEnd::kDiverged, "");  // of a calibrated parameter: a result
      summary.reason = absl::StrCat("consolidation, initial_density: ", s.message());
      return summary;
    }
    assembly_.SetViscous(true);
    stages_.InspectBeforeNextStep();
    if (end != StageEnd::kDone) {
      return Finish(end, "consolidation");
    }
    std::copy_n(assembly_.cell().length, 3, reference_);
    rig_start_ = RigStress();
    return std::nullopt;
  }

  /// The present readings; what is wrong with them.
  std::string ReadInto(State& state) const {
    if (crushing_) {
      if (auto s = crushing_->FinesFit(assembly_); !s.ok()) {
        return std::string(s.message());
      }
    }
    Measurement read = Read();
    if (!(read.porosity > 0)) {
      return absl::StrCat("porosity is ", read.porosity,
                          ", no pores are left: the grains overlap too much for spheres, or the "
                          "apparatus reads more strain than there is");
    }
    if (auto s = formulas_.Apply(read); !s.ok()) {
      return std::string(s.message());
    }
    state.values = Select(read, assembly_, test_.observables);
    for (std::size_t v = 0; v < state.values.size(); ++v) {
      if (!std::isfinite(state.values[v])) {
        return test_.observables[v] + " is not finite";
      }
    }
    return "";
  }

  static StageOptions OptionsFrom(const Staging& staging) {
    StageOptions options;
    options.rate = *staging.rate;
    options.damping_loading = *staging.damping_loading;
    options.damping_settling = *staging.damping_settling;
    options.unbalanced = *staging.unbalanced;
    options.adaptive = staging.adaptive;
    return options;
  }

  /// Goal of the lab test in terms of cell lengths and stresses.
  [[nodiscard]] CellTarget TargetFor(double control) const {
    const CellGoal goal = plan_(context_, control);
    CellTarget target;
    for (std::size_t a = 0; a < 3; ++a) {
      const bool strain = goal[a].mode == AxisGoal::Mode::kStrain;
      target[a] = {.mode = strain ? AxisTarget::Mode::kLength : AxisTarget::Mode::kStress,
                   .value = strain ? reference_[a] * Exp(-goal[a].value) : goal[a].value};
    }
    target.displacement = goal.shear_strain * reference_[2];
    return target;
  }

  /// Stresses that load the rig, by the kind of the test [Pa].
  [[nodiscard]] double RigStress() const {
    const auto& stress = assembly_.stress();
    if (test_.rig_load == RigLoad::kAxial) {
      return stress[2];
    }
    return stress[2] - 0.5 * (stress[0] + stress[1]) + apparatus_.MembraneStress(LateralStrain());
  }

  [[nodiscard]] double LateralStrain() const {
    const PeriodicCell& cell = assembly_.cell();
    return 0.5 * (Log(reference_[0] / cell.length[0]) + Log(reference_[1] / cell.length[1]));
  }

  /// The present state as the laboratory reads it.
  [[nodiscard]] Measurement Read() const {
    Measurement m = ReadThrough(apparatus_, RigStress() - rig_start_,
                                test_.rig_load == RigLoad::kAxial, Measure(assembly_, reference_));
    m.pore_pressure = context_.lateral_stress - m.lateral_stress;
    return m;
  }

  /// What user's formulas know of the specimen: until loading begins, where it is going to start.
  void SetStage() const {
    StageState* const stage = assembly_.model().stage();
    if (stage == nullptr) {
      return;
    }
    if (reference_[2] == 0) {
      *stage = {.mean_stress = (context_.axial_stress + 2.0 * context_.lateral_stress) / 3.0,
                .deviatoric_stress = context_.axial_stress - context_.lateral_stress,
                .porosity = Porosity(assembly_)};
      return;
    }
    const Measurement m = Measure(assembly_, reference_);
    *stage = {.mean_stress = m.mean_stress,
              .deviatoric_stress = m.deviatoric_stress,
              .axial_strain = m.axial_strain,
              .volumetric_strain = m.volumetric_strain,
              .porosity = m.porosity};
  }

  /// Lets the stages be driven by readings where the apparatus alters them.
  void FollowReadings() {
    const bool strain = apparatus_.AltersStrain() && !context_.stress_driven;
    if (strain || apparatus_.membrane != 0) {
      stages_.SetFollow([this](const std::array<double, 3>& modulus, CellTarget& target) {
        return FollowReading(modulus, target);
      });
    }
  }

  /// Axial strain that brings the reading to the control, and lateral stress with the membrane's
  /// part. With the affine stiffness, an upper bound of the real one, the reading is approached
  /// from one side.
  FollowGap FollowReading(const std::array<double, 3>& modulus, CellTarget& target) const {
    const double strain = Log(reference_[2] / assembly_.cell().length[2]);
    FollowGap gap{.tolerances = 0, .strain = std::abs(control_ - strain)};
    if (apparatus_.AltersStrain() && !context_.stress_driven) {
      const double x = RigStress() - rig_start_;
      const double error = control_ - strain - apparatus_.RigStrain(x);
      const double change = error / (1.0 + modulus[2] * apparatus_.RigSlope(x));
      target = TargetFor(strain + kFollowGain * change);
      gap = {.tolerances = std::abs(error) / kReadingTolerance,
             .strain = std::abs(kFollowGain * change)};
    }
    for (std::size_t a = 0; a < 2; ++a) {
      if (target[a].mode == AxisTarget::Mode::kStress) {
        target[a].value += apparatus_.MembraneStress(LateralStrain());
      }
    }
    return gap;
  }

  /// Stress of the specimen at which the load cell reads this one [Pa].
  [[nodiscard]] double StressReadAs(double reading) const {
    return (reading + apparatus_.load_gain * rig_start_ - apparatus_.load_offset) /
           (1.0 + apparatus_.load_gain);
  }

  /// From the present control value to the next: at once when loading at a real rate or by stress,
  /// in settled steps of at most staging.step otherwise.
  StageEnd MoveToPoint(double target) {
    if (context_.stress_driven) {
      control_ = target;
      return stages_.MoveTo(TargetFor(StressReadAs(target)));
    }
    if (scenario_.loading_rate) {
      control_ = target;
      return stages_.MoveThrough(TargetFor(target));
    }
    const double from = control_;
    const double exact = std::abs(target - from) / *staging_.step;
    const int steps = std::max(1, static_cast<int>(std::ceil(exact - 1e-6)));
    for (int k = 1; k <= steps; ++k) {
      control_ = k == steps ? target : from + (target - from) * k / steps;
      if (const StageEnd end = stages_.MoveTo(TargetFor(control_)); end != StageEnd::kDone) {
        return end;
      }
    }
    return StageEnd::kDone;
  }

  [[nodiscard]] Summary Finish(StageEnd end, const std::string& where) const {
    Summary summary;
    summary.outcome = end == StageEnd::kDone      ? Outcome::kCompleted
                      : end == StageEnd::kStopped ? Outcome::kStopped
                                                  : Outcome::kDiverged;
    if (end == StageEnd::kDiverged) {
      summary.reason = absl::StrCat(where, ": ", stages_.reason());
    }
    summary.steps = assembly_.steps();
    summary.contact_updates = assembly_.contact_updates();
    summary.time_step = stages_.time_step();
    summary.staging = staging_;
    return summary;
  }

  const Scenario& scenario_;
  const TestInfo& test_;
  PlanElementTest plan_;
  Assembly assembly_;
  Staging staging_;
  QuasiStatic stages_;
  ElementTestContext context_;
  Apparatus apparatus_;
  Preparation preparation_;
  ReadingFormulas formulas_;
  std::optional<Crushing> crushing_;
  double rig_start_ = 0;  ///< RigStress() at the start of loading [Pa]
  double reference_[3] = {0, 0, 0};
  double control_ = 0;
};

}  // namespace

absl::StatusOr<Summary> RunElementTest(const TestRun& run, PlanElementTest plan) {
  const Scenario& scenario = run.scenario;
  if (!scenario.materials.grains.empty()) {
    Scenario mixture = scenario;
    DrawMaterials(scenario.materials.grains, scenario.materials.seed, mixture.packing);
    mixture.materials.grains.clear();
    return RunElementTest({mixture, run.entries, run.test, run.record, run.stop}, plan);
  }
  const Alterations alterations = AlterationsOf(scenario.model, run.entries, run.test);
  if (alterations.preparation.aspect == 1) {
    return ElementTestRun(run, plan, scenario.packing, alterations).Run(run.record);
  }
  const auto packing =
      Elongate(scenario.packing, alterations.preparation.aspect, scenario.threads, run.stop);
  if (!packing.ok()) {  // of a calibrated parameter: a result
    Summary summary;
    summary.outcome = absl::IsCancelled(packing.status()) ? Outcome::kStopped : Outcome::kDiverged;
    summary.reason = std::string(packing.status().message());
    return summary;
  }
  return ElementTestRun(run, plan, *packing, alterations).Run(run.record);
}

}  // namespace calib::dem
