#include "worker/program/json_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::worker {
namespace {

constexpr int kDeepest = 200;  // arrays in arrays; keeps the recursion small

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

void AppendUtf8(unsigned code, std::string& text) {
  const auto add = [&text](unsigned byte) { text += static_cast<char>(byte); };
  if (code < 0x80) {
    add(code);
  } else if (code < 0x800) {
    add(0xc0U | code >> 6U);
    add(0x80U | (code & 0x3fU));
  } else if (code < 0x10000) {
    add(0xe0U | code >> 12U);
    add(0x80U | (code >> 6U & 0x3fU));
    add(0x80U | (code & 0x3fU));
  } else {
    add(0xf0U | code >> 18U);
    add(0x80U | (code >> 12U & 0x3fU));
    add(0x80U | (code >> 6U & 0x3fU));
    add(0x80U | (code & 0x3fU));
  }
}

/// A reader of one object. Functions return false where the text is no JSON; problem_ then says
/// what was expected.
class ObjectReader {
 public:
  explicit ObjectReader(std::string_view text) : text_(text) {}

  absl::StatusOr<std::vector<JsonMember>> Read() {
    std::vector<JsonMember> members;
    SkipSpace();
    bool good = Object(&members, 0);
    SkipSpace();
    if (good && at_ < text_.size()) good = Expected("the end of the line");
    if (!good) {
      return absl::InvalidArgumentError(
          absl::StrCat("expected ", problem_, " at column ", at_ + 1));
    }
    return members;
  }

 private:
  bool Expected(const char* what) {
    problem_ = what;
    return false;
  }
  char Next() const { return at_ < text_.size() ? text_[at_] : '\0'; }
  bool Take(char c) {
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool TakeWord(std::string_view word) {
    if (!text_.substr(at_).starts_with(word)) return false;
    at_ += word.size();
    return true;
  }
  void SkipSpace() {
    while (Next() == ' ' || Next() == '\t' || Next() == '\r' || Next() == '\n') ++at_;
  }

  // members: nullptr: of an object inside, whose members are dropped.
  bool Object(std::vector<JsonMember>* members, int depth) {
    if (!Take('{')) return Expected("'{'");
    SkipSpace();
    if (Take('}')) return true;
    do {
      SkipSpace();
      JsonMember member;
      if (!Text(member.name)) return false;
      SkipSpace();
      if (!Take(':')) return Expected("':'");
      if (!Value(member, depth)) return false;
      if (members != nullptr) members->push_back(std::move(member));
      SkipSpace();
    } while (Take(','));
    return Take('}') || Expected("',' or '}'");
  }

  bool Array(int depth) {
    Take('[');
    SkipSpace();
    if (Take(']')) return true;
    do {
      JsonMember dropped;
      if (!Value(dropped, depth)) return false;
      SkipSpace();
    } while (Take(','));
    return Take(']') || Expected("',' or ']'");
  }

  bool Value(JsonMember& member, int depth) {
    using Kind = JsonMember::Kind;
    SkipSpace();
    switch (Next()) {
      case '"':
        member.kind = Kind::kText;
        return Text(member.text);
      case '{':
      case '[':
        member.kind = Kind::kInside;
        if (depth == kDeepest) return Expected("fewer arrays and objects in each other");
        return Next() == '{' ? Object(nullptr, depth + 1) : Array(depth + 1);
      case 't':
        member.kind = Kind::kTrue;
        return TakeWord("true") || Expected("a value");
      case 'f':
        member.kind = Kind::kFalse;
        return TakeWord("false") || Expected("a value");
      case 'n':
        member.kind = Kind::kNull;
        return TakeWord("null") || Expected("a value");
      default:
        member.kind = Kind::kNumber;
        return Number(member.number);
    }
  }

  bool Number(double& number) {
    const std::size_t begin = at_;
    if (TakeWord("NaN")) {
      number = std::numeric_limits<double>::quiet_NaN();
      return true;
    }
    const bool negative = Take('-');
    if (TakeWord("Infinity")) {
      number = std::numeric_limits<double>::infinity() * (negative ? -1 : 1);
      return true;
    }
    if (!IsDigit(Next())) return Expected("a value");
    if (!Take('0')) SkipDigits();
    if (Take('.')) {
      if (!IsDigit(Next())) return Expected("a digit");
      SkipDigits();
    }
    if (Take('e') || Take('E')) {
      if (!Take('-')) Take('+');
      if (!IsDigit(Next())) return Expected("a digit");
      SkipDigits();
    }
    const auto read = ReadDecimal(text_.substr(begin, at_ - begin));
    number = read.value_or(std::numeric_limits<double>::quiet_NaN());
    return read.has_value() || Expected("a number");
  }

  void SkipDigits() {
    while (IsDigit(Next())) ++at_;
  }

  bool Text(std::string& text) {
    if (!Take('"')) return Expected("'\"'");
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '"') {
        ++at_;
        return true;
      }
      if (static_cast<unsigned char>(c) < 0x20) return Expected("no control character in a text");
      if (c == '\\') {
        if (!Escape(text)) return Expected("an escape as \\n or \\u0041");
      } else {
        text += c;
        ++at_;
      }
    }
    return Expected("'\"'");
  }

