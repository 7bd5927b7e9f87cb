#include "server/diagnosis/plan_screen.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/diagnosis/plan_grid.h"
#include "server/diagnosis/plan_words.h"
#include "server/diagnosis/test_plans.h"
#include "server/methods/registry.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {
namespace {

using campaign::YamlNode;
using Eigen::Index;

constexpr double kLevel = 0.01;

// Error stated for a reading of this size: that of the nearest one measured.
double ErrorAt(const campaign::MeasuredObservable& observable, double value) {
  Index nearest = -1;
  const auto apart = [&](Index i) {
    return std::abs(observable.values[static_cast<std::size_t>(i)] - value);
  };
  for (const Index i : campaign::RowsRead(observable)) {
    if (nearest < 0 || apart(i) < apart(nearest)) nearest = i;
  }
  return observable.sd[static_cast<std::size_t>(nearest)];
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

// The rival run in these experiments, at each of the points.
absl::StatusOr<std::string> RivalsText(const Rival& rival,
                                       const std::vector<std::map<std::string, double>>& points,
                                       const std::string& parent, int like,
                                       const std::vector<YamlNode>& entries) {
  std::vector<campaign::Derivation::Row> rows;
  rows.reserve(points.size());
  for (const auto& values : points) rows.push_back({.like = like, .values = values});
  return campaign::Derive(methods::All(), rival.view->source.campaign_file(),
                          {.name = fmt::format("{}: next experiment", rival.view->campaign.name),
                           .lineage = {.parent = parent, .purpose = "next_experiment"},
                           .effects = rival.effects,
                           .parameters = rival.parameters,
                           .experiments = entries,
                           .rows = std::move(rows)});
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

// A plan, and what the rivals do in it.
struct Tried {
  TestPlan plan;
  YamlNode entry;
  std::vector<RivalPair> pairs;
  std::string data;  // its file
  /// [rival][point][observable]; the best point first.
  std::vector<std::vector<std::vector<Eigen::VectorXd>>> curves;
  bool confirmed = false;  // at further points
};

// The models, and what has been tried with them.
class Planning {
 public:
  Planning(client::Laboratory& laboratory, const std::vector<Rival>& rivals,
           const std::optional<NoneOfThese>& none, int like, double scatter)
      : laboratory_(laboratory),
        rivals_(rivals),
        none_(none),
        like_(like),
        scatter_(scatter),
        base_(*rivals.front().view),
        pattern_(PatternOf(base_.campaign)) {}

  absl::StatusOr<PlanScreen> Plan() {
    if (base_.campaign.filter.noise != inference::NoiseMode::kGiven) {
      return PlanScreen{.why_none =
                            "the size of the errors is inferred, so that no distance in units "
                            "of them is known beforehand; state the noise"};
    }
    RETURN_IF_ERROR(Try(PlansFor(base_.campaign)));
    if (offered_ == 0) return PlanScreen{.why_none = NothingToPlan(pattern_)};
    if (tried_.empty()) {
      return PlanScreen{.evaluations = evaluations_,
                        .why_none = "no planned test came to an end with all of the models"};
    }
    std::string warning;
    if (auto status = Refine(); !status.ok()) {  // what is known by now is not lost with it
      if (absl::IsCancelled(status)) return status;
      warning =
          absl::StrCat("A better next experiment could not be looked for: ", status.message());
    }
    PlanScreen screen{.evaluations = evaluations_, .warning = std::move(warning)};
    for (const Tried& one : tried_) screen.plans.push_back(Screened(one));
    return screen;
  }

 private:
  // With more of the pairs told apart one change is enough.
  static constexpr double kEnough = 0.99;
  static constexpr std::size_t kConfirmed = 3;

  static bool TellsSome(const Tried& tried) {
    return tried.plan.experiment.expected_power >= kToldApart;
  }

  absl::Status Refine() {
    RETURN_IF_ERROR(Confirm());
    if (ShareToldApart(tried_.front().pairs) >= kEnough) return absl::OkStatus();
    std::vector<PlannedExperiment> best_first;
    for (const Tried& one : tried_) {
      if (TellsSome(one)) best_first.push_back(one.plan.experiment);
    }
    RETURN_IF_ERROR(Try(GridOf(AsDone(base_.campaign), best_first)));
    return Confirm();
  }

  // Those of the plans that this build accepts (some settings go together with others), run with
  // every model. Leaves what was tried best first.
  absl::Status Try(std::vector<PlannedExperiment> wanted) {
    std::vector<Tried> plans;
    std::map<std::string, std::string> files;
    const std::optional<YamlNode> original =
        EntryNamed(base_.source.campaign_file(), base_.campaign, pattern_.name);
    if (!original) return absl::OkStatus();
    for (TestPlan& plan : Named(std::move(wanted), numbered_ + 1)) {
      ++numbered_;
      YamlNode entry = EntryFor(plan, pattern_, *original, base_.campaign);
      ASSIGN_OR_RETURN(const auto text, RivalsText(rivals_.front(), {rivals_.front().values},
                                                   base_.status.campaign(), like_, {entry}));
      const std::string data = DataOf(plan.experiment, pattern_);
      if (!laboratory_.Read(base_, text, {{plan.file, data}}).ok()) continue;
      files[plan.file] = data;
      plans.push_back({.plan = std::move(plan),
                       .entry = std::move(entry),
                       .pairs = {},
                       .data = data,
                       .curves = {},
                       .confirmed = false});
    }
    if (plans.empty()) return absl::OkStatus();
    offered_ += plans.size();
    ASSIGN_OR_RETURN(const auto curves, Run(plans, files));
    for (std::size_t p = 0; p < plans.size(); ++p) {
      if (!IsFinished(curves, p)) continue;
      for (std::size_t r = 0; r < rivals_.size(); ++r) plans[p].curves.push_back({curves[r][p]});
      ComparePairs(plans[p]);
      CompareWithNone(curves, p, plans[p].plan.experiment);
      tried_.push_back(std::move(plans[p]));
    }
    BestFirst();
    return absl::OkStatus();
  }

  // What has been seen at one point each alone may stand out by chance and comes behind the rest.
  void BestFirst() {
    std::stable_sort(tried_.begin(), tried_.end(), [](const Tried& a, const Tried& b) {
      if (a.confirmed != b.confirmed) return a.confirmed;
      const double share_a = ShareToldApart(a.pairs);
      const double share_b = ShareToldApart(b.pairs);
      if (share_a != share_b) return share_a > share_b;
      return a.plan.experiment.distance > b.plan.experiment.distance;
    });
  }

  // The best of those that have not been, at the rivals' other points.
  absl::Status Confirm() {
    std::vector<Tried*> wanted;
    std::vector<YamlNode> entries;
    std::map<std::string, std::string> files;
    for (Tried& one : tried_) {
      if (one.confirmed || wanted.size() == kConfirmed || !TellsSome(one)) continue;
      wanted.push_back(&one);
      entries.push_back(one.entry);
      files[one.plan.file] = one.data;
    }
    for (std::size_t r = 0; r < rivals_.size() && !wanted.empty(); ++r) {
      const Rival& rival = rivals_[r];
      if (rival.near.empty()) continue;
      ASSIGN_OR_RETURN(const auto text,
                       RivalsText(rival, rival.near, base_.status.campaign(), like_, entries));
      ASSIGN_OR_RETURN(
          const auto view,
          laboratory_.Run(*rival.view, text,
                          "the best next experiments at other points of " + rival.name, files));
      evaluations_ += view.status.model_evaluations();
      for (Tried* one : wanted) {
        const auto readings = static_cast<Index>(one->plan.experiment.path.size());
        for (int i = 0; i < static_cast<int>(rival.near.size()); ++i) {
          auto curves = CurvesOf(view, one->plan.name, i, pattern_, readings);
          if (!curves.empty()) one->curves[r].push_back(std::move(curves));
        }
      }
    }
    for (Tried* one : wanted) {
      one->confirmed = true;
      ComparePairs(*one);
    }
    BestFirst();
    return absl::OkStatus();
  }

  using Curves = std::vector<std::vector<std::vector<Eigen::VectorXd>>>;

  // [model][plan][observable]; what the plans cost is noted in them.
  absl::StatusOr<Curves> Run(std::vector<Tried>& plans,
                             const std::map<std::string, std::string>& files) {
    std::vector<YamlNode> entries;
    entries.reserve(plans.size());
    for (const Tried& one : plans) entries.push_back(one.entry);
    std::vector<Rival> models = rivals_;
    if (none_) models.push_back(none_->base);
    std::vector<int> ran(plans.size(), 0);  // whose time is known
    Curves curves;
    for (const Rival& rival : models) {
      ASSIGN_OR_RETURN(const auto text,
                       RivalsText(rival, {rival.values}, base_.status.campaign(), like_, entries));
      ASSIGN_OR_RETURN(const auto view,
                       laboratory_.Run(*rival.view, text,
                                       "planning the next experiment with " + rival.name, files));
      evaluations_ += view.status.model_evaluations();
      auto& own = curves.emplace_back();
      for (std::size_t p = 0; p < plans.size(); ++p) {
        PlannedExperiment& planned = plans[p].plan.experiment;
        own.push_back(CurvesOf(view, plans[p].plan.name, 0, pattern_,
                               static_cast<Index>(planned.path.size())));
        const auto found = view.states.find({plans[p].plan.name, 0});
        if (found == view.states.end() || !(found->second.core_seconds > 0)) continue;
        ++ran[p];
        planned.core_seconds += (found->second.core_seconds - planned.core_seconds) / ran[p];
      }
    }
    return curves;
  }

  bool IsFinished(const Curves& curves, std::size_t p) const {
    return std::none_of(curves.begin(),
                        curves.begin() + static_cast<std::ptrdiff_t>(rivals_.size()),
                        [p](const auto& own) { return own[p].empty(); });
  }

  void ComparePairs(Tried& tried) const {
    tried.pairs.clear();
    std::size_t fewest = tried.curves.front().size();
    for (std::size_t a = 0; a < rivals_.size(); ++a) {
      fewest = std::min(fewest, tried.curves[a].size());
      for (std::size_t b = a + 1; b < rivals_.size(); ++b) {
        RivalPair pair{.a = rivals_[a].name, .b = rivals_[b].name};
        const auto points = static_cast<double>(tried.curves[a].size() * tried.curves[b].size());
        for (const auto& of_a : tried.curves[a]) {
          for (const auto& of_b : tried.curves[b]) {
            const double distance =
                std::sqrt(SeparationOf(DeparturesOf(of_a, of_b, pattern_), scatter_));
            pair.distance += distance / points;
            pair.power += PowerAt(distance) / points;
          }
        }
        tried.pairs.push_back(std::move(pair));
      }
    }
    tried.plan.experiment.points = static_cast<int>(fewest);
    Weigh(tried.pairs, tried.plan.experiment);
  }

  void CompareWithNone(const Curves& curves, std::size_t p, PlannedExperiment& planned) const {
    if (!none_ || curves.back()[p].empty()) return;
    double from_none = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < rivals_.size(); ++a) {
      const auto departures = DeparturesOf(curves[a][p], curves.back()[p], pattern_);
      from_none = std::min(
          from_none, std::sqrt(SeparationOf(departures, scatter_, ShiftsOf(*none_, pattern_))));
    }
    planned.distance_from_none = from_none;
    planned.power_against_none = PowerAt(from_none);
  }

  ScreenedPlan Screened(const Tried& tried) const {
    ScreenedPlan screened{
        .experiment = tried.plan.experiment,
        .entry = tried.entry,
        .file = tried.plan.file,
        .data = DataOf(tried.plan.experiment, pattern_, tried.curves.front().front())};
    for (const Rival& rival : rivals_) {
      if (std::any_of(tried.pairs.begin(), tried.pairs.end(), [&rival](const RivalPair& pair) {
            return pair.power >= kToldApart && (pair.a == rival.name || pair.b == rival.name);
          })) {
        screened.separates.push_back(rival.name);
      }
    }
    return screened;
  }

  client::Laboratory& laboratory_;
  const std::vector<Rival>& rivals_;
  const std::optional<NoneOfThese>& none_;
  int like_;
  double scatter_;
  const report::CampaignView& base_;
  const campaign::Experiment& pattern_;
  std::size_t numbered_ = 0, offered_ = 0;
  std::int64_t evaluations_ = 0;
  std::vector<Tried> tried_;  // best first
};

}  // namespace

std::vector<Eigen::VectorXd> CurvesOf(const report::CampaignView& view, const std::string& name,
                                      int sample, const campaign::Experiment& pattern,
                                      Index readings) {
  const auto found = view.states.find({name, sample});
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

absl::StatusOr<PlanScreen> ScreenPlans(client::Laboratory& laboratory,
                                       const std::vector<Rival>& rivals,
                                       const std::optional<NoneOfThese>& none, int like,
                                       double scatter) {
  if (rivals.size() < 2) return PlanScreen{.why_none = "there are no two models to tell apart"};
  return Planning(laboratory, rivals, none, like, scatter).Plan();
}

}  // namespace calib::diagnosis
