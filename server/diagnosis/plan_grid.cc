#include "server/diagnosis/plan_grid.h"

#include <string>
#include <utility>

namespace calib::diagnosis {
namespace {

bool SameWay(const PlannedExperiment& a, const PlannedExperiment& b) {
  return a.control == b.control && a.path == b.path && a.unloading_at == b.unloading_at;
}

// A plan that sets nothing of this name leaves it as it was.
std::optional<double> SettingOf(const PlannedExperiment& planned, const std::string& name,
                                const PlannedExperiment& as_done) {
  for (const PlannedExperiment* one : {&planned, &as_done}) {
    if (const auto found = one->settings.find(name); found != one->settings.end()) {
      return found->second;
    }
  }
  return std::nullopt;
}

// Of `changes` those that another one leaves as they were. False: they change it differently.
bool TakeOver(const PlannedExperiment& as_done, const PlannedExperiment& changes,
              PlannedExperiment& out) {
  if (changes.test != as_done.test) {
    if (out.test != as_done.test && out.test != changes.test) return false;
    out.test = changes.test;
  }
  for (const auto& [name, value] : changes.settings) {
    const auto before = SettingOf(as_done, name, as_done);
    if (before == value) continue;
    const auto own = SettingOf(out, name, as_done);
    if (own != before && own != value) return false;
    out.settings[name] = value;
  }
  if (!SameWay(changes, as_done)) {
    if (!SameWay(out, as_done) && !SameWay(out, changes)) return false;
    out.control = changes.control;
    out.path = changes.path;
    out.unloading_at = changes.unloading_at;
  }
  return true;
}

bool Same(const PlannedExperiment& a, const PlannedExperiment& b) {
  return a.test == b.test && a.settings == b.settings && SameWay(a, b);
}

}  // namespace

std::optional<PlannedExperiment> Together(const PlannedExperiment& as_done,
                                          const PlannedExperiment& a, const PlannedExperiment& b) {
  PlannedExperiment both = as_done;
  if (!TakeOver(as_done, a, both)) return std::nullopt;
  PlannedExperiment first = both;
  if (!TakeOver(as_done, b, both) || Same(first, both)) return std::nullopt;
  PlannedExperiment second = as_done;
  TakeOver(as_done, b, second);
  if (Same(second, both) || both.settings.contains(both.control)) return std::nullopt;
  return both;
}

std::vector<PlannedExperiment> GridOf(const PlannedExperiment& as_done,
                                      const std::vector<PlannedExperiment>& best_first) {
  std::vector<PlannedExperiment> chosen;
  std::vector<PlannedExperiment> grid;
  for (const PlannedExperiment& candidate : best_first) {
    if (chosen.size() == kChangesOfGrid) break;
    std::vector<PlannedExperiment> with_each;
    for (const PlannedExperiment& other : chosen) {
      if (auto both = Together(as_done, other, candidate)) with_each.push_back(*std::move(both));
    }
    if (with_each.size() < chosen.size()) continue;
    if (chosen.size() + 1 == kChangesOfGrid) {
      auto all = Together(as_done, grid.front(), candidate);
      if (!all) continue;
      with_each.push_back(*std::move(all));
    }
    chosen.push_back(candidate);
    for (PlannedExperiment& planned : with_each) grid.push_back(std::move(planned));
  }
  return grid;
}

}  // namespace calib::diagnosis
