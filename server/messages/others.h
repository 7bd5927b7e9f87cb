#pragma once
// What a program tells of a load step beyond what it was asked for, as text.

#include <google/protobuf/map.h>

#include <map>
#include <string>

namespace calib::messages {

/// A JSON object with the names in order, numbers to the same bits; empty for none. A number that
/// is not finite is left out, for JSON has no word for it.
std::string OthersToText(const google::protobuf::Map<std::string, double>& others);

/// The numbers of such a text; what is none is passed over.
std::map<std::string, double> OthersFromText(const std::string& text);

}  // namespace calib::messages
