#include "dem/formula/formula.h"

#include <muParser.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <mutex>
#include <utility>

#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

double Least(const double* values, int count) { return *std::min_element(values, values + count); }
double Largest(const double* values, int count) {
  return *std::max_element(values, values + count);
}
double Sign(double x) { return x > 0 ? 1.0 : (x < 0 ? -1.0 : 0.0); }
double Root(double x) { return std::sqrt(x); }
double Size(double x) { return std::abs(x); }

/// muParser's own power is libm's, which has other bits on other processors, and cannot be
/// redefined: formulas are given to it with this operator in place of ^.
constexpr char kPower = '#';

std::string ForParser(std::string text) {
  std::replace(text.begin(), text.end(), '^', kPower);
  return text;
}

std::string AsWritten(std::string token) {
  std::replace(token.begin(), token.end(), kPower, '^');
  return token;
}

/// Only what is documented, so that what a formula may say does not depend on the library's
/// version.
void Prepare(mu::Parser& parser) {
  parser.ClearFun();
  parser.ClearConst();
  parser.DefineConst("pi", 3.14159265358979323846);
  parser.DefineFun("sqrt", &Root);
  parser.DefineFun("abs", &Size);
  parser.DefineFun("exp", &Exp);
  parser.DefineFun("log", &Log);
  parser.DefineFun("sin", &Sine);
  parser.DefineFun("cos", &Cosine);
  parser.DefineFun("tanh", &HyperbolicTangent);
  parser.DefineFun("sign", &Sign);
  parser.DefineFun("min", &Least);
  parser.DefineFun("max", &Largest);
  parser.DefineOprt(std::string(1, kPower), &Pow, mu::prPOW, mu::oaRIGHT);
}

/// Assignments, texts and lists are muParser's, not ours. 0: none of them stands there.
int ForbiddenAt(const std::string& text) {
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const char before = i > 0 ? text[i - 1] : ' ';
    const char after = i + 1 < text.size() ? text[i + 1] : ' ';
    depth += c == '(' ? 1 : (c == ')' ? -1 : 0);
    const bool comparison =
        after == '=' || before == '=' || before == '<' || before == '>' || before == '!';
    if ((c == '=' && !comparison) || (c == ',' && depth == 0) || c == '"' || c == ';' ||
        c == kPower || static_cast<unsigned char>(c) > 126 ||
        std::iscntrl(static_cast<unsigned char>(c)) != 0) {
      return static_cast<int>(i) + 1;
    }
  }
  return 0;
}

}  // namespace

const std::vector<std::string>& FormulaFunctions() {
  static const auto* const names = new std::vector<std::string>{
      "abs", "cos", "exp", "log", "max", "min", "sign", "sin", "sqrt", "tanh"};
  return *names;
}

/// Evaluators that nobody is using right now.
class Formula::Pool {
 public:
  struct Evaluator {
    mu::Parser parser;
    std::vector<double> values;
  };

  Pool(std::string text, std::vector<std::string> names)
      : text_(std::move(text)), names_(std::move(names)) {}

  std::unique_ptr<Evaluator> Take() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!idle_.empty()) {
        auto evaluator = std::move(idle_.back());
        idle_.pop_back();
        return evaluator;
      }
    }
    auto evaluator = std::make_unique<Evaluator>();
    evaluator->values.assign(names_.size(), 0.0);
    Prepare(evaluator->parser);
    for (std::size_t i = 0; i < names_.size(); ++i) {
      evaluator->parser.DefineVar(names_[i], &evaluator->values[i]);
    }
    evaluator->parser.SetExpr(ForParser(text_));
    return evaluator;
  }

  void Give(std::unique_ptr<Evaluator> evaluator) {
    const std::lock_guard<std::mutex> lock(mutex_);
    idle_.push_back(std::move(evaluator));
  }

 private:
  std::string text_;
  std::vector<std::string> names_;  ///< used ones only
  std::mutex mutex_;
  std::vector<std::unique_ptr<Evaluator>> idle_;
};

FormulaProblem Formula::Check(const std::string& text, const std::vector<std::string>& names) {
  if (std::all_of(text.begin(), text.end(), [](char c) { return c == ' '; })) {
    return {.message = "the formula is empty", .position = 1};
  }
  if (const int at = ForbiddenAt(text); at > 0) {
    return {.message = "'" + text.substr(static_cast<std::size_t>(at) - 1, 1) +
                       "' has no meaning in a formula",
            .position = at};
  }
  std::vector<double> values(names.size(), 1.0);
  try {
    mu::Parser parser;
    Prepare(parser);
    for (std::size_t i = 0; i < names.size(); ++i) parser.DefineVar(names[i], &values[i]);
    parser.SetExpr(ForParser(text));
    int results = 0;
    parser.Eval(results);
    if (results != 1) return {.message = "the formula gives more than one number", .position = 1};
  } catch (const mu::Parser::exception_type& error) {
    const std::string token = AsWritten(error.GetToken());
    return {.message = token.empty() ? "the formula cannot be read"
                                     : "the formula cannot be read at '" + token + "'",
            .position = static_cast<int>(error.GetPos()) + 1};
  }
  return {};
}

Formula::Formula(const std::string& text, const std::vector<std::string>& names) {
  std::vector<std::string> mentioned;
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t at = text.find(names[i]); at != std::string::npos;
         at = text.find(names[i], at + 1)) {
      const auto part_of_name = [&text](std::size_t k) {
        return k < text.size() &&
               (std::isalnum(static_cast<unsigned char>(text[k])) != 0 || text[k] == '_');
      };
      if (!(at > 0 && part_of_name(at - 1)) && !part_of_name(at + names[i].size())) {
        used_.push_back(static_cast<int>(i));
        mentioned.push_back(names[i]);
        break;
      }
    }
  }
  pool_ = std::make_shared<Pool>(text, mentioned);
}

void Formula::Evaluate(const double* rows, int count, double* results) const {
  const std::size_t width = used_.size();
  try {
    auto evaluator = pool_->Take();
    for (int k = 0; k < count; ++k) {
      std::copy_n(rows + static_cast<std::size_t>(k) * width, width, evaluator->values.begin());
      results[k] = evaluator->parser.Eval();
    }
    pool_->Give(std::move(evaluator));
  } catch (const mu::Parser::exception_type&) {  // none is known once Check() is content
    std::fill_n(results, count, std::numeric_limits<double>::quiet_NaN());
  }
}

}  // namespace calib::dem
