#pragma once
// What a campaign's text says of where it comes from, without the files it names.

#include <string>
#include <vector>

namespace calib::campaign {

struct Origin {
  std::string parent{};   ///< id; empty: submitted by a user
  std::string purpose{};  ///< extension, screen, nuisance, warm_fit, ...; empty: as parent
  std::vector<std::string> effects{};  ///< effects of the model, in the order of the text
};

/// Pure; never fails: what the text does not say stays empty.
Origin OriginOf(const std::string& yaml);

}  // namespace calib::campaign
