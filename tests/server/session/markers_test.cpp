#include "server/session/markers.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using Answer = Markers::Answer;

TEST(Markers, OneClientAndAllTogetherHaveTheirShareOfASecond) {
  Markers markers;
  scene::ClientId client = 1;
  for (; client <= Markers::kMost / Markers::kMostOfOne; ++client) {
    for (int i = 0; i < Markers::kMostOfOne; ++i) EXPECT_EQ(markers.count(client), Answer::taken);
    EXPECT_EQ(markers.count(client), Answer::tooManyOfClient);
  }
  EXPECT_EQ(markers.count(client), Answer::tooManyOfAll);
  markers.nextSecond();
  EXPECT_EQ(markers.count(client), Answer::taken);
  EXPECT_EQ(markers.count(1), Answer::taken);
}

TEST(Markers, APassHasThoseBeforeItEncodedOnceForEachName) {
  Markers markers;
  EXPECT_TRUE(markers.add(5, "a"));
  EXPECT_TRUE(markers.add(6, "b"));
  EXPECT_FALSE(markers.passing());
  markers.beginPass();
  EXPECT_TRUE(markers.add(7, "in the next pass"));
  const auto frames = markers.frames({1}, {});
  EXPECT_EQ(markers.frames({1}, {}), frames);
  EXPECT_NE(markers.frames({2}, {}), frames);
  wire::FrameReader reader(*frames);
  std::vector<std::string> texts;
  for (wire::FrameView frame; reader.next(frame);)
    texts.push_back(wire::decode<wire::Marker>(frame.payload)->text.text);
  EXPECT_EQ(texts, (std::vector<std::string>{"a", "b"}));
  markers.beginPass();
  EXPECT_TRUE(markers.passing());
  markers.beginPass();
  EXPECT_FALSE(markers.passing());
}

// A recording may have any number of them at one time.
TEST(Markers, ThoseThatWaitAreBounded) {
  Markers markers;
  for (int i = 0; i < Markers::kMost; ++i) EXPECT_TRUE(markers.add(i, "x"));
  EXPECT_FALSE(markers.add(0, "x"));
  markers.beginPass();
  EXPECT_TRUE(markers.add(0, "x"));
}

}  // namespace
}  // namespace hapticd::server
