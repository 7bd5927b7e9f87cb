#pragma once
// An expression over named numbers, evaluated by muParser. The only place that knows that library.

#include <memory>
#include <string>
#include <vector>

namespace calib::dem {

/// What is wrong with an expression.
struct FormulaProblem {
  std::string message;  ///< a sentence without the position; empty: nothing is wrong
  int position = 0;     ///< 1-based character
};

/// Functions that an expression may call.
const std::vector<std::string>& FormulaFunctions();

/// + - * / ^, comparisons, && ||, condition ? a : b, numbers, names and FormulaFunctions(). Thread
/// safe: as many evaluators as threads ask at once, each compiled from the same text, so that all
/// give the same bits. Transcendental functions and powers come from the C library of the machine.
class Formula {
 public:
  /// Syntax and names. `names`: letters, digits and _, not beginning with a digit.
  static FormulaProblem Check(const std::string& text, const std::vector<std::string>& names);

  /// Precondition: Check() finds nothing wrong. Copies share their evaluators.
  Formula(const std::string& text, const std::vector<std::string>& names);

  /// Indices into `names` of those that the expression mentions, ascending.
  [[nodiscard]] const std::vector<int>& used() const { return used_; }

  /// results[k] = value at row k, for `count` rows of used().size() numbers each, in the order of
  /// used(). What is not defined there comes out as NaN or infinite. Never fails.
  void Evaluate(const double* rows, int count, double* results) const;

 private:
  class Pool;
  std::shared_ptr<Pool> pool_;
  std::vector<int> used_;
};

}  // namespace calib::dem
