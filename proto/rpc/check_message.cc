#include "proto/rpc/check_message.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/map_field.h>
#include <google/protobuf/reflection.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "calib/v1/campaign.pb.h"
#include "calib/v1/common.pb.h"
#include "calib/v1/rules.pb.h"
#include "calib/v1/worker.pb.h"
#include "proto/rpc/text_kinds.h"

namespace calib::rpc {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

/// How much of a text is shown in a sentence [bytes]. Chosen: a name, not a document.
constexpr std::size_t kShown = 40;

/// How a field is reached. A message has hundreds of them: the text is put together only where a
/// sentence needs it.
struct Place {
  const Place* parent = nullptr;
  std::string_view name;
  int index = -1;  ///< in a list

  [[nodiscard]] std::string Text() const {
    std::string text = parent == nullptr ? std::string(name)
                                         : absl::StrCat(parent->Text(), ".", std::string(name));
    if (index >= 0) absl::StrAppend(&text, "[", index, "]");
    return text;
  }
};

// path: gives the text of a place.
template <class Path>
absl::Status CheckText(const Path& path, v1::Text text, bool required, const std::string& value) {
  if (value.empty()) {
    return required ? absl::InvalidArgumentError(absl::StrCat(path(), " is empty"))
                    : absl::OkStatus();
  }
  if (value.size() > LongestOf(text)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path(), " has ", value.size(), " bytes, at most ", LongestOf(text)));
  }
  if (!HasForm(text, value)) {
    return absl::InvalidArgumentError(absl::StrCat(path(), " is \"",
                                                   absl::CHexEscape(value.substr(0, kShown)),
                                                   "\", it has to be ", FormOf(text)));
  }
  return absl::OkStatus();
}

template <class Path, class Number>
absl::Status CheckNumber(const Path& path, const v1::Rule& rule, Number value) {
  const auto number = static_cast<double>(value);
  const bool good = std::isnan(number)   ? rule.may_be_nan()
                    : std::isinf(number) ? rule.may_be_infinite()
                                         : (!rule.has_min() || number >= rule.min()) &&
                                               (!rule.has_max() || number <= rule.max());
  if (good) {
    return absl::OkStatus();
  }
  std::vector<std::string> allowed;
  if (!std::isfinite(number)) allowed.emplace_back("finite");
  if (rule.has_min()) allowed.push_back(absl::StrCat("at least ", rule.min()));
  if (rule.has_max()) allowed.push_back(absl::StrCat("at most ", rule.max()));
  return absl::InvalidArgumentError(
      absl::StrCat(path(), " is ", value, ", it has to be ", absl::StrJoin(allowed, " and ")));
}

/// One message with the path that leads to it.
class Check {
 public:
  static absl::Status Of(const Message& message, const Place& place) {
    const Descriptor& type = *message.GetDescriptor();
    for (int k = 0; k < type.field_count(); ++k) {
      RETURN_IF_ERROR(Check(message, *type.field(k), place).Field());
    }
    return absl::OkStatus();
  }

 private:
  Check(const Message& message, const FieldDescriptor& field, const Place& parent)
      : message_(message),
        reflection_(*message.GetReflection()),
        field_(field),
        rule_(field.options().GetExtension(v1::rule)),
        parent_(parent) {}

  [[nodiscard]] Place Here(int k = -1) const {
    return {.parent = &parent_, .name = field_.name(), .index = k};
  }
  [[nodiscard]] std::string Path() const { return Here().Text(); }
  /// Path(), or that of an entry of a list, for CheckText() and CheckNumber().
  [[nodiscard]] auto PathOf(int k = -1) const {
    return [this, k] { return Here(k).Text(); };
  }

  absl::Status Field() const {
    if (field_.is_repeated()) {
      return List();
    }
    if (field_.has_presence() && !reflection_.HasField(message_, &field_)) {
      return rule_.required() && field_.containing_oneof() == nullptr
                 ? absl::InvalidArgumentError(absl::StrCat(Path(), " is missing"))
                 : absl::OkStatus();
    }
    switch (field_.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return CheckNumber(PathOf(), rule_, reflection_.GetDouble(message_, &field_));
      case FieldDescriptor::CPPTYPE_INT32:
        return CheckNumber(PathOf(), rule_, reflection_.GetInt32(message_, &field_));
      case FieldDescriptor::CPPTYPE_INT64:
        return CheckNumber(PathOf(), rule_, reflection_.GetInt64(message_, &field_));
      case FieldDescriptor::CPPTYPE_UINT64:
        return CheckNumber(PathOf(), rule_, reflection_.GetUInt64(message_, &field_));
      case FieldDescriptor::CPPTYPE_STRING: {
        std::string scratch;
        return CheckText(PathOf(), rule_.text(), rule_.required(),
                         reflection_.GetStringReference(message_, &field_, &scratch));
      }
      case FieldDescriptor::CPPTYPE_ENUM: {
        const int value = reflection_.GetEnumValue(message_, &field_);
        return field_.enum_type()->FindValueByNumber(value) != nullptr
                   ? absl::OkStatus()
                   : absl::InvalidArgumentError(
                         absl::StrCat(Path(), " is ", value, ", which is no ",
                                      std::string(field_.enum_type()->name())));
      }
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return Of(reflection_.GetMessage(message_, &field_), Here());
      default:  // a truth value; ProblemsOfRules() has no other type pass
        return absl::OkStatus();
    }
  }

