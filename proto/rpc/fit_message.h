#pragma once
// What a program is about to send, made to keep the rules of its texts: reasons of a model and
// names of a user's file are of any length.

#include <google/protobuf/message.h>

namespace calib::rpc {

/// Cuts texts and lists of texts to what their rules allow (text_kinds.h: Fitted); everything else
/// is left alone. Messages of calib.v1 only. Thread-safe for messages of one's own.
void FitTexts(google::protobuf::Message& message);

}  // namespace calib::rpc
