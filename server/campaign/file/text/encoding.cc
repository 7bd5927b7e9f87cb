#include "server/campaign/file/text/encoding.h"

#include <algorithm>
#include <boost/locale/utf.hpp>
#include <iterator>
#include <string_view>

#include "server/campaign/file/text/utf8.h"

namespace calib::campaign {
namespace {

// Bytes looked at to tell UTF-16 without a byte order mark. Chosen: a header and some rows.
constexpr std::size_t kLooked = 4096;
// Share of zeros among the high bytes of such a text. Chosen: tables are digits and Latin letters,
// whose high byte is zero; a few others stand in headers.
constexpr double kMostlyZero = 0.9;

void AppendUtf8(boost::locale::utf::code_point point, std::string& text) {
  namespace utf = boost::locale::utf;
  utf::utf_traits<char>::encode(point, std::back_inserter(text));
}

std::string FromUtf16(std::string_view bytes, bool little_endian) {
  namespace utf = boost::locale::utf;
  std::u16string units;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto first = static_cast<unsigned char>(bytes[i]);
    const auto second = static_cast<unsigned char>(bytes[i + 1]);
    units.push_back(
        static_cast<char16_t>(little_endian ? first | second << 8 : first << 8 | second));
  }
  std::string text;
  for (auto at = units.begin(); at != units.end();) {
    const utf::code_point point = utf::utf_traits<char16_t>::decode(at, units.end());
    constexpr utf::code_point kReplacement = 0xFFFD;
    AppendUtf8(point == utf::illegal || point == utf::incomplete ? kReplacement : point, text);
  }
  return text;
}

std::string FromLatin1(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) AppendUtf8(static_cast<unsigned char>(byte), text);
  return text;
}

// Share of zero bytes among every second one from `first` on.
double ShareOfZeros(std::string_view bytes, std::size_t first) {
  const std::string_view looked = bytes.substr(0, kLooked);
  std::size_t zeros = 0;
  std::size_t all = 0;
  for (std::size_t i = first; i < looked.size(); i += 2, ++all) zeros += looked[i] == '\0' ? 1 : 0;
  return all > 0 ? static_cast<double>(zeros) / static_cast<double>(all) : 0;
}

std::string WithPlainLineEnds(const std::string& text) {
  std::string plain;
  plain.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\r') {
      plain.push_back(text[i]);
    } else if (i + 1 == text.size() || text[i + 1] != '\n') {
      plain.push_back('\n');
    }
  }
  return plain;
}

DecodedText Decode(std::string_view bytes) {
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  if (bytes.starts_with("\xFF\xFE")) return {FromUtf16(bytes.substr(2), true), "UTF-16 LE", ""};
  if (bytes.starts_with("\xFE\xFF")) return {FromUtf16(bytes.substr(2), false), "UTF-16 BE", ""};
  if (bytes.starts_with("PK\x03\x04") || bytes.starts_with("\xD0\xCF\x11\xE0")) {
    return {"", "", "is a workbook or an archive, not a text: name it .xlsx if it is one, or save its sheet as CSV"};
  }
  if (bytes.find('\0') != std::string_view::npos) {
    if (ShareOfZeros(bytes, 1) > kMostlyZero) return {FromUtf16(bytes, true), "UTF-16 LE", ""};
    if (ShareOfZeros(bytes, 0) > kMostlyZero) return {FromUtf16(bytes, false), "UTF-16 BE", ""};
    return {"", "", "holds zero bytes, as no text does: save the table as text, in UTF-8"};
  }
  const std::string text(bytes);
  if (FirstByteThatIsNoUtf8(text) == std::string::npos) return {text, "UTF-8", ""};
  return {FromLatin1(bytes), "Latin-1", ""};
}

}  // namespace

DecodedText DecodeText(const std::string& bytes) {
  DecodedText decoded = Decode(bytes);
  decoded.text = WithPlainLineEnds(decoded.text);
  return decoded;
}

}  // namespace calib::campaign
