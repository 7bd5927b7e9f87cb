#pragma once
// Tables of runs that exist already: the keys by which they are understood, and their columns.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

using NameMap = std::vector<std::pair<std::string, std::string>>;

/// The keys of `model.precomputed`.
struct RunTableKeys {
  std::string parameters, states;  ///< paths
  std::string sample = "sample";
  std::string step = "step";
  std::string experiment;    ///< column of the states table; empty: there is one experiment
  std::string log_proposal;  ///< column of the parameter table; empty: drawn from the prior
  NameMap parameter_columns, parameter_units, state_columns, state_units;
  std::vector<std::string> absolute;  ///< parameters whose sign the simulation ignored
};
RunTableKeys ReadRunTableKeys(MapReader& map);

/// The table's column behind one of our names.
std::string ColumnOf(const NameMap& names, const std::string& name);

/// Factor to SI of a column under our name by the units at a key of the map; a unit that does not
/// measure what si_unit does is a problem.
double FactorOf(const MapReader& map, const std::string& key, const NameMap& units,
                const std::string& name, const std::string& si_unit);

/// The table named at a key; empty after a problem.
std::unique_ptr<DataTable> OpenRunTable(const MapReader& map, const std::string& key,
                                        const std::string& path,
                                        const std::vector<std::string>& wanted,
                                        ReadContext& context);

/// A column of numbers; what is wrong is added to the context.
std::vector<double> NumberColumn(const std::string& path, const DataTable& table,
                                 const std::string& column, ReadContext& context);

/// A column of whole numbers of at least 0; empty after a problem.
std::vector<int> KeyColumn(const std::string& path, const DataTable& table,
                           const std::string& column, ReadContext& context);

}  // namespace calib::campaign
