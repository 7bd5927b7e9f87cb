#pragma once
// The kinds of text that fields of calib.v1 hold (calib/v1/rules.proto).

#include <cstddef>
#include <string>

#include "calib/v1/rules.pb.h"

namespace calib::rpc {

/// Bytes at most.
std::size_t LongestOf(v1::Text kind);

/// Whether a text has the form of its kind; its length is not asked.
bool HasForm(v1::Text kind, const std::string& text);
/// That form in words; "" where any will do.
const char* FormOf(v1::Text kind);

/// The text as its kind allows it: UTF-8 with '?' in place of what is none and of characters that
/// the kind has not, cut between two characters, "..." where it was cut. A digest is left alone.
std::string Fitted(v1::Text kind, const std::string& text);

}  // namespace calib::rpc
