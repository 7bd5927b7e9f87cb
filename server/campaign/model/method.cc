#include "server/campaign/model/method.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

int Method::fewest_samples(std::size_t /*parameters*/) const { return 2; }

LeastRuns Method::least_runs(
    std::size_t parameters,
    const std::function<std::optional<int>(const std::string&)>& /*said*/) const {
  return {.key = "samples", .least = fewest_samples(parameters), .standard = Campaign{}.samples};
}

int Method::MostBatches(const Campaign& campaign) const {
  return RunsRowsOnly(*this) || campaign.precomputed ? 1 : campaign.max_iterations;
}

int Method::FirstBatch(const Campaign& campaign) const { return campaign.samples; }

std::string Method::RunsInWords(const Campaign& campaign) const {
  return absl::StrCat(campaign.samples, " samples in each of at most ", campaign.max_iterations,
                      " iteration(s)");
}

int Method::LaterBatch(const Campaign& campaign) const { return campaign.samples; }

void Method::Check(const MapReader& /*inference*/, const Campaign& /*campaign*/) const {}

std::string Method::ScatterLeftOut(const Campaign& /*campaign*/,
                                   const std::string& /*what*/) const {
  return "";
}

MethodInWords Method::InWords(const Campaign& /*campaign*/, int /*iterations*/) const { return {}; }

MethodList::MethodList(std::vector<std::shared_ptr<const Method>> methods)
    : methods_(std::move(methods)) {
  assert(!methods_.empty());
}

std::shared_ptr<const Method> MethodList::Find(std::string_view name) const {
  for (const auto& method : methods_) {
    if (method->name() == name) return method;
  }
  return nullptr;
}

std::shared_ptr<const Method> MethodList::Of(ChosenBy chosen_by) const {
  const auto found =
      std::find_if(methods_.begin(), methods_.end(),
                   [chosen_by](const auto& method) { return method->chosen_by() == chosen_by; });
  assert(found != methods_.end());
  return *found;
}

std::vector<std::string> MethodList::Names() const {
  std::vector<std::string> names;
  for (const auto& method : methods_) names.emplace_back(method->name());
  return names;
}

std::string MethodList::NamesOf(bool (Method::*trait)() const) const {
  std::vector<std::string> names;
  for (const auto& method : methods_) {
    if ((*method.*trait)()) names.emplace_back(method->name());
  }
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

}  // namespace calib::campaign
