#include "server/methods/design/design.h"

#include "absl/strings/str_cat.h"
#include "server/campaign/file/read_rows.h"
#include "server/campaign/keys/key.h"
#include "server/campaign/model/campaign.h"
#include "server/planning/planner.h"

namespace calib::methods {
namespace {

class Design final : public campaign::Method {
 public:
  std::string name() const override { return "design"; }
  campaign::ChosenBy chosen_by() const override { return campaign::ChosenBy::kRequest; }
  int standard_iterations() const override { return 1; }

  std::vector<campaign::Section> Keys() const override {
    return {{"inference",
             "inference",
             {{"race", campaign::OneOrMore(campaign::Text()), "none",
               "design: effects that a run may have, none of them in `model.effects`"},
              {"rows", campaign::ListOf(campaign::MapOf("row")), "none",
               absl::StrCat("the first of its runs, at most ", campaign::kMostRowsOfBatch)}}}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& campaign) const override {
    campaign::ReadRace(inference, campaign);
    return std::make_shared<Design>();
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& /*definition*/) const override {
    return nullptr;
  }
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeDesign() { return std::make_shared<Design>(); }

}  // namespace calib::methods
