#include "server/methods/surrogate_msrs/surrogate_msrs.h"

#include <algorithm>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"
#include "server/methods/surrogate_msrs/surrogate_planner.h"

namespace calib::methods {
namespace {

using campaign::Word;

constexpr std::array kResponseModelWords = {
    Word{ResponseModel::kCubicRbf, "cubic_rbf"},
    Word{ResponseModel::kGaussianProcess, "gaussian_process"},
};

class SurrogateMsrs final : public campaign::Method {
 public:
  std::string name() const override { return "surrogate_msrs"; }
  bool chooses_while_running() const override { return true; }
  bool needs_errors() const override { return true; }
  bool bounds_runs() const override { return false; }  // it would take a bound for a value
  bool may_decide_at_once() const override { return true; }
  /// A point at each end of each parameter, and one.
  int fewest_samples(std::size_t parameters) const override {
    return std::max(2, 2 * static_cast<int>(parameters) + 1);
  }

  int LaterBatch(const campaign::Campaign& campaign) const override {
    return std::min(kPointsOfABatch, campaign.samples);
  }
  /// Its evaluations are at most `samples` times `max_iterations`.
  int MostBatches(const campaign::Campaign& campaign) const override {
    const std::int64_t later =
        (static_cast<std::int64_t>(campaign.max_iterations) - 1) * campaign.samples;
    const int batch = LaterBatch(campaign);
    return static_cast<int>(1 + (later + batch - 1) / batch);
  }

  std::vector<campaign::Section> Keys() const override {
    const auto search = [](const char* what) { return absl::StrCat("surrogate_msrs: ", what); };
    return {{"inference",
             "inference",
             {
                 {"surrogate", campaign::OneWord(kResponseModelWords),
                  campaign::WordOf(kResponseModelWords, SurrogateOptions{}.model),
                  search("what predicts the misfit; the second by expected improvement")},
                 {"termination",
                  campaign::AnyOf(
                      {campaign::Number("1", {.min = 4, .max = 1e6}), campaign::OneWord({"off"})}),
                  absl::StrCat(*SurrogateOptions{}.termination),
                  search("a run ends when its misfit exceeds this times the best run's")},
                 {"in_flight", campaign::Whole(1, 1000), absl::StrCat(SurrogateOptions{}.in_flight),
                  search("runs under way at most")},
             }}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& /*campaign*/) const override {
    auto read = std::make_shared<SurrogateMsrs>();
    SurrogateOptions& options = read->options_;
    options.model = inference.Choice("surrogate", kResponseModelWords).value_or(options.model);
    const campaign::YamlNode* termination = inference.Find("termination");
    if (termination != nullptr) {
      const bool off =
          termination->kind == campaign::YamlNode::Kind::kScalar && termination->scalar == "off";
      options.termination = off ? std::nullopt : inference.Quantity("termination");
    }
    options.in_flight =
        static_cast<int>(inference.Integer("in_flight").value_or(options.in_flight));
    return read;
  }

  std::string ScatterLeftOut(const campaign::Campaign& /*campaign*/,
                             const std::string& what) const override {
    return absl::StrCat(name(), " compares runs by the stated errors alone: ", what,
                        " is not in them, and the best point owes a part of its lead to a lucky "
                        "run. A posterior from the emulator contains it.");
  }

  campaign::MethodInWords InWords(const campaign::Campaign& /*campaign*/,
                                  int /*iterations*/) const override {
    return {"Minimum sought by a metric stochastic response surface",
            {"Regis RG, Shoemaker CA (2007) A stochastic radial basis function method "
             "for the global optimization of expensive functions. INFORMS J Comput "
             "19:497–509",
             "Samuelsson A (2023) Parallel optimization for model calibration of large "
             "scale particle systems. Master's thesis, Chalmers University of "
             "Technology, Gothenburg"},
            ""};
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    return MakeSurrogatePlanner(definition, options_);
  }

 private:
  SurrogateOptions options_;
};

}  // namespace

std::shared_ptr<const campaign::Method> MakeSurrogateMsrs() {
  return std::make_shared<SurrogateMsrs>();
}

}  // namespace calib::methods
