#pragma once
// One prior: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}.

#include <optional>
#include <string>
#include <vector>

#include "inference/data/model_error.h"
#include "inference/prior/prior.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/population.h"

namespace calib::campaign {

/// Problem at `key` of `map` when bounds cut off all but 1e-4 of a normal prior: they contradict
/// it.
bool HoldsMass(const inference::Prior& prior, const std::string& key, MapReader& map);

/// uniform, log_uniform: min and max. normal: mean, sd, optional min and max. log_normal: mean is
/// the median in units, sd the standard deviation of ln x (a plain number), optional min and max.
/// Empty: a problem was added.
std::optional<inference::Prior> ReadPrior(const YamlNode& node, const std::string& path,
                                          const std::string& si_unit, ProblemList& problems);

/// The SI unit that the numbers of a prior carry, or that its `unit` says; "1" where they are
/// plain.
std::string UnitOfPrior(const YamlNode& node);

/// What stands at `equal_to` of a parameter that follows from others. Empty: there is no such key,
/// or a problem was added.
std::optional<std::string> ReadTie(const YamlNode& node, const std::string& path,
                                   ProblemList& problems);
bool IsTied(const YamlNode& node);

/// What a parameter's map says beside its prior.
struct BesidePrior {
  bool nuisance = false;
  std::optional<Per> per{};
  std::optional<inference::Prior> spread{};          ///< with `per`
  std::optional<std::vector<std::string>> labels{};  ///< with `per`; empty: all there are
};

/// ReadPrior() and what stands beside it. A problem where `per` and `spread` are not both there.
std::optional<inference::Prior> ReadPriorOf(const YamlNode& node, const std::string& path,
                                            const std::string& si_unit, ProblemList& problems,
                                            BesidePrior& beside);

/// The prior of a standard deviation in si_unit, or with `on: variance` of its square, at 0 or
/// above.
std::optional<inference::ErrorScale> ReadErrorScale(const YamlNode& node, const std::string& path,
                                                    const std::string& si_unit,
                                                    ProblemList& problems);

/// ReadPriorOf() for a parameter that no catalogue knows (precomputed runs): its unit is what its
/// numbers carry, or `unit:`. si_unit receives the SI unit ("1" for plain numbers).
std::optional<inference::Prior> ReadFreePrior(const YamlNode& node, const std::string& path,
                                              ProblemList& problems, std::string& si_unit,
                                              BesidePrior& beside);

}  // namespace calib::campaign
