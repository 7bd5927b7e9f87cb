#pragma once
// Documents on their way to a browser.

#include <string>
#include <string_view>

namespace calib::page {

/// A JSON document without the white space between its words. Pure.
std::string Compact(std::string_view json);

/// gzip [RFC 1952]; empty where it is no shorter. Pure.
std::string Gzip(std::string_view content);

/// Whether an Accept-Encoding header takes gzip.
bool TakesGzip(std::string_view accept_encoding);

}  // namespace calib::page
