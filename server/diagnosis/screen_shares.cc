#include "server/diagnosis/screen_shares.h"

#include <algorithm>
#include <cstdint>
#include <set>

#include "server/diagnosis/race_list.h"

namespace calib::diagnosis {
namespace {

constexpr std::size_t kMostRuns = 4;   // model evaluations of one effect, or
constexpr double kScreenShare = 0.25;  // of the campaign's over all effects

}  // namespace

ScreenShares SharesOfScreen(const std::vector<const dem::EffectInfo*>& effects,
                            const std::vector<bool>& calculated, std::size_t samples,
                            int experiments, std::size_t numerical) {
  const auto run = std::count(calculated.begin(), calculated.end(), false);
  auto left =
      static_cast<std::int64_t>(std::max(kScreenShare * static_cast<double>(samples) * experiments,
                                         static_cast<double>(kMostRuns * effects.size())));
  ScreenShares shares{
      .numerical = std::min(numerical, static_cast<std::size_t>((left - run) / experiments)),
      .experiments = experiments,
      .runs = {}};
  left -= static_cast<std::int64_t>(shares.numerical) * experiments;
  if (run > 0) {
    shares.experiments = static_cast<int>(std::min<std::int64_t>(experiments, left / run));
  }
  left -= run * shares.experiments;
  for (const bool known : calculated) shares.runs.push_back(known ? 0 : 1);
  // Another ray is another signature; what instruments do is nearly in proportion to its strength.
  const auto grade = [](const dem::EffectInfo& effect) {
    if (effect.rays.size() > 1) return 0;
    return effect.kind == "measurement" ? 2 : 1;
  };
  for (int wanted = 0; wanted <= 2; ++wanted) {
    for (std::size_t e = 0; e < effects.size() && left >= shares.experiments; ++e) {
      if (shares.runs[e] == 0 || grade(*effects[e]) != wanted) continue;
      shares.runs[e] = 2;
      left -= shares.experiments;
    }
  }
  return shares;
}

campaign::Campaign ScreenedPart(const campaign::Campaign& campaign,
                                const std::vector<const dem::EffectInfo*>& effects,
                                int experiments) {
  campaign::Campaign part = campaign;
  for (campaign::Experiment& e : part.experiments) e.role = campaign::Role::kValidate;
  const auto shown = [&part, &effects] {
    return std::count_if(effects.begin(), effects.end(), [&part](const dem::EffectInfo* effect) {
      return WhyNotShown(part, *effect).empty();
    });
  };
  for (int taken = 0; taken < experiments; ++taken) {
    campaign::Experiment* next = nullptr;
    std::ptrdiff_t most = -1;
    for (std::size_t e = 0; e < part.experiments.size(); ++e) {
      campaign::Experiment& own = part.experiments[e];
      const bool fitted = campaign.experiments[e].role == campaign::Role::kCalibrate;
      if (!fitted || own.role == campaign::Role::kCalibrate) continue;
      own.role = campaign::Role::kCalibrate;
      if (const std::ptrdiff_t now = shown(); now > most) {
        most = now;
        next = &own;
      }
      own.role = campaign::Role::kValidate;
    }
    if (next != nullptr) next->role = campaign::Role::kCalibrate;
  }
  return part;
}

}  // namespace calib::diagnosis
