#include "server/diagnosis/borrowed_design.h"

#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/model/race.h"
#include "server/messages/attempt_spec.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

std::vector<int> FittedOf(const campaign::Campaign& campaign) {
  std::vector<int> fitted;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    if (campaign.experiments[e].role == campaign::Role::kCalibrate)
      fitted.push_back(static_cast<int>(e));
  }
  return fitted;
}

bool SamePrior(const inference::Prior& a, const inference::Prior& b) {
  return a.kind == b.kind && a.min == b.min && a.max == b.max && a.mean == b.mean && a.sd == b.sd;
}

// Of the campaign's parameters; the design has further ones.
std::string WhyOtherParameters(const campaign::Campaign& campaign,
                               const campaign::Campaign& design) {
  for (const campaign::CalibratedParameter& own : campaign.parameters) {
    const auto found = std::find_if(
        design.parameters.begin(), design.parameters.end(),
        [&own](const campaign::CalibratedParameter& other) { return other.name == own.name; });
    if (found == design.parameters.end())
      return absl::StrCat("the parameter ", own.name, " is calibrated here alone");
    if (!SamePrior(own.prior, found->prior))
      return absl::StrCat("the prior of ", own.name, " is another one");
  }
  for (const campaign::CalibratedParameter& other : design.parameters) {
    const std::string effect = campaign::EffectNamedIn(other.name);
    const bool of_design =
        campaign::IsNumerics(design, other.name) ||
        std::find(design.race.begin(), design.race.end(), effect) != design.race.end();
    const bool of_campaign =
        std::any_of(campaign.parameters.begin(), campaign.parameters.end(),
                    [&other](const auto& own) { return own.name == other.name; });
    if (!of_design && !of_campaign)
      return absl::StrCat("the parameter ", other.name, " is calibrated there alone");
  }
  const bool tied = campaign.tied_prior.has_value();
  if (tied != design.tied_prior.has_value() ||
      (tied && (campaign.tied_prior->log_mass() != design.tied_prior->log_mass() ||
                campaign.tied_prior->correlation() != design.tied_prior->correlation())))
    return "what ties the priors is another";
  const auto same_tie = [](const campaign::TiedParameter& a, const campaign::TiedParameter& b) {
    return a.name == b.name && a.text == b.text;
  };
  if (!std::equal(campaign.tied.begin(), campaign.tied.end(), design.tied.begin(),
                  design.tied.end(), same_tie))
    return "what parameters are equal_to is another";
  return "";
}

std::string WhyOtherEffects(const campaign::Campaign& campaign, const campaign::Campaign& design) {
  const auto same = [](const dem::UserEffect& a, const dem::UserEffect& b) {
    return a.info.name == b.info.name && a.action == b.action && a.target == b.target &&
           a.formula == b.formula;
  };
  const auto& own = campaign.model.user_effects;
  const auto& other = design.model.user_effects;
  return std::equal(own.begin(), own.end(), other.begin(), other.end(), same)
             ? ""
             : "user_effects are others";
}

// Fields of what a worker is told, in the words of a campaign file.
const std::map<std::string, std::string>& WordsOfSpec() {
  static const std::map<std::string, std::string> words = {
      {"packing_digest", "packing"},
      {"recipe", "packing"},
      {"consolidation_friction", "consolidation"},
      {"consolidation_porosity", "consolidation"},
      {"initial_axial_stress", "initial_stress"},
      {"initial_lateral_stress", "initial_stress"},
      {"body_materials", "materials"},
      {"grain_materials", "materials"},
      {"parameters", "fixed"},
      {"shear_rescaled", "shear_unloading"}};
  return words;
}

// The first field in which two evaluations differ, but for names and chance; empty: none.
std::string OtherField(const google::protobuf::Message& a, const google::protobuf::Message& b) {
  using google::protobuf::util::MessageDifferencer;
  const auto* descriptor = a.GetDescriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    if (field->name() == "experiment" || field->name() == "threads" || field->name() == "seed" ||
        field->name() == "mixture_seed")
      continue;
    MessageDifferencer differencer;
    if (differencer.CompareWithFields(a, b, {field}, {field})) continue;
    const auto word = WordsOfSpec().find(field->name());
    return word == WordsOfSpec().end() ? field->name() : word->second;
  }
  return "";
}

