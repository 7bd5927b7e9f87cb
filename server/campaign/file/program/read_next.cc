#include "server/campaign/file/program/read_next.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/program/read_told.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/campaign/keys/bounds.h"

namespace calib::campaign {
namespace {

// A quantity of a name that no catalogue has: of whatever unit it is written in.
struct FreeQuantity {
  double value = 0;  // SI
  std::string unit;  // SI
};

std::optional<FreeQuantity> ReadFree(const MapReader& map, const std::string& key,
                                     const std::string& text, const std::string& name) {
  const dem::ObservableInfo* info = dem::FindObservable(name);
  if (info != nullptr) {
    const auto value = ParseQuantity(text, info->unit);
    if (value.ok() && std::isfinite(*value)) return FreeQuantity{*value, info->unit};
    map.Problem(key, value.ok() ? absl::StrCat(Quoted(text), " is not finite")
                                : std::string(value.status().message()));
    return std::nullopt;
  }
  const auto written = SplitQuantity(text);
  const auto unit = written.ok() ? ParseUnit(written->unit) : absl::StatusOr<Unit>(Unit{});
  if (written.ok() && unit.ok() && std::isfinite(written->value)) {
    return FreeQuantity{written->value * unit->factor, SiName(unit->dimension)};
  }
  map.Problem(key, !written.ok() ? std::string(written.status().message())
                   : !unit.ok()  ? std::string(unit.status().message())
                                 : absl::StrCat(Quoted(text), " is not finite"));
  return std::nullopt;
}

std::optional<FreeQuantity> ReadFreeKey(MapReader& map, const std::string& key,
                                        const std::string& name) {
  const auto text = map.Text(key);
  return text ? ReadFree(map, key, *text, name) : std::nullopt;
}

const Experiment* FirstFitted(const Campaign& campaign) {
  const auto found =
      std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                   [](const Experiment& one) { return one.role == Role::kCalibrate; });
  return found == campaign.experiments.end() ? nullptr : &*found;
}

bool TestGives(const dem::TestInfo* test, const std::string& observable) {
  return test == nullptr || std::find(test->observables.begin(), test->observables.end(),
                                      observable) != test->observables.end();
}

void ReadLaw(MapReader& noise, const std::string& control, MeasuredObservable& observable) {
  for (const char* key : {"column", "covariance"}) {
    noise.Ignore({key});
    if (noise.Has(key)) {
      noise.Problem(key, "is of readings, and there are none yet; give relative or absolute");
    }
  }
  NoiseLaw law;
  law.relative = noise.Quantity("relative").value_or(0);
  for (const char* key : {"floor", "absolute"}) {
    const auto error = ReadFreeKey(noise, key, observable.name);
    if (!error) continue;
    observable.unit = error->unit;
    (key == std::string("floor") ? law.floor : law.absolute.emplace()) = error->value;
    if (!(error->value > 0)) noise.Problem(key, "has to be greater than 0");
  }
  if (noise.Has("relative") == noise.Has("absolute")) {
    noise.problems().Add(noise.line(), noise.path(),
                         "needs exactly one of relative (with floor) and absolute");
  }
  if (const auto length = ReadFreeKey(noise, "correlation_length", control)) {
    observable.correlation_length = length->value;
  }
  observable.noise = law;
  noise.Finish();
}

// Those that the test itself lists.
void ReadObservables(MapReader& test, const dem::TestInfo* info, Experiment& next) {
  auto observables = test.Map("observables");
  if (!observables) return;
  for (const std::string& name : observables->Keys()) {
    auto one = observables->Map(name);
    if (!one) continue;
    const dem::ObservableInfo* known = dem::FindObservable(name);
    MeasuredObservable observable{.name = name, .values = {}, .sd = {}};
    if (known != nullptr) observable.unit = known->unit;
    one->Ignore({"weight"});
    if (auto noise = one->Map("noise")) {
      ReadLaw(*noise, next.control_name, observable);
    } else {
      one->Problem("noise", "is missing; e.g. {relative: 0.02, floor: 0.01}");
    }
    one->Finish();
    if (name == next.control_name) {
      observables->Problem(name, "is the control, which the model follows exactly; remove it");
    } else if (!TestGives(info, name)) {
      observables->Problem(name, absl::StrCat("is not an observable of ", info->name, "; ",
                                              Suggestion(name, info->observables)));
    }
    next.observables.push_back(std::move(observable));
  }
  observables->Finish();
}

// Those of another experiment that the test gives.
void TakeObservables(const Experiment& pattern, const dem::TestInfo* info, Experiment& next) {
  for (const MeasuredObservable& own : pattern.observables) {
    if (own.name == next.control_name || !TestGives(info, own.name)) continue;
    MeasuredObservable observable{.name = own.name, .values = {}, .sd = {}};
    observable.unit = own.unit;
    observable.noise = LawOf(own);
    if (pattern.control_name == next.control_name) {
      observable.correlation_length = CorrelationLengthOf(pattern.control, own);
    }
    next.observables.push_back(std::move(observable));
  }
}

void ReadValues(MapReader& test, Experiment& next) {
  if (test.Require("values", "of the control, e.g. [1 percent, 2 percent]") == nullptr) return;
  const auto texts = test.TextList("values");
  if (!texts) return;
  for (const std::string& text : *texts) {
    const auto value = ReadFree(test, "values", text, next.control_name);
    if (!value) return;
    const bool is_plain = value->unit == "1";  // then it is SI
    if (!is_plain && next.control_unit != "1" && value->unit != next.control_unit) {
      test.Problem("values", absl::StrCat(Quoted(text), " is of another unit than those before"));
      return;
    }
    if (!is_plain) next.control_unit = value->unit;
    next.control.push_back(value->value);
  }
  const auto [low, high] = std::minmax_element(next.control.begin(), next.control.end());
  if (next.control.empty() || !(*low < *high)) {
    test.Problem("values", "needs two values or more, of which two differ");
  }
}

// What one realization is told that the test is told otherwise.
void CheckRealizations(const MapReader& test, const Experiment& pattern, const Experiment& next) {
  for (const auto& told : next.told) {
    const std::string& name = told.first;
    const auto spread = [&name](const Specimen& specimen) {
      const auto* own = std::get_if<ProgramSpecimen>(&specimen);
      return own != nullptr && own->settings.contains(name);
    };
    if (std::any_of(next.specimens.begin(), next.specimens.end(), spread)) {
      test.Problem("settings",
                   absl::StrCat(name, " is what the realizations of ", pattern.name,
                                " differ by, which this test takes over; give it realizations "
                                "of its own"));
    }
  }
}

void ReadOne(MapReader& test, ReadContext& context, bool derived, Campaign& campaign) {
  Experiment next;
  next.name = ReadShortName(test, context.is_new());
  next.test = test.Choice("test").value_or("");
  const dem::TestInfo* info = dem::FindTest(next.test);
  next.control_name = test.RequiredText("control", "the column that drives it").value_or("");
  ReadValues(test, next);
  ReadTold(test, info, campaign, next);
  const Experiment* pattern = FirstFitted(campaign);
  if (!test.Has("realizations") && pattern != nullptr) {
    next.specimens = pattern->specimens;
    next.specimen_grains = pattern->specimen_grains;
    if (!derived) CheckRealizations(test, *pattern, next);
  }
  ReadObservables(test, info, next);
  if (!test.Has("observables") && pattern != nullptr) TakeObservables(*pattern, info, next);
  if (!derived && next.observables.empty() && !test.Has("observables")) {
    test.problems().Add(test.line(), test.PathOf("observables"),
                        "is missing, and the first calibrated experiment has none that fit");
  }
  const auto has_name = [&next](const Experiment& one) { return one.name == next.name; };
  if (std::any_of(campaign.next.begin(), campaign.next.end(), has_name)) {
    test.Problem("name", "is the name of two tests");
  } else if (!derived &&
             std::any_of(campaign.experiments.begin(), campaign.experiments.end(), has_name)) {
    test.Problem("name", "is an experiment of the campaign already; remove it here");
  }
  test.Finish();
  campaign.next.push_back(std::move(next));
}

}  // namespace

void ReadNext(MapReader& campaign_map, ReadContext& context, Campaign& campaign) {
  const YamlNode* model = campaign_map.Find("model");
  const YamlNode* list = model == nullptr ? nullptr : YamlFind(*model, "next");
  if (list == nullptr) return;
  if (list->kind != YamlNode::Kind::kSequence) {
    context.problems().Add(list->line, "model.next",
                           "has to be a list of tests, each beginning with '- name: ...'");
    return;
  }
  // A derived campaign may have other experiments, by which its parent was not read.
  const bool derived = campaign_map.Has("lineage");
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    MapReader test(list->items[i], absl::StrCat("model.next[", i + 1, "]"),
                   SectionOf("program_next"), context.problems());
    if (list->items[i].kind == YamlNode::Kind::kMap) ReadOne(test, context, derived, campaign);
  }
}

}  // namespace calib::campaign
