#pragma once
// Messages that break one rule of their fields each (calib/v1/rules.proto), and their nearest valid
// neighbours.

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <functional>
#include <memory>
#include <string>

namespace calib::testing {

struct Trial {
  const google::protobuf::FieldDescriptor* field = nullptr;  ///< whose rule is tried
  std::string what{};                                        ///< in words
  bool is_broken = false;                                    ///< else it is kept, if only just
  std::unique_ptr<google::protobuf::Message> message{};
};

/// A message of calib.v1 that keeps all rules, with what is required and nothing else.
std::unique_ptr<google::protobuf::Message> GoodMessage(const google::protobuf::Descriptor& type);

/// Every rule of every field of a message of calib.v1, not of the messages that it holds.
void ForEveryTrial(const google::protobuf::Descriptor& type,
                   const std::function<void(const Trial&)>& visit);

/// The same of the messages that it holds as well, each inside a message of this type.
void ForEveryTrialInside(const google::protobuf::Descriptor& type,
                         const std::function<void(const Trial&)>& visit);

}  // namespace calib::testing