std::string WhyOtherTests(const campaign::Campaign& campaign, const campaign::Campaign& design) {
  const std::vector<int> own = FittedOf(campaign), other = FittedOf(design);
  if (own.size() != other.size())
    return absl::StrCat(own.size(), " tests are fitted here and ", other.size(), " there");
  // The same values of the base's parameters, whatever the order; the race at its null.
  const std::vector<double> values = campaign::MiddleValues(campaign);
  std::vector<double> of_design = campaign::MiddleValues(design);
  for (std::size_t j = 0; j < design.parameters.size(); ++j) {
    for (std::size_t k = 0; k < campaign.parameters.size(); ++k) {
      if (campaign.parameters[k].name == design.parameters[j].name) of_design[j] = values[k];
    }
  }
  for (std::size_t i = 0; i < own.size(); ++i) {
    const auto& a = campaign.experiments[static_cast<std::size_t>(own[i])];
    const auto& b = design.experiments[static_cast<std::size_t>(other[i])];
    const auto differs = [&a](const std::string& what) {
      return absl::StrCat(what, " of ", a.name, " is another");
    };
    if (a.specimens.size() != b.specimens.size()) return differs("the number of packings");
    for (std::size_t s = 0; s < a.specimens.size(); ++s) {
      const auto stream = static_cast<int>(s);
      const v1::Lease here =
          messages::LeaseOf(campaign, own[i], {.values = values, .stream = stream});
      const v1::Lease there =
          messages::LeaseOf(design, other[i], {.values = of_design, .stream = stream});
      if (here.model_case() != there.model_case()) return differs("the model");
      const std::string field = here.has_program() ? OtherField(here.program(), there.program())
                                                   : OtherField(here.spec(), there.spec());
      if (!field.empty()) return differs(absl::StrCat("`", field, "`"));
    }
    const auto same_readings = [](const auto& x, const auto& y) {
      return x.name == y.name && campaign::RowsRead(x) == campaign::RowsRead(y);
    };
    if (a.control_name != b.control_name || a.control != b.control)
      return differs("the path of the control");
    if (!std::equal(a.observables.begin(), a.observables.end(), b.observables.begin(),
                    b.observables.end(), same_readings))
      return differs("what is read");
  }
  return "";
}

// What the columns of a design are to the rows of another race.
class ColumnsOf {
 public:
  static absl::StatusOr<ColumnsOf> Make(const report::CampaignView& design, const Race& all,
                                        const DesignRows& rows) {
    ColumnsOf result(rows);
    std::set<std::string> shapes;
    std::map<std::string, double> nulls;  // of strengths
    for (const RacingEffect& entry : all.effects) {
      nulls[entry.strength] = entry.null;
      for (const ShapeParameter& shape : entry.shapes) shapes.insert(shape.name);
    }
    const std::vector<std::string>& names = rows.names();
    for (const campaign::CalibratedParameter& parameter : design.campaign.parameters) {
      const auto own = std::find(names.begin(), names.end(), parameter.name);
      const auto strength = nulls.find(parameter.name);
      if (own == names.end() && strength == nulls.end() && shapes.count(parameter.name) == 0) {
        return absl::FailedPreconditionError(
            absl::StrCat("the design ", design.status.campaign(), " has runs with ", parameter.name,
                         ", which this build cannot try here; have a design made anew"));
      }
      Column& column = result.columns_.emplace_back();
      if (own != names.end()) column.place = own - names.begin();
      if (own == names.end() && strength != nulls.end()) column.null = strength->second;
    }
    return result;
  }

  /// Empty: an effect acts that the rows have not.
  std::optional<std::vector<double>> Values(const std::vector<double>& of_design) const {
    std::vector<double> values = without_;
    for (std::size_t j = 0; j < columns_.size(); ++j) {
      if (columns_[j].null && of_design[j] != *columns_[j].null) return std::nullopt;
      if (columns_[j].place) values[static_cast<std::size_t>(*columns_[j].place)] = of_design[j];
    }
    return values;
  }

 private:
  struct Column {
    std::optional<std::ptrdiff_t> place;  // among the names of the rows
    std::optional<double> null;           // of a strength that has none
  };
  explicit ColumnsOf(const DesignRows& rows) : without_(rows.WithoutEffects()) {}

  std::vector<double> without_;
  std::vector<Column> columns_;
};

