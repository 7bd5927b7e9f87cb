#include "server/campaign/file/shared/formula_units.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/formula/formula.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

/// What is known of a part of the formula without values.
struct Part {
  Dimension dimension;
  std::optional<double> number;  ///< it is a plain number
  std::size_t begin = 0, end = 0;

  [[nodiscard]] bool Anything() const { return number && (*number == 0 || std::isinf(*number)); }
};

Dimension Power(const Dimension& d, double n) {
  return {n * d.kilogram, n * d.metre, n * d.second, n * d.radian};
}

Dimension Product(const Dimension& a, const Dimension& b, double sign) {
  return {a.kilogram + sign * b.kilogram, a.metre + sign * b.metre, a.second + sign * b.second,
          a.radian + sign * b.radian};
}

bool IsNumber(const Dimension& d) { return SameKind(d, {}); }

/// Recursive descent; the first problem stops it.
class Reader {
 public:
  Reader(const std::string& text, const std::map<std::string, Dimension>& names)
      : text_(text), names_(names) {}

  FormulaUnits Read() {
    const Part whole = Condition();
    Skip();
    if (problem_.empty() && at_ < text_.size()) Fail(at_, Unexpected());
    return {.problem = problem_,
            .position = position_,
            .dimension = whole.dimension,
            .anything = whole.Anything()};
  }

 private:
  static constexpr int kDeepest = 100;

  void Skip() {
    while (at_ < text_.size() && text_[at_] == ' ') ++at_;
  }

  bool Take(const std::string& token) {
    Skip();
    if (text_.compare(at_, token.size(), token) != 0) return false;
    at_ += token.size();
    return true;
  }

  void Fail(std::size_t at, const std::string& problem) {
    if (!problem_.empty()) return;
    problem_ = problem;
    position_ = static_cast<int>(at) + 1;
  }

  [[nodiscard]] std::string Unexpected() const {
    return at_ < text_.size() ? absl::StrCat("'", text_.substr(at_, 1), "' is not expected here")
                              : "the formula ends where a value is expected";
  }

  [[nodiscard]] std::string Named(const Part& part) const {
    std::string text = text_.substr(part.begin, part.end - part.begin);
    while (!text.empty() && text.back() == ' ') text.pop_back();
    return absl::StrCat(
        text, " is ", IsNumber(part.dimension) ? "a plain number" : "in " + SiName(part.dimension));
  }

  /// Both have to measure the same; what they have in common.
  Dimension Same(const Part& a, const Part& b, const std::string& what) {
    if (!a.Anything() && !b.Anything() && !SameKind(a.dimension, b.dimension)) {
      Fail(b.begin, absl::StrCat(Named(a), ", ", Named(b), ": they cannot be ", what));
    }
    return a.Anything() ? b.dimension : a.dimension;
  }

  void Plain(const Part& part, const std::string& what) {
    if (!IsNumber(part.dimension)) {
      Fail(part.begin, absl::StrCat(Named(part), ", but ", what, " has to be a plain number"));
    }
  }

  Part Joined(const Part& a, Dimension dimension, std::optional<double> number = {}) const {
    return {.dimension = dimension, .number = number, .begin = a.begin, .end = at_};
  }

  Part Condition() {
    if (++depth_ > kDeepest) Fail(at_, "the formula is nested too deeply");
    if (!problem_.empty()) return {};
    Part left = Either();
    if (Take("?")) {
      Plain(left, "a condition");
      const Part yes = Condition();
      if (!Take(":")) Fail(at_, "a condition needs ':' and what holds otherwise");
      const Part no = Condition();
      left = Joined(left, Same(yes, no, "outcomes of one condition"));
    }
    --depth_;
    return left;
  }

  Part Either() {
    Part left = Both();
    while (problem_.empty() && Take("||")) {
      const Part right = Both();
      Plain(left, "what || joins");
      Plain(right, "what || joins");
      left = Joined(left, {});
    }
    return left;
  }

  Part Both() {
    Part left = Comparison();
    while (problem_.empty() && Take("&&")) {
      const Part right = Comparison();
      Plain(left, "what && joins");
      Plain(right, "what && joins");
      left = Joined(left, {});
    }
    return left;
  }

  Part Comparison() {
    Part left = Sum();
    while (problem_.empty() &&
           (Take("<=") || Take(">=") || Take("==") || Take("!=") || Take("<") || Take(">"))) {
      const Part right = Sum();
      Same(left, right, "compared");
      left = Joined(left, {});
    }
    return left;
  }

  Part Sum() {
    Part left = Term();
    while (problem_.empty()) {
      const bool plus = Take("+");
      if (!plus && !Take("-")) break;
      const Part right = Term();
      std::optional<double> number;
      if (left.number && right.number) {
        number = plus ? *left.number + *right.number : *left.number - *right.number;
      }
      left = Joined(left, Same(left, right, plus ? "added" : "subtracted"), number);
    }
    return left;
  }

