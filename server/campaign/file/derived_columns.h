#pragma once
// The key `formulas` of `data`: columns that the laboratory's file does not have, computed of those
// it has.

#include <map>
#include <string>
#include <vector>

#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

class DerivedColumns {
 public:
  /// Reads {NAME: formula}; a formula speaks of columns by $N, their number from 1, or by their
  /// name where that is a plain word, and computes with the numbers as they stand in the file.
  static DerivedColumns Read(MapReader& data);

  /// Plain words that the formulas speak of: names of columns, or of functions.
  [[nodiscard]] std::vector<std::string> Words() const;
  [[nodiscard]] bool Has(const std::string& name) const { return formulas_.contains(name); }

  /// Values of all of them, row by row; NaN where a number they need is missing. What is wrong is
  /// added to the context, at the formula or at the row where it gives no number.
  void Compute(const MapReader& data, const std::string& path, const DataTable& table,
               ReadContext& context);

  /// Precondition: Has(name), Compute() has been called and nothing was wrong.
  [[nodiscard]] const std::vector<double>& Values(const std::string& name) const {
    return values_.at(name);
  }

 private:
  std::map<std::string, std::string> formulas_;  // by name
  std::map<std::string, std::vector<double>> values_;
};

}  // namespace calib::campaign