EndedBatch RunsOfItsBase(const BaseRuns& of_other, const std::vector<std::string>& parameters,
                         const DesignRows& rows, const BaseRuns& base) {
  EndedBatch batch{.stage = campaign::SamplePurpose::kScout};
  const std::vector<std::string>& names = rows.race().base;
  std::vector<Index> column;
  column.reserve(names.size());
  for (const std::string& name : names)
    column.push_back(std::find(parameters.begin(), parameters.end(), name) - parameters.begin());
  const Eigen::MatrixXd values = of_other.values(Eigen::all, column);
  for (Index i = 0; i < values.rows(); ++i) {
    const int stream = of_other.stream[static_cast<std::size_t>(i)];
    bool known = false;
    for (Index k = 0; k < base.values.rows() && !known; ++k) {
      known =
          base.stream[static_cast<std::size_t>(k)] == stream && base.values.row(k) == values.row(i);
    }
    if (known) continue;
    EndedRun& ended = batch.runs.emplace_back();
    ended.run = {.values = rows.WithoutEffects(), .stream = stream};
    for (Index j = 0; j < values.cols(); ++j)
      ended.run.values[static_cast<std::size_t>(j)] = values(i, j);
    ended.readings = of_other.readings.row(i);
  }
  return batch;
}

}  // namespace

std::string WhyOtherRuns(const campaign::Campaign& campaign, const campaign::Campaign& design) {
  std::string why = WhyOtherParameters(campaign, design);
  if (why.empty()) why = WhyOtherEffects(campaign, design);
  if (why.empty()) why = WhyOtherTests(campaign, design);
  return why;
}

Race RaceWithin(Race race, const report::CampaignView& design) {
  const auto has = [&design](const std::string& name) {
    return std::any_of(design.campaign.parameters.begin(), design.campaign.parameters.end(),
                       [&name](const auto& parameter) { return parameter.name == name; });
  };
  std::vector<int> place(race.effects.size(), -1);
  std::vector<RacingEffect> within;
  std::vector<std::string> out;
  for (std::size_t k = 0; k < race.effects.size(); ++k) {
    RacingEffect& entry = race.effects[k];
    if (has(entry.strength) && std::all_of(entry.shapes.begin(), entry.shapes.end(),
                                           [&has](const auto& shape) { return has(shape.name); })) {
      place[k] = static_cast<int>(within.size());
      within.push_back(std::move(entry));
    } else if (std::find(out.begin(), out.end(), entry.name) == out.end()) {
      out.push_back(entry.name);
    }
  }
  race.effects = std::move(within);
  for (const std::string& name : out) {
    const std::vector<std::string> left = race.Names();
    if (std::find(left.begin(), left.end(), name) == left.end()) {
      race.not_excitable.emplace_back(
          name, absl::StrCat("the runs of ", design.status.campaign(), " were made without it"));
    }
  }
  for (auto* pairs : {&race.excluded, &race.kin}) {
    std::vector<std::pair<int, int>> kept;
    for (const auto& [a, b] : *pairs) {
      const int x = place[static_cast<std::size_t>(a)], y = place[static_cast<std::size_t>(b)];
      if (x >= 0 && y >= 0) kept.emplace_back(x, y);
    }
    *pairs = std::move(kept);
  }
  return race;
}

absl::StatusOr<std::vector<EndedBatch>> BorrowedBatches(const OtherDesign& other, const Race& all,
                                                        const DesignRows& rows,
                                                        const BaseRuns& base) {
  std::vector<std::string> names;
  for (const campaign::CalibratedParameter& parameter : other.design->campaign.parameters)
    names.push_back(parameter.name);
  ASSIGN_OR_RETURN(const ColumnsOf columns, ColumnsOf::Make(*other.design, all, rows));
  ASSIGN_OR_RETURN(std::vector<EndedBatch> batches, EndedBatchesOf(*other.design, names));
  const auto is_main = [](const EndedBatch& batch) {
    return batch.stage == campaign::SamplePurpose::kMain;
  };
  if (std::none_of(batches.begin(), batches.end(), is_main)) {
    return absl::FailedPreconditionError(
        absl::StrCat("the design ", other.design->status.campaign(),
                     " has no runs of the stage main: take one whose own diagnosis has ended"));
  }
  for (EndedBatch& batch : batches) {
    std::vector<EndedRun> usable;
    for (EndedRun& ended : batch.runs) {
      std::optional<std::vector<double>> values = columns.Values(ended.run.values);
      if (!values) continue;
      ended.run.values = *std::move(values);
      usable.push_back(std::move(ended));
    }
    batch.runs = std::move(usable);
  }
  ASSIGN_OR_RETURN(const BaseRuns of_other, BaseRunsOf(*other.base));
  std::vector<std::string> parameters;
  for (const campaign::CalibratedParameter& parameter : other.base->campaign.parameters)
    parameters.push_back(parameter.name);
  EndedBatch runs = RunsOfItsBase(of_other, parameters, rows, base);
  if (!runs.runs.empty()) batches.insert(batches.begin(), std::move(runs));
  return batches;
}

}  // namespace calib::diagnosis