  Part Term() {
    Part left = Signed();
    while (problem_.empty()) {
      const bool times = Take("*");
      if (!times && !Take("/")) break;
      const Part right = Signed();
      std::optional<double> number;
      if (left.number && right.number) {
        number = times ? *left.number * *right.number : *left.number / *right.number;
      }
      left = Joined(left, Product(left.dimension, right.dimension, times ? 1 : -1), number);
    }
    return left;
  }

  Part Signed() {
    if (++depth_ > kDeepest) Fail(at_, "the formula is nested too deeply");
    if (!problem_.empty()) return {};
    Skip();
    const std::size_t begin = at_;
    Part part;
    if (Take("-")) {
      part = Signed();
      if (part.number) part.number = -*part.number;
      part.begin = begin;
    } else if (Take("+")) {
      part = Signed();
      part.begin = begin;
    } else {
      part = Raised();
    }
    --depth_;
    return part;
  }

  Part Raised() {
    const Part base = Value();
    if (!problem_.empty() || !Take("^")) return base;
    const Part exponent = Signed();
    Plain(exponent, "an exponent");
    if (IsNumber(base.dimension)) {
      std::optional<double> number;
      if (base.number && exponent.number) number = std::pow(*base.number, *exponent.number);
      return Joined(base, {}, number);
    }
    if (!exponent.number) {
      Fail(exponent.begin, absl::StrCat(Named(base),
                                        ": something with a unit can be raised only to "
                                        "a number that is written out"));
      return base;
    }
    return Joined(base, Power(base.dimension, *exponent.number));
  }

  Part Value() {
    Skip();
    const std::size_t begin = at_;
    if (Take("(")) {
      const Part inner = Condition();
      if (!Take(")")) Fail(at_, at_ < text_.size() ? Unexpected() : "a ')' is missing");
      return {.dimension = inner.dimension, .number = inner.number, .begin = begin, .end = at_};
    }
    const char c = at_ < text_.size() ? text_[at_] : ' ';
    if (std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.') return Number();
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) return NameOrCall();
    Fail(at_, Unexpected());
    return {};
  }

  Part Number() {
    const std::size_t begin = at_;
    double value = 0;
    const auto [end, error] =
        std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) {
      Fail(at_, "this is not a number");
      return {};
    }
    at_ = static_cast<std::size_t>(end - text_.data());
    return {.dimension = {}, .number = value, .begin = begin, .end = at_};
  }

  Part NameOrCall() {
    const std::size_t begin = at_;
    while (at_ < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_')) {
      ++at_;
    }
    const std::string name = text_.substr(begin, at_ - begin);
    const auto& functions = dem::FormulaFunctions();
    if (std::find(functions.begin(), functions.end(), name) != functions.end()) {
      return Call(name, begin);
    }
    if (name == "pi")
      return {.dimension = {}, .number = std::acos(-1.0), .begin = begin, .end = at_};
    const auto known = names_.find(name);
    if (known == names_.end()) {
      std::vector<std::string> all;
      for (const auto& entry : names_) all.push_back(entry.first);
      Fail(begin, absl::StrCat(Quoted(name), " is neither a quantity nor a parameter; ",
                               Suggestion(name, all)));
      return {};
    }
    return {.dimension = known->second, .number = {}, .begin = begin, .end = at_};
  }

  Part Call(const std::string& name, std::size_t begin) {
    Part result{.dimension = {}, .number = {}, .begin = begin, .end = begin};
    if (!Take("(")) {
      Fail(at_, absl::StrCat(name, " is a function and needs its argument in parentheses"));
      return result;
    }
    std::vector<Part> arguments;
    do {
      arguments.push_back(Condition());
    } while (problem_.empty() && Take(","));
    if (!Take(")")) Fail(at_, at_ < text_.size() ? Unexpected() : "a ')' is missing");
    result.end = at_;
    const bool several = name == "min" || name == "max";
    if (!several && arguments.size() != 1) {
      Fail(begin, absl::StrCat(name, " takes one argument, not ", arguments.size()));
    }
    if (!problem_.empty()) return result;
    if (several) {
      Part common = arguments.front();
      for (const Part& argument : arguments) {
        common.dimension = Same(common, argument, "arguments of one " + name);
        if (!argument.Anything()) common.number.reset();
      }
      result.dimension = common.dimension;
    } else if (name == "sqrt") {
      result.dimension = Power(arguments[0].dimension, 0.5);
    } else if (name == "abs") {
      result.dimension = arguments[0].dimension;
    } else if (name != "sign") {
      const bool angle =
          (name == "sin" || name == "cos") && SameKind(arguments[0].dimension, {.radian = 1});
      if (!angle) Plain(arguments[0], "the argument of " + name);
    }
    return result;
  }

  const std::string& text_;
  const std::map<std::string, Dimension>& names_;
  std::size_t at_ = 0;
  int depth_ = 0;
  std::string problem_;
  int position_ = 0;
};

}  // namespace

FormulaUnits UnitsOf(const std::string& formula, const std::map<std::string, Dimension>& names) {
  return Reader(formula, names).Read();
}

}  // namespace calib::campaign
