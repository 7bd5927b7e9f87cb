#include "server/diagnosis/next_experiment.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/derive.h"
#include "server/campaign/yaml_text.h"
#include "server/diagnosis/test_plans.h"
#include "server/report/people_units.h"

namespace calib::diagnosis {
namespace {

using campaign::YamlNode;
using Eigen::Index;

constexpr double kLevel = 0.01;

// Error stated for a reading of this size: that of the nearest one measured.
double ErrorAt(const campaign::MeasuredObservable& observable, double value) {
  std::size_t nearest = 0;
  for (std::size_t i = 1; i < observable.values.size(); ++i) {
    if (std::abs(observable.values[i] - value) < std::abs(observable.values[nearest] - value)) {
      nearest = i;
    }
  }
  return observable.sd[nearest];
}

// Curves of one run, [observable][reading]; empty: it did not finish.
std::vector<Eigen::VectorXd> CurvesOf(const report::CampaignView& view, const std::string& name,
                                      const campaign::Experiment& pattern, Index readings) {
  const auto found = view.states.find({name, 0});
  if (found == view.states.end() || static_cast<Index>(found->second.states.size()) < readings) {
    return {};
  }
  std::vector<Eigen::VectorXd> curves;
  for (const campaign::MeasuredObservable& o : pattern.observables) {
    const auto& names = found->second.observables;
    const auto at = std::find(names.begin(), names.end(), o.name);
    if (at == names.end()) return {};
    Eigen::VectorXd& curve = curves.emplace_back(
        Eigen::VectorXd::Constant(readings, std::numeric_limits<double>::quiet_NaN()));
    for (const v1::State& state : found->second.states) {
      if (state.load_step() < readings) {
        curve[state.load_step()] = state.values(static_cast<int>(at - names.begin()));
      }
    }
    if (!curve.allFinite()) return {};
  }
  return curves;
}

// Differences of two runs over the noise, curve by curve.
std::vector<Eigen::VectorXd> DeparturesOf(const std::vector<Eigen::VectorXd>& a,
                                          const std::vector<Eigen::VectorXd>& b,
                                          const campaign::Experiment& pattern) {
  std::vector<Eigen::VectorXd> departures;
  for (std::size_t j = 0; j < a.size(); ++j) {
    Eigen::VectorXd& u = departures.emplace_back(a[j] - b[j]);
    for (Index i = 0; i < u.size(); ++i) {
      u[i] /= ErrorAt(pattern.observables[j], 0.5 * (a[j][i] + b[j][i]));
    }
  }
  return departures;
}

constexpr const char* kSnippetHead =
    "  # Behind the last entry of `experiments:`. The measured curve goes into the file named in "
    "`data`,\n"
    "  # columns named as our observables, SI units unless `units:` says otherwise.\n";

// The rival run in these experiments.
absl::StatusOr<std::string> RivalsText(const Rival& rival, const std::string& parent, int like,
                                       const std::vector<YamlNode>& entries) {
  return campaign::Derive(rival.view->source.campaign_file(),
                          {.name = fmt::format("{}: next experiment", rival.view->campaign.name),
                           .lineage = {.parent = parent, .purpose = "next_experiment"},
                           .effects = rival.effects,
                           .fixed = rival.fixed,
                           .experiments = entries,
                           .rows = {{.like = like, .values = rival.values}}});
}

// Those that this build accepts: some settings go together with others.
absl::StatusOr<std::vector<std::pair<TestPlan, YamlNode>>> AcceptedPlans(
    client::Laboratory& laboratory, const Rival& rival, int like) {
  const report::CampaignView& view = *rival.view;
  const campaign::Experiment& pattern = PatternOf(view.campaign);
  std::vector<std::pair<TestPlan, YamlNode>> accepted;
  const auto parsed = campaign::ParseYaml(view.source.campaign_file());
  const YamlNode* list = parsed.root ? campaign::YamlFind(*parsed.root, "experiments") : nullptr;
  if (list == nullptr) return accepted;
  const auto original =
      std::find_if(list->items.begin(), list->items.end(), [&pattern](const YamlNode& item) {
        const YamlNode* name = campaign::YamlFind(item, "name");
        return name != nullptr && name->scalar == pattern.name;
      });
  if (original == list->items.end()) return accepted;
  for (TestPlan& plan : PlansFor(view.campaign)) {
    YamlNode entry = EntryFor(plan, pattern, *original);
    const auto text = RivalsText(rival, view.status.campaign(), like, {entry});
    if (!text.ok()) return text.status();
    const std::map<std::string, std::string> file = {{plan.file, DataOf(plan.experiment, pattern)}};
    if (laboratory.Accepts(view, *text, file)) {
      accepted.emplace_back(std::move(plan), std::move(entry));
    }
  }
  return accepted;
}

// Chance that a difference of so many sd is seen at the 1 % level.
double PowerAt(double distance) {
  const boost::math::normal normal;
  return boost::math::cdf(normal, distance - boost::math::quantile(normal, 1 - kLevel));
}

std::vector<double> ShiftsOf(const NoneOfThese& none, const campaign::Experiment& pattern) {
  std::vector<double> shifts;
  for (const campaign::MeasuredObservable& observable : pattern.observables) {
    const auto missed = none.missed.find(observable.name);
    shifts.push_back(missed == none.missed.end() ? 0 : missed->second);
  }
  return shifts;
}

std::string NothingToPlan(const campaign::Experiment& pattern) {
  return absl::StrCat("tests are planned by other values of what the campaign file sets and of ",
                      "what drives them, and ", pattern.test,
                      " here has nothing of that to change; other tests and observables that were "
                      "not read (`calibctl tests`) are for you to choose");
}

}  // namespace

double SeparationOf(const std::vector<Eigen::VectorXd>& departures, double scatter,
                    const std::vector<double>& shift) {
  const double half = 0.5 * scatter * scatter;  // of the variance of one run
  double square = 0;
  double of_chance = 0;  // its mean between two runs of one model
  for (std::size_t j = 0; j < departures.size(); ++j) {
    const Eigen::VectorXd& u = departures[j];
    const auto n = static_cast<double>(u.size());
    // Covariance of a reading among three of a kind (the measurement, both runs) and of their mean.
    const double single = 1 + 3 * half;
    const double other = shift.empty() ? 0 : shift[j];
    const double whole = single + (3 * half + other * other) * n;
    const double along = u.sum() * u.sum() / n;
    square += along / whole + (u.squaredNorm() - along) / single;
    of_chance += 2 * half * (1 + n) / whole + 2 * half * (n - 1) / single;
  }
  return std::max(0.0, square - of_chance);
}

void Weigh(const std::vector<RivalPair>& pairs, PlannedExperiment& planned) {
  planned.together.clear();
  const RivalPair* told = nullptr;      // the closest that are told apart
  const RivalPair* farthest = nullptr;  // where there are none
  for (const RivalPair& pair : pairs) {
    if (farthest == nullptr || pair.distance > farthest->distance) farthest = &pair;
    if (pair.power < kToldApart) {
      planned.together.emplace_back(pair.a, pair.b);
    } else if (told == nullptr || pair.distance < told->distance) {
      told = &pair;
    }
  }
  const RivalPair* const pair = told != nullptr ? told : farthest;
  planned.distance = pair == nullptr ? 0 : pair->distance;
  planned.expected_power = pair == nullptr ? 0 : pair->power;
}

double ShareToldApart(const std::vector<RivalPair>& pairs) {
  double sum = 0;
  for (const RivalPair& pair : pairs) sum += pair.power;
  return pairs.empty() ? 0 : sum / static_cast<double>(pairs.size());
}

absl::StatusOr<NextPlan> PlanNextExperiment(client::Laboratory& laboratory,
                                            const std::vector<Rival>& rivals,
                                            const std::optional<NoneOfThese>& none, int like,
                                            double scatter) {
  if (rivals.size() < 2) return NextPlan{.why_none = "there are no two models to tell apart"};
  const report::CampaignView& base = *rivals.front().view;
  if (base.campaign.filter.noise != inference::NoiseMode::kGiven) {
    return NextPlan{.why_none =
                        "the size of the errors is inferred, so that no distance in units "
                        "of them is known beforehand; state the noise"};
  }
  const campaign::Experiment& pattern = PatternOf(base.campaign);
  auto offered = AcceptedPlans(laboratory, rivals.front(), like);
  if (!offered.ok()) return offered.status();
  if (offered->empty()) return NextPlan{.why_none = NothingToPlan(pattern)};
  std::vector<TestPlan> plans;
  std::vector<YamlNode> entries;
  std::map<std::string, std::string> files;
  for (auto& [plan, entry] : *offered) {
    files[plan.file] = DataOf(plan.experiment, pattern);
    plans.push_back(std::move(plan));
    entries.push_back(std::move(entry));
  }
  NextExperiment next;
  std::vector<std::vector<std::vector<Eigen::VectorXd>>> curves;  // [model][plan][observable]
  double core_hours = 0;
  std::vector<Rival> models = rivals;
  if (none) models.push_back(none->base);
  for (const Rival& rival : models) {
    const auto text = RivalsText(rival, base.status.campaign(), like, entries);
    if (!text.ok()) return text.status();
    const auto view = laboratory.Run(*rival.view, *text,
                                     "planning the next experiment with " + rival.name, files);
    if (!view.ok()) return view.status();
    next.evaluations += view->status.model_evaluations();
    core_hours += view->status.core_hours();
    auto& own = curves.emplace_back();
    for (const TestPlan& plan : plans) {
      const auto readings = static_cast<Index>(plan.experiment.path.size());
      own.push_back(CurvesOf(*view, plan.name, pattern, readings));
    }
  }
  constexpr double kSecondsPerHour = 3600;
  next.core_seconds = next.evaluations > 0
                          ? core_hours * kSecondsPerHour / static_cast<double>(next.evaluations)
                          : 0;
  std::vector<std::size_t> finished;
  std::vector<std::vector<RivalPair>> pairs(plans.size());
  for (std::size_t p = 0; p < plans.size(); ++p) {
    const bool all_end =
        std::none_of(curves.begin(), curves.begin() + static_cast<std::ptrdiff_t>(rivals.size()),
                     [p](const auto& own) { return own[p].empty(); });
    if (!all_end) continue;
    for (std::size_t a = 0; a < rivals.size(); ++a) {
      for (std::size_t b = a + 1; b < rivals.size(); ++b) {
        const double distance =
            std::sqrt(SeparationOf(DeparturesOf(curves[a][p], curves[b][p], pattern), scatter));
        pairs[p].push_back({.a = rivals[a].name,
                            .b = rivals[b].name,
                            .distance = distance,
                            .power = PowerAt(distance)});
      }
    }
    Weigh(pairs[p], plans[p].experiment);
    if (!none || curves.back()[p].empty()) {
      finished.push_back(p);
      continue;
    }
    double from_none = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < rivals.size(); ++a) {
      const auto departures = DeparturesOf(curves[a][p], curves.back()[p], pattern);
      from_none = std::min(from_none,
                           std::sqrt(SeparationOf(departures, scatter, ShiftsOf(*none, pattern))));
    }
    plans[p].experiment.distance_from_none = from_none;
    plans[p].experiment.power_against_none = PowerAt(from_none);
    finished.push_back(p);
  }
  if (finished.empty()) {
    return NextPlan{.why_none = "no planned test came to an end with all of the models"};
  }
  std::stable_sort(finished.begin(), finished.end(), [&](std::size_t a, std::size_t b) {
    const double share_a = ShareToldApart(pairs[a]);
    const double share_b = ShareToldApart(pairs[b]);
    if (share_a != share_b) return share_a > share_b;
    return plans[a].experiment.distance > plans[b].experiment.distance;
  });
  for (const std::size_t p : finished) next.considered.push_back(plans[p].experiment);
  next.best = plans[finished.front()].experiment;
  const std::vector<RivalPair>& told = pairs[finished.front()];
  for (const Rival& rival : rivals) {
    if (std::any_of(told.begin(), told.end(), [&rival](const RivalPair& pair) {
          return pair.power >= kToldApart && (pair.a == rival.name || pair.b == rival.name);
        })) {
      next.separates.push_back(rival.name);
    }
  }
  if (next.separates.empty()) {
    return NextPlan{.why_none = fmt::format(
                        "of the {} tests that were tried none tells any two of these models apart, "
                        "from one specimen each (the best with a power of {})",
                        finished.size(), report::Percent(next.best.expected_power, 2))};
  }
  YamlNode snippet = entries[finished.front()];
  campaign::YamlAt(campaign::YamlAt(snippet, "data"), "file") =
      campaign::YamlScalar("measurement_to_be_made.csv");
  const std::string section = campaign::ToYaml(
      campaign::YamlMap({{"experiments", campaign::YamlList({std::move(snippet)})}}));
  next.snippet = absl::StrCat(kSnippetHead, section.substr(section.find('\n') + 1));
  return NextPlan{.next = std::move(next)};
}

}  // namespace calib::diagnosis
