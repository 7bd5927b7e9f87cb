#include "server/ctl/trial_runs.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <thread>
#include <utility>

#include "absl/strings/str_split.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/campaign.h"
#include "server/campaign/model/sha256.h"
#include "server/client/temporary_folder.h"
#include "server/ctl/evaluation.h"
#include "server/messages/attempt_spec.h"

namespace calib::ctl {
namespace {

constexpr std::chrono::milliseconds kPoll{20};
constexpr std::chrono::seconds kAtMost{60};
constexpr double kTrialStress = 2e5;

v1::AttemptSpec CollisionSpec() {
  const TrialCollision c;
  dem::Scenario s;
  s.model.contact = "hertz_mindlin";
  s.model.density = c.density;
  s.model.parameters = {{"young_modulus", c.young_modulus},
                        {"poisson_ratio", c.poisson_ratio},
                        {"friction_coefficient", 0}};
  s.test = "collision";
  s.settings = {{"radius", c.radius}, {"partner_radius", c.radius}, {"impact_angle", 0}};
  s.path = {{.target = c.speed, .load_step = 0}};
  return messages::ToSpec(s, campaign::NoPacking{}, "collision");
}

v1::AttemptSpec CompressionSpec() {
  dem::Scenario s;
  s.model.contact = "hertz_mindlin";
  s.model.density = 2650;
  s.model.parameters = {
      {"young_modulus", 1e9}, {"poisson_ratio", 0.2}, {"friction_coefficient", 0.5}};
  s.test = "isotropic";
  s.settings = {{"confining_pressure", 0.5 * kTrialStress}};
  s.path = {{.target = kTrialStress, .load_step = 0}};
  const dem::PackingRecipe recipe{.particles = 64,
                                  .porosity = 0.4,
                                  .mean_radius = 1e-3,
                                  .radius_spread = 0.2,
                                  .pressure = 0.5 * kTrialStress,
                                  .seed = 1};
  return messages::ToSpec(s, recipe, "compression");
}

/// The table of one run.
absl::StatusOr<std::string> Run(const std::string& program, v1::AttemptSpec spec,
                                const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  Evaluation::Task task;
  task.spec = std::move(spec);
  ASSIGN_OR_RETURN(auto run, Evaluation::Start(program, task, folder.string()));
  const auto until = std::chrono::steady_clock::now() + kAtMost;
  while (!run.Poll()) {
    if (std::chrono::steady_clock::now() > until) {
      return absl::DeadlineExceededError("it has not ended within a minute");
    }
    std::this_thread::sleep_for(kPoll);
  }
  RETURN_IF_ERROR(run.Result());
  return run.Table();
}

/// The value of the last row; NaN without such a column.
double Last(const std::string& table, const std::string& column) {
  std::istringstream lines(table);
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> names = absl::StrSplit(line, ',');
  std::vector<std::string> cells;
  while (std::getline(lines, line)) cells = absl::StrSplit(line, ',');
  for (std::size_t c = 0; c < names.size() && c < cells.size(); ++c) {
    if (names[c] == column) return std::strtod(cells[c].c_str(), nullptr);
  }
  return std::nan("");
}

}  // namespace

double TrialCollision::PeakOverlap() const {
  const double mass = density * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3) / 2.0;
  const double modulus = young_modulus / (2.0 * (1.0 - poisson_ratio * poisson_ratio));
  const double stiffness = 4.0 / 3.0 * modulus * std::sqrt(0.5 * radius);
  return std::pow(1.25 * mass * speed * speed / stiffness, 0.4);
}

double TrialCollision::Duration() const {
  return 0.8 * std::beta(0.4, 0.5) * PeakOverlap() / speed;
}

double TrialStress() { return kTrialStress; }

TrialRuns MakeTrialRuns(const std::string& program) {
  TrialRuns runs;
  const auto folder = client::TemporaryFolder::Make();
  if (!folder.ok()) {
    runs.failure = std::string(folder.status().message());
    return runs;
  }
  const std::filesystem::path path = folder->path();
  const auto collision = Run(program, CollisionSpec(), path / "collision");
  const auto compression =
      collision.ok() ? Run(program, CompressionSpec(), path / "compression") : collision;
  if (!compression.ok()) {
    runs.failure = std::string(compression.status().message());
    return runs;
  }
  runs.restitution = Last(*collision, "normal_restitution");
  runs.peak_overlap = Last(*collision, "peak_overlap");
  runs.duration = Last(*collision, "contact_duration");
  runs.mean_stress = Last(*compression, "mean_stress");
  runs.digest = campaign::Sha256Hex(*collision + *compression);
  return runs;
}

}  // namespace calib::ctl
