#pragma once
// A laboratory's file understood: what each column seems to be and why, what is odd in it, and how
// much it says. Nothing is asked of anybody, nothing is written.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/inspection/finding.h"
#include "server/inspection/inspected_table.h"

namespace calib::inspection {

/// What a column is, as the user says.
struct SaidMeaning {
  std::string column;  ///< with its unit or without
  std::string name;    ///< an observable; "nothing": it is not to be used
  std::string unit{};  ///< of its numbers; empty: not said
  int sign = 0;        ///< 1 or -1; 0: not said
};

/// What a column seems to be.
struct ColumnMeaning {
  std::string name{};    ///< as campaign files call it
  std::string header{};  ///< as it stands
  std::string role{};    ///< an observable, another quantity (header_words.h), or empty: not known
  std::string unit{};    ///< of the numbers, as ParseUnit takes it; empty: not known
  double factor = 1;     ///< value [SI] = sign * factor * number; 1 where the unit is not known
  int sign = 1;          ///< -1: compression is negative in the file
  int missing = 0;       ///< readings, over all tests of the file
  bool sign_said = false;               ///< by --meaning
  bool open = false;                    ///< it cannot be used until --meaning says what it is
  std::vector<std::string> options{};   ///< where open: what it may be, "mean_stress[kPa]"
  std::vector<std::string> evidence{};  ///< why, each a clause
};

/// A quantity that no column holds.
struct DerivedQuantity {
  std::string role{};                         ///< an observable
  std::string name{};                         ///< of the formula in a campaign file
  std::string formula{};                      ///< as the key `formulas` of a campaign takes it
  std::string unit{};                         ///< of what it gives
  double factor = 1;                          ///< value [SI] = factor * what it gives
  std::string how{};                          ///< in words
  std::vector<std::vector<double>> values{};  ///< by test and row, SI; NaN: missing
};

/// One test of the file.
struct InspectedTest {
  std::string name{};                  ///< empty where the file is one test
  std::vector<double> control{};       ///< of each row, in SI; reading numbers where none is known
  std::vector<std::size_t> turning{};  ///< rows at which the control turns back
  std::map<std::string, double> noise{};  ///< sd by column, in its own numbers
  double independent_readings = 0;
  double correlation_length = 0;  ///< of errors along the control, SI; 0: independent
};

struct Inspection {
  std::string file{};
  InspectedTable table{};
  std::size_t rows = 0;
  std::vector<ColumnMeaning> columns{};  ///< one per column of the first test
  std::vector<DerivedQuantity> derived{};
  std::string control{};  ///< role of the column that drives the test; empty: none is known
  std::vector<InspectedTest> tests{};  ///< one per part of the table
  std::vector<Finding> findings{};
  std::map<std::string, double> noise{};  ///< sd by column: the median over tests
  double independent_readings = 0;        ///< over all tests
  bool logarithmic = false;               ///< strains are logarithmic, by the void ratio
  double stated_pressure = 0;  ///< confining pressure that file or its name state [Pa]; 0: none

  [[nodiscard]] const ColumnMeaning* Find(const std::string& role) const;
  [[nodiscard]] const DerivedQuantity* FindDerived(const std::string& role) const;
  /// Whether a column holds it, or it is derived.
  [[nodiscard]] bool Has(const std::string& role) const;
  [[nodiscard]] bool IsOpen() const;  ///< whether anything is ambiguous
  /// Numbers of the column with this role in a test, or derived, SI, compression positive; empty:
  /// neither.
  [[nodiscard]] std::vector<double> Values(std::size_t test, const std::string& role) const;
};

/// Inspects a file's bytes. file: its name, which may state a pressure. Appends what is wrong, one
/// sentence each; the inspection is meaningful only if nothing was added. Pure.
Inspection Inspect(const std::string& file, const std::string& bytes,
                   const std::vector<SaidMeaning>& said,
                   std::vector<campaign::TableProblem>& problems);

/// "epsv=-volumetric_strain[percent]" in parts. INVALID_ARGUMENT is told by `problem`, a sentence.
std::optional<SaidMeaning> ReadSaidMeaning(const std::string& text, std::string& problem);

}  // namespace calib::inspection
