#include "server/methods/table/table.h"

#include "server/campaign/keys/key.h"
#include "server/campaign/model/campaign.h"
#include "server/planning/planner.h"

namespace calib::methods {
namespace {

class Table final : public campaign::Method {
 public:
  std::string name() const override { return "table"; }
  campaign::ChosenBy chosen_by() const override { return campaign::ChosenBy::kFile; }
  bool takes_made_runs() const override { return true; }
  int standard_iterations() const override { return 1; }

  std::vector<campaign::Section> Keys() const override {
    return {{"inference",
             "inference",
             {{"rows", campaign::ListOf(campaign::MapOf("row")), "table: required; else none",
               "runs to be made"}}}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& /*inference*/,
                                               campaign::Campaign& campaign) const override {
    campaign.max_iterations = 1;
    return std::make_shared<Table>();
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& /*definition*/) const override {
    return nullptr;
  }
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeTable() { return std::make_shared<Table>(); }

}  // namespace calib::methods
