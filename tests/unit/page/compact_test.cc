#include "server/page/compact.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <nlohmann/json.hpp>

namespace calib::page {
namespace {

TEST(Compact, KeepsEveryValueAndNoWhiteSpaceBetween) {
  const nlohmann::ordered_json json = {{"a b", "two  words\n \"and\\\" \\"},
                                       {"empty", nlohmann::json::array()},
                                       {"numbers", {1.5, -2e-30, nullptr}},
                                       {"text", "<script>\t\\\\"}};
  EXPECT_EQ(Compact(json.dump(2) + "\n"), json.dump());
  EXPECT_EQ(Compact(""), "");
  EXPECT_EQ(Compact("\"broken\\"), "\"broken\\") << "whatever it is, it ends";
}

TEST(Gzip, IsTheContentAgain) {
  std::string content;
  for (int i = 0; i < 10000; ++i) content += std::to_string(i * i) + ",";
  const std::string compressed = Gzip(content);
  ASSERT_FALSE(compressed.empty());
  EXPECT_LT(compressed.size(), content.size() / 2);
  std::string again(content.size() + 1, '\0');
  z_stream stream{};
  ASSERT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(compressed.data()));
  stream.avail_in = static_cast<uInt>(compressed.size());
  stream.next_out = reinterpret_cast<Bytef*>(again.data());
  stream.avail_out = static_cast<uInt>(again.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  again.resize(stream.total_out);
  inflateEnd(&stream);
  EXPECT_EQ(again, content);
  EXPECT_EQ(Gzip("short"), "") << "no shorter";
}

TEST(Gzip, IsTakenByWhoSaysSo) {
  for (const char* header : {"gzip", "deflate, gzip;q=0.5", "br, GZIP ,x"}) {
    EXPECT_TRUE(TakesGzip(header)) << header;
  }
  for (const char* header : {"", "br", "gzip;q=0", "xgzip", "gzip2"}) {
    EXPECT_FALSE(TakesGzip(header)) << header;
  }
}

}  // namespace
}  // namespace calib::page
