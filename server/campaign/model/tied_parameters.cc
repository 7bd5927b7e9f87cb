#include "server/campaign/model/tied_parameters.h"

#include <algorithm>
#include <cassert>
#include <set>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {
namespace {

// Among the calibrated, the tied ones so far and the fixed; it is one of them.
double ValueNamed(const Campaign& campaign, std::span<const double> values,
                  std::span<const double> tied, const std::string& name) {
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    if (campaign.parameters[j].name == name) return values[j];
  }
  for (std::size_t k = 0; k < tied.size(); ++k) {
    if (campaign.tied[k].name == name) return tied[k];
  }
  const auto fixed = campaign.model.parameters.find(name);
  assert(fixed != campaign.model.parameters.end());
  return fixed->second;
}

void AddSources(const Campaign& campaign, const TiedParameter& tied, std::set<std::size_t>& found) {
  for (const std::string& name : tied.inputs) {
    if (const TiedParameter* other = FindTied(campaign, name)) AddSources(campaign, *other, found);
    for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
      if (campaign.parameters[j].name == name) found.insert(j);
    }
  }
}

}  // namespace

const TiedParameter* FindTied(const Campaign& campaign, const std::string& name) {
  const auto found = std::find_if(campaign.tied.begin(), campaign.tied.end(),
                                  [&name](const TiedParameter& tied) { return tied.name == name; });
  return found == campaign.tied.end() ? nullptr : &*found;
}

std::vector<double> TiedValues(const Campaign& campaign, std::span<const double> values) {
  std::vector<double> all;
  all.reserve(campaign.tied.size());
  for (const TiedParameter& tied : campaign.tied) {
    std::vector<double> row;
    row.reserve(tied.inputs.size());
    for (const std::string& name : tied.inputs) {
      row.push_back(ValueNamed(campaign, values, all, name));
    }
    double value = 0;
    tied.formula.Evaluate(row.data(), 1, &value);
    all.push_back(value);
  }
  return all;
}

std::vector<std::size_t> FollowsFrom(const Campaign& campaign, const TiedParameter& tied) {
  std::set<std::size_t> found;
  AddSources(campaign, tied, found);
  return {found.begin(), found.end()};
}

}  // namespace calib::campaign
