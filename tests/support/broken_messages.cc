#include "tests/support/broken_messages.h"

#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/reflection.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "calib/v1/rules.pb.h"

namespace calib::testing {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

std::unique_ptr<Message> Make(const Descriptor& type) {
  return std::unique_ptr<Message>(
      google::protobuf::MessageFactory::generated_factory()->GetPrototype(&type)->New());
}

const v1::Rule& RuleOf(const FieldDescriptor& field) {
  return field.options().GetExtension(v1::rule);
}

std::size_t Longest(v1::Text text) {
  return v1::Text_descriptor()->FindValueByNumber(text)->options().GetExtension(v1::bytes);
}

std::string GoodText(v1::Text text) {
  return text == v1::DIGEST ? std::string(64, 'a') : std::string(Longest(text), 'a');
}

void SetNumber(Message& message, const FieldDescriptor& field, double value) {
  const Reflection& r = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      field.is_repeated() ? r.AddDouble(&message, &field, value)
                          : r.SetDouble(&message, &field, value);
      break;
    case FieldDescriptor::CPPTYPE_INT32:
      field.is_repeated() ? r.AddInt32(&message, &field, static_cast<std::int32_t>(value))
                          : r.SetInt32(&message, &field, static_cast<std::int32_t>(value));
      break;
    case FieldDescriptor::CPPTYPE_INT64:
      field.is_repeated() ? r.AddInt64(&message, &field, static_cast<std::int64_t>(value))
                          : r.SetInt64(&message, &field, static_cast<std::int64_t>(value));
      break;
    default:
      r.SetUInt64(&message, &field, static_cast<std::uint64_t>(value));
  }
}

void SetText(Message& message, const FieldDescriptor& field, const std::string& value) {
  const Reflection& r = *message.GetReflection();
  field.is_repeated() ? r.AddString(&message, &field, value) : r.SetString(&message, &field, value);
}

void AddEntry(Message& message, const FieldDescriptor& field, const std::string& key) {
  Message* entry = message.GetReflection()->AddMessage(&message, &field);
  entry->GetReflection()->SetString(entry, field.message_type()->map_key(), key);
  const FieldDescriptor* value = field.message_type()->map_value();
  if (value->cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
    entry->GetReflection()->SetString(entry, value, GoodText(RuleOf(field).text()));
  } else {
    entry->GetReflection()->SetDouble(entry, value, RuleOf(field).min());
  }
}

}  // namespace

std::unique_ptr<Message> GoodMessage(const Descriptor& type) {
  auto message = Make(type);
  for (int k = 0; k < type.field_count(); ++k) {
    const FieldDescriptor& field = *type.field(k);
    const v1::Rule& rule = RuleOf(field);
    if (field.is_repeated() || field.containing_oneof() != nullptr) continue;
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE && rule.required()) {
      message->GetReflection()
          ->MutableMessage(message.get(), &field)
          ->CopyFrom(*GoodMessage(*field.message_type()));
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING && rule.required()) {
      SetText(*message, field, GoodText(rule.text()));
    } else if (rule.has_min() && rule.min() > 0) {
      SetNumber(*message, field, rule.min());
    }
  }
  return message;
}

namespace {

/// Breaks and keeps the rules of one message's fields.
class Trials {
 public:
  explicit Trials(const std::function<void(const Trial&)>& visit) : visit_(visit) {}

  void Of(const Descriptor& type) {
    for (int k = 0; k < type.field_count(); ++k) {
      const FieldDescriptor& field = *type.field(k);
      if (field.is_repeated()) List(field);
      if (!field.is_map()) Value(field);
    }
  }

 private:
  /// `change` makes a good message a broken one, or leaves it good.
  void Try(const FieldDescriptor& field, bool is_broken, const char* what,
           const std::function<void(Message&)>& change) {
    Trial trial{.field = &field,
                .what = what,
                .is_broken = is_broken,
                .message = GoodMessage(*field.containing_type())};
    change(*trial.message);
    visit_(trial);
  }

  void Value(const FieldDescriptor& field) {
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
      case FieldDescriptor::CPPTYPE_INT32:
      case FieldDescriptor::CPPTYPE_INT64:
      case FieldDescriptor::CPPTYPE_UINT64:
        Number(field);
        break;
      case FieldDescriptor::CPPTYPE_STRING:
        OneText(field);
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        Try(field, true, "an unknown value",
            [&field](Message& m) { m.GetReflection()->SetEnumValue(&m, &field, 1000); });
        break;
      case FieldDescriptor::CPPTYPE_MESSAGE:
        if (RuleOf(field).required()) {
          Try(field, true, "missing",
              [&field](Message& m) { m.GetReflection()->ClearField(&m, &field); });
        }
        break;
      default:
        break;
    }
  }

