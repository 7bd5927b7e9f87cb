#include "server/campaign/file/text/utf8.h"

#include <boost/locale/utf.hpp>

namespace calib::campaign {

std::size_t FirstByteThatIsNoUtf8(const std::string& text) {
  namespace utf = boost::locale::utf;
  for (auto at = text.begin(); at != text.end();) {
    const auto from = at;
    const utf::code_point point = utf::utf_traits<char>::decode(at, text.end());
    if (point == utf::illegal || point == utf::incomplete) {
      return static_cast<std::size_t>(from - text.begin());
    }
  }
  return std::string::npos;
}

}  // namespace calib::campaign