  absl::Status List() const {
    const int size = reflection_.FieldSize(message_, &field_);
    if (static_cast<std::uint32_t>(size) > rule_.most()) {
      return absl::InvalidArgumentError(
          absl::StrCat(Path(), " has ", size, " entries, at most ", rule_.most()));
    }
    switch (field_.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return Numbers<double>();
      case FieldDescriptor::CPPTYPE_INT32:
        return Numbers<std::int32_t>();
      case FieldDescriptor::CPPTYPE_INT64:
        return Numbers<std::int64_t>();
      case FieldDescriptor::CPPTYPE_STRING:
        for (int k = 0; k < size; ++k) {
          std::string scratch;
          RETURN_IF_ERROR(
              CheckText(PathOf(k), rule_.text(), rule_.required(),
                        reflection_.GetRepeatedStringReference(message_, &field_, k, &scratch)));
        }
        return absl::OkStatus();
      default:
        for (int k = 0; k < size; ++k) {
          const Message& entry = reflection_.GetRepeatedMessage(message_, &field_, k);
          RETURN_IF_ERROR(field_.is_map() ? Entry(entry) : Of(entry, Here(k)));
        }
        return absl::OkStatus();
    }
  }

  template <class Number>
  absl::Status Numbers() const {
    const auto numbers = reflection_.GetRepeatedFieldRef<Number>(message_, &field_);
    int k = 0;
    for (const Number number : numbers) {
      RETURN_IF_ERROR(CheckNumber(PathOf(k), rule_, number));
      ++k;
    }
    return absl::OkStatus();
  }

  /// Of a map: the key's rule and the value's stand beside the map.
  absl::Status Entry(const Message& entry) const {
    const Reflection& reflection = *entry.GetReflection();
    const FieldDescriptor& key = *field_.message_type()->map_key();
    const FieldDescriptor& value = *field_.message_type()->map_value();
    const std::string name = reflection.GetString(entry, &key);
    RETURN_IF_ERROR(
        CheckText([this] { return absl::StrCat("a key of ", Path()); }, rule_.key(), true, name));
    const auto path = [&] { return absl::StrCat(Path(), "[", name, "]"); };
    return value.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE
               ? CheckNumber(path, rule_, reflection.GetDouble(entry, &value))
               : CheckText(path, rule_.text(), rule_.required(),
                           reflection.GetString(entry, &value));
  }

  const Message& message_;
  const Reflection& reflection_;
  const FieldDescriptor& field_;
  const v1::Rule& rule_;
  const Place& parent_;
};

bool IsText(const FieldDescriptor& field) {
  return field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
}

bool IsNumber(const FieldDescriptor& field) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
    case FieldDescriptor::CPPTYPE_INT32:
    case FieldDescriptor::CPPTYPE_INT64:
    case FieldDescriptor::CPPTYPE_UINT64:
      return true;
    default:
      return false;
  }
}

void AddProblems(const Descriptor& type, std::vector<std::string>& problems) {
  for (int k = 0; k < type.field_count(); ++k) {
    const FieldDescriptor& field = *type.field(k);
    const auto say = [&](const char* what) {
      problems.push_back(absl::StrCat(std::string(field.full_name()), ": ", what));
    };
    const FieldDescriptor& of = field.is_map() ? *field.message_type()->map_value() : field;
    const v1::Rule& rule = field.options().GetExtension(v1::rule);
    const bool checked = IsText(of) || IsNumber(of) ||
                         of.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE ||
                         of.cpp_type() == FieldDescriptor::CPPTYPE_ENUM ||
                         of.cpp_type() == FieldDescriptor::CPPTYPE_BOOL;
    if (!checked) say("no rule is known for fields of this type");
    if ((IsText(of) || IsNumber(of) || field.is_repeated()) &&
        !field.options().HasExtension(v1::rule)) {
      say("has no rule");
      continue;
    }
    if (IsText(of) != (rule.text() != v1::TEXT_UNSPECIFIED)) say("text and its kind go together");
    if (field.is_map() != (rule.key() != v1::TEXT_UNSPECIFIED)) say("key is for maps");
    if (field.is_repeated() != (rule.most() > 0)) say("most is for lists and maps");
    if ((rule.has_min() || rule.has_max() || rule.may_be_nan() || rule.may_be_infinite()) &&
        !IsNumber(of)) {
      say("a range is for numbers");
    }
  }
  for (int k = 0; k < type.nested_type_count(); ++k) {
    if (!type.nested_type(k)->options().map_entry()) AddProblems(*type.nested_type(k), problems);
  }
}

}  // namespace

absl::Status CheckMessage(const Message& message) {
  return Check::Of(message, {.name = message.GetDescriptor()->name()});
}

std::vector<std::string> ProblemsOfRules() {
  std::vector<std::string> problems;
  for (const google::protobuf::FileDescriptor* file :
       {v1::Problem::descriptor()->file(), v1::WorkerMessage::descriptor()->file(),
        v1::SubmitRequest::descriptor()->file()}) {
    for (int k = 0; k < file->message_type_count(); ++k) {
      AddProblems(*file->message_type(k), problems);
    }
  }
  return problems;
}

}  // namespace calib::rpc