  void Number(const FieldDescriptor& field) {
    const v1::Rule& rule = RuleOf(field);
    const bool whole = field.cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE;
    const auto set = [&field](double value) {
      return [&field, value](Message& m) { SetNumber(m, field, value); };
    };
    if (rule.has_min()) {
      Try(field, false, "at its least", set(rule.min()));
      if (field.cpp_type() != FieldDescriptor::CPPTYPE_UINT64) {
        Try(field, true, "below it",
            set(whole ? rule.min() - 1 : std::nextafter(rule.min(), -1e300)));
      }
    }
    if (rule.has_max()) {
      Try(field, false, "at its most", set(rule.max()));
      Try(field, true, "above it", set(whole ? rule.max() + 2 : std::nextafter(rule.max(), 1e300)));
    }
    if (!whole) {
      Try(field, !rule.may_be_nan(), "NaN", set(std::numeric_limits<double>::quiet_NaN()));
      Try(field, !rule.may_be_infinite(), "infinite", set(std::numeric_limits<double>::infinity()));
    }
  }

  void OneText(const FieldDescriptor& field) {
    const v1::Rule& rule = RuleOf(field);
    const auto set = [&field](const std::string& value) {
      return [&field, value](Message& m) { SetText(m, field, value); };
    };
    Try(field, false, "as long as it may be", set(GoodText(rule.text())));
    Try(field, true, "a byte longer", set(std::string(Longest(rule.text()) + 1, 'a')));
    Try(field, rule.required(), "empty", set(""));
    switch (rule.text()) {
      case v1::NAME:
      case v1::REQUEST:
      case v1::PATH:
        Try(field, true, "a line break in it", set("a\nb"));
        Try(field, false, "a blank in it", set("a b"));
        break;
      case v1::WORD:
        Try(field, true, "a capital in it", set("aB"));
        break;
      case v1::DIGEST:
        Try(field, true, "no hexadecimal digit", set(std::string(63, 'a') + "g"));
        Try(field, true, "too short", set(std::string(63, 'a')));
        break;
      default:
        break;
    }
  }

  void List(const FieldDescriptor& field) {
    const v1::Rule& rule = RuleOf(field);
    const auto fill = [&field, &rule](std::uint32_t entries) {
      return [&field, &rule, entries](Message& m) {
        const Reflection& r = *m.GetReflection();
        for (std::uint32_t k = 0; k < entries; ++k) {
          if (field.is_map()) {
            AddEntry(m, field, std::to_string(k));
          } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
            r.AddMessage(&m, &field)->CopyFrom(*GoodMessage(*field.message_type()));
          } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
            SetText(m, field, std::string(rule.text() == v1::DIGEST ? 64 : 1, 'a'));
          } else {
            SetNumber(m, field, rule.min());
          }
        }
      };
    };
    // Longer lists differ in nothing but the time that they take.
    if (constexpr std::uint32_t kTried = 65536; rule.most() <= kTried) {
      Try(field, false, "as many as may be", fill(rule.most()));
      Try(field, true, "one more", fill(rule.most() + 1));
    }
    if (field.is_map()) {
      Try(field, true, "a key without a name", [&](Message& m) { AddEntry(m, field, ""); });
      Try(field, true, "a key too long",
          [&](Message& m) { AddEntry(m, field, std::string(Longest(rule.key()) + 1, 'a')); });
    }
  }

  const std::function<void(const Trial&)>& visit_;
};

}  // namespace

void ForEveryTrial(const Descriptor& type, const std::function<void(const Trial&)>& visit) {
  Trials(visit).Of(type);
}

void ForEveryTrialInside(const Descriptor& type, const std::function<void(const Trial&)>& visit) {
  ForEveryTrial(type, visit);
  for (int k = 0; k < type.field_count(); ++k) {
    const FieldDescriptor& field = *type.field(k);
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE || field.is_map()) continue;
    ForEveryTrialInside(*field.message_type(), [&](const Trial& inner) {
      Trial outer{.field = inner.field,
                  .what = inner.what,
                  .is_broken = inner.is_broken,
                  .message = GoodMessage(type)};
      const Reflection& reflection = *outer.message->GetReflection();
      Message* place = field.is_repeated() ? reflection.AddMessage(outer.message.get(), &field)
                                           : reflection.MutableMessage(outer.message.get(), &field);
      place->CopyFrom(*inner.message);
      visit(outer);
    });
  }
}

}  // namespace calib::testing
