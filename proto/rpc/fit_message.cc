#include "proto/rpc/fit_message.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/reflection.h>

#include "calib/v1/rules.pb.h"
#include "proto/rpc/text_kinds.h"

namespace calib::rpc {
namespace {

using google::protobuf::FieldDescriptor;

void FitList(google::protobuf::Message& message, const FieldDescriptor& field) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  const v1::Rule& rule = field.options().GetExtension(v1::rule);
  while (reflection.FieldSize(message, &field) > static_cast<int>(rule.most())) {
    reflection.RemoveLast(&message, &field);
  }
  for (int k = 0; k < reflection.FieldSize(message, &field); ++k) {
    reflection.SetRepeatedString(
        &message, &field, k, Fitted(rule.text(), reflection.GetRepeatedString(message, &field, k)));
  }
}

}  // namespace

void FitTexts(google::protobuf::Message& message) {
  const google::protobuf::Descriptor& type = *message.GetDescriptor();
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  for (int k = 0; k < type.field_count(); ++k) {
    const FieldDescriptor& field = *type.field(k);
    const bool is_text = field.type() == FieldDescriptor::TYPE_STRING;
    const bool is_message = field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    if (field.is_map() || (!is_text && !is_message)) {
      continue;
    }
    if (is_text && field.is_repeated()) {
      FitList(message, field);
    } else if (is_text && (!field.has_presence() || reflection.HasField(message, &field))) {
      const v1::Rule& rule = field.options().GetExtension(v1::rule);
      const std::string text = reflection.GetString(message, &field);
      if (std::string fitted = Fitted(rule.text(), text); fitted != text) {
        reflection.SetString(&message, &field, std::move(fitted));
      }
    } else if (is_message && field.is_repeated()) {
      for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
        FitTexts(*reflection.MutableRepeatedMessage(&message, &field, i));
      }
    } else if (is_message && reflection.HasField(message, &field)) {
      FitTexts(*reflection.MutableMessage(&message, &field));
    }
  }
}

}  // namespace calib::rpc
