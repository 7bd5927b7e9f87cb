#pragma once
// An expression over named numbers, evaluated by muParser. The only place that knows that library.

#include <memory>
#include <string>
#include <vector>

namespace calib::dem {

/// What is wrong with the text of an expression.
struct FormulaProblem {
  std::string message;  ///< a sentence without the position; empty: nothing is wrong
  int position = 0;     ///< 1-based character of the text at which it shows
};

/// Names of the functions that an expression may call. Thread-safe.
const std::vector<std::string>& FormulaFunctions();

/// An expression of + - * / ^, comparisons, && ||, condition ? a : b, numbers, names and
/// FormulaFunctions(). Immutable; thread-safe: there are as many evaluators as threads ask at once,
/// each compiled from the same text, so that all give the same bits. Functions and powers are those
/// of dem/elementary.
class Formula {
 public:
  /// Checks syntax and names of an expression. `names`: letters, digits and _, not beginning with a
  /// digit.
  static FormulaProblem Check(const std::string& text, const std::vector<std::string>& names);

  /// Precondition: Check() finds nothing wrong. Copies share their evaluators.
  Formula(const std::string& text, const std::vector<std::string>& names);

  /// Indices into `names` of those that the expression mentions, ascending.
  [[nodiscard]] const std::vector<int>& used() const { return used_; }

  /// results[k] = value at row k, for `count` rows of used().size() numbers each, in the order of
  /// used(). Where the expression is not defined the value is NaN or infinite. Never fails.
  void Evaluate(const double* rows, int count, double* results) const;

 private:
  class Pool;
  std::shared_ptr<Pool> pool_;
  std::vector<int> used_;
};

}  // namespace calib::dem