  bool Escape(std::string& text) {
    ++at_;
    const char c = Next();
    constexpr std::string_view kNames = "\"\\/bfnrt";
    constexpr std::string_view kMeant = "\"\\/\b\f\n\r\t";
    if (const std::size_t known = kNames.find(c); known != std::string_view::npos) {
      text += kMeant[known];
      ++at_;
      return true;
    }
    if (!Take('u')) return false;
    auto code = Hex4();
    if (!code.has_value()) return false;
    constexpr unsigned kReplacement = 0xfffd;  // of half a pair
    if (*code >= 0xd800 && *code < 0xdc00) {
      const std::size_t behind = at_;
      const auto low = TakeWord("\\u") ? Hex4() : std::nullopt;
      if (low.has_value() && *low >= 0xdc00 && *low < 0xe000) {
        code = 0x10000U + ((*code - 0xd800U) << 10U) + (*low - 0xdc00U);
      } else {
        at_ = behind;
        code = kReplacement;
      }
    } else if (*code >= 0xdc00 && *code < 0xe000) {
      code = kReplacement;
    }
    AppendUtf8(*code, text);
    return true;
  }

  std::optional<unsigned> Hex4() {
    unsigned code = 0;
    const std::string_view digits = text_.substr(at_, 4);
    const auto [end, error] =
        std::from_chars(digits.data(), digits.data() + digits.size(), code, 16);
    if (digits.size() < 4 || error != std::errc() || end != digits.data() + 4) return std::nullopt;
    at_ += 4;
    return code;
  }

  std::string_view text_;
  std::size_t at_ = 0;
  const char* problem_ = "";
};

/// Whether a decimal number whose value is out of range is too large; else it is too small.
bool IsTooLarge(std::string_view text) {
  // The power of ten of its first digit that is not zero.
  const std::size_t exponent_at = std::min(text.find_first_of("eE"), text.size());
  const std::string_view mantissa = text.substr(0, exponent_at);
  const std::size_t first = mantissa.find_first_of("123456789");
  if (first == std::string_view::npos) return false;
  const std::size_t point = std::min(mantissa.find('.'), mantissa.size());
  const auto places = static_cast<std::int64_t>(point) - static_cast<std::int64_t>(first);
  std::int64_t exponent = 0;
  bool negative = false;
  for (std::size_t k = exponent_at + 1; k < text.size(); ++k) {
    if (text[k] == '-') negative = true;
    if (IsDigit(text[k])) exponent = std::min(exponent * 10 + (text[k] - '0'), INT64_C(1) << 40);
  }
  return places + (negative ? -exponent : exponent) > 0;
}

}  // namespace

absl::StatusOr<std::vector<JsonMember>> ReadJsonObject(std::string_view text) {
  return ObjectReader(text).Read();
}

std::optional<double> ReadDecimal(std::string_view text) {
  const bool negative = text.starts_with('-');
  const std::string_view digits = text.substr(negative ? 1 : 0);
  // from_chars reads "inf" and "nan" as well.
  if (digits.empty() || !(IsDigit(digits[0]) || digits[0] == '.')) return std::nullopt;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size() || error == std::errc::invalid_argument) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    value = IsTooLarge(text) ? std::numeric_limits<double>::infinity() : 0;
    return negative ? -value : value;
  }
  return value;
}

std::string NumberText(double value) {
  constexpr double kLargestPlain = 1e15;
  if (value == 0 && std::signbit(value)) return "-0.0";  // "-0" is a whole number to Python
  std::array<char, 64> buffer{};
  const bool plain = std::abs(value) < kLargestPlain && value == std::trunc(value);
  const auto result = plain ? std::to_chars(buffer.data(), buffer.data() + buffer.size(),
                                            static_cast<std::int64_t>(value))
                            : std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

std::string QuotedJson(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      absl::StrAppend(&quoted, "\\u", absl::Hex(byte, absl::kZeroPad4));
    } else {
      quoted += c;
    }
  }
  return quoted += '"';
}

}  // namespace calib::worker
