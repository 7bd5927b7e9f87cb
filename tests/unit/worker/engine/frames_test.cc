#include "worker/engine/frames.h"

#include <gtest/gtest.h>

#include "calib/v1/common.pb.h"

namespace calib::worker {
namespace {

v1::State StateOf(int load_step) {
  v1::State state;
  state.set_load_step(load_step);
  state.add_values(0.1 * load_step);
  return state;
}

TEST(Frames, MessagesComeWholeHoweverTheirBytesCome) {
  std::string bytes;
  for (int i = 0; i < 5; ++i) bytes += Framed(StateOf(i));
  for (const std::size_t piece : {std::size_t{1}, std::size_t{7}, bytes.size()}) {
    FrameReader reader;
    int next = 0;
    for (std::size_t i = 0; i < bytes.size(); i += piece) {
      reader.Add(std::string_view(bytes).substr(i, piece));
      for (v1::State state; reader.Next(state); ++next) {
        EXPECT_EQ(state.SerializeAsString(), StateOf(next).SerializeAsString());
      }
    }
    EXPECT_EQ(next, 5) << piece;
    EXPECT_FALSE(reader.broken());
  }
}

TEST(Frames, AnEmptyMessageIsOne) {
  FrameReader reader;
  reader.Add(Framed(v1::State()));
  v1::State state;
  EXPECT_TRUE(reader.Next(state));
  EXPECT_FALSE(reader.Next(state));
}

TEST(Frames, WhatIsNoMessageEndsTheReading) {
  for (const std::string& bytes : {std::string("\xff\xff\xff\xff", 4),             // too long
                                   std::string("\x02\x00\x00\x00\xff\xff", 6)}) {  // no State
    FrameReader reader;
    reader.Add(bytes);
    v1::State state;
    EXPECT_FALSE(reader.Next(state));
    EXPECT_TRUE(reader.broken());
    reader.Add(Framed(StateOf(1)));
    EXPECT_FALSE(reader.Next(state));
  }
}

}  // namespace
}  // namespace calib::worker
