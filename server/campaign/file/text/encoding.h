#pragma once
// The bytes of a table as a text, whatever program wrote them.

#include <string>

namespace calib::campaign {

struct DecodedText {
  std::string text;      ///< UTF-8 without byte order mark, lines ended by '\n' alone
  std::string encoding;  ///< "UTF-8", "UTF-16 LE", "UTF-16 BE" or "Latin-1"
  std::string problem;   ///< the rest of a sentence about the file; empty: it is a text
};

/// UTF-8 and UTF-16 by their byte order mark; UTF-16 without one by the zero bytes of its digits;
/// what is not UTF-8 is Latin-1 (ISO 8859-1, which gives every byte a meaning). Lines may end as on
/// any system (LF, CRLF, CR). A workbook and what holds zero bytes are no texts. Pure.
DecodedText DecodeText(const std::string& bytes);

}  // namespace calib::campaign
