#pragma once
// The key `data` of an experiment: the laboratory's table, seen through our names, units and strain
// measure.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/file/read_context.h"

namespace calib::campaign {

class LaboratoryTable {
 public:
  /// Reads {file, columns, units, strain}. wanted: our names of the columns that will be asked for.
  /// free_names: names that no catalogue knows are allowed (precomputed runs). Empty after a
  /// problem that leaves nothing to read.
  static std::optional<LaboratoryTable> Read(MapReader& experiment,
                                             const std::vector<std::string>& wanted,
                                             bool free_names, ReadContext& context);

  const std::string& path() const { return path_; }
  std::size_t rows() const { return table_->rows(); }
  /// True when the file has a column for one of our names.
  bool Has(const std::string& name) const { return table_->Has(ColumnOf(name)); }
  int LineOf(std::size_t row) const { return table_->LineOf(row); }
  /// The file's column behind one of our names.
  std::string ColumnOf(const std::string& name) const;

  /// A column under our name in SI, as the laboratory computed it. Problems are added to the
  /// context.
  std::vector<double> Raw(const std::string& name, ReadContext& context) const;
  /// A column by its name in the file, in the unit of our name `like`.
  std::vector<double> RawColumn(const std::string& column, const std::string& like,
                                ReadContext& context) const;
  /// What turns a number of the file's column behind one of our names into SI.
  double Factor(const std::string& name) const;
  /// Engineering strains to logarithmic, ln being that of the deformed over the initial length or
  /// volume and compression positive: e_log = -ln(1 - e). Other observables pass unchanged.
  std::vector<double> ToModel(const std::string& name, const std::vector<double>& raw,
                              ReadContext& context) const;
  /// d e_log / d e at a raw reading: what turns the laboratory's standard deviation into the
  /// model's.
  double Slope(const std::string& name, double raw) const;

 private:
  LaboratoryTable() = default;
  bool IsEngineering(const std::string& name) const;

  std::string path_;
  std::shared_ptr<const DataTable> table_;
  std::vector<std::pair<std::string, std::string>> columns_;  // our name, the file's
  std::vector<std::pair<std::string, double>> factors_;       // our name, to SI
  enum class Strain { kEngineering, kLogarithmic };
  Strain strain_ = Strain::kEngineering;
};

}  // namespace calib::campaign
