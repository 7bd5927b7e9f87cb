#pragma once
// Whether a text is UTF-8.

#include <cstddef>
#include <string>

namespace calib::campaign {

/// Position of the first byte at which a text is not UTF-8; npos: it is. Messages carry UTF-8 only.
std::size_t FirstByteThatIsNoUtf8(const std::string& text);

}  // namespace calib::campaign
