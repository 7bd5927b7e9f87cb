#pragma once
// The key `data` of an experiment: the laboratory's table, seen through our names, units, signs,
// zeros and strain measure.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/file/derived_columns.h"
#include "server/campaign/file/shared/read_context.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {

/// What a table's names may be.
struct TableNames {
  bool free = false;          ///< names that no catalogue knows are allowed
  bool by_unit_only = false;  ///< columns are converted by unit, strains among them
};

class LaboratoryTable {
 public:
  /// Reads {file, columns, units, strain, sign, zero, offset, formulas} and the keys of
  /// read_table_format.h. wanted: our names of the columns that will be asked for. Empty after a
  /// problem that leaves nothing to read.
  static std::optional<LaboratoryTable> Read(MapReader& experiment,
                                             const std::vector<std::string>& wanted,
                                             const TableNames& names, ReadContext& context);

  const std::string& path() const { return path_; }
  /// Leaves out the rows in which this column of ours has no number, and says how many there are.
  std::size_t KeepRowsWith(const std::string& name, ReadContext& context);
  std::size_t rows() const { return kept_.size(); }
  /// True when the file has a column for one of our names.
  bool Has(const std::string& name) const;
  int LineOf(std::size_t row) const { return table_->LineOf(kept_[row]); }
  /// The file's column behind one of our names.
  std::string ColumnOf(const std::string& name) const;

  /// A column under our name in SI, its sign turned and its zero taken off as the file asks, as the
  /// laboratory computed it; NaN where a reading is missing. Empty after a problem.
  std::vector<double> Raw(const std::string& name, ReadContext& context) const;
  /// A column by its name in the file, in the unit of our name `like`, NaN where a number is
  /// missing. Empty after a problem.
  std::vector<double> RawColumn(const std::string& column, const std::string& like,
                                ReadContext& context) const;
  /// What turns a number of the file's column behind one of our names into SI.
  double Factor(const std::string& name) const;
  /// SI unit of our name: the catalogue's, or that of the unit which the file states; "1".
  std::string UnitOf(const std::string& name) const;
  /// Engineering strains to logarithmic, ln being that of the deformed over the initial length or
  /// volume and compression positive: e_log = -ln(1 - e). Other observables pass unchanged.
  std::vector<double> ToModel(const std::string& name, const std::vector<double>& raw,
                              ReadContext& context) const;
  /// d e_log / d e at a raw reading: what turns the laboratory's standard deviation into the
  /// model's.
  double Slope(const std::string& name, double raw) const;

 private:
  LaboratoryTable() = default;
  void ReadZeros(MapReader& data, bool free_names);
  bool Open(MapReader& data, const std::vector<std::string>& wanted, ReadContext& context);
  bool IsEngineering(const std::string& name) const;
  double ZeroOf(const std::string& name, const std::vector<double>& values) const;
  void CompareUnits(const std::vector<std::string>& wanted, const std::string& experiment,
                    ReadContext& context) const;

  std::string path_;
  std::shared_ptr<const DataTable> table_;
  DerivedColumns derived_;
  std::vector<std::size_t> kept_;                             // rows of the table
  std::vector<std::pair<std::string, std::string>> columns_;  // our name, the file's
  std::vector<std::pair<std::string, double>> factors_;       // our name, to SI
  std::vector<std::pair<std::string, std::string>> units_;    // our name, SI, where stated
  std::vector<std::pair<std::string, double>> signs_;         // our name, 1 or -1
  std::vector<std::pair<std::string, double>> offsets_;       // our name, SI
  std::vector<std::string> from_first_;  // our names, whose first reading is their zero
  Strain strain_ = Strain::kEngineering;
  bool by_unit_only_ = false;
};

}  // namespace calib::campaign
