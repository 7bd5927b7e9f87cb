#pragma once
// What the filters have in common: keys, options and what is said of them.

#include "server/campaign/keys/key.h"
#include "server/campaign/model/campaign.h"

namespace calib::methods {

class Filter : public campaign::Method {
 public:
  bool weighs_samples() const override { return true; }
  bool takes_made_runs() const override { return true; }
  bool may_decide_at_once() const override { return true; }
  std::vector<campaign::Section> Keys() const override;
  std::string ScatterLeftOut(const campaign::Campaign& campaign,
                             const std::string& what) const override;

 protected:
  /// Into Campaign::filter.
  static void ReadFilterKeys(campaign::MapReader& inference, campaign::Campaign& campaign);
};

}  // namespace calib::methods
