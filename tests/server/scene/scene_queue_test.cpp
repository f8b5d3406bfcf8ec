// Order and limits of the scene queue, for each client.
#include "server/scene/scene_queue.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

constexpr std::size_t kMiB = 1U << 20;

SceneParcel parcel(scene::ClientId client, std::size_t bytes) {
  SceneParcel parcel{.client = client, .tasks = {}, .bytes = bytes};
  parcel.tasks.push_back({client, scene::SceneCommand{scene::StartEffect{static_cast<std::int32_t>(bytes)}}});
  return parcel;
}

TEST(SceneQueueTest, ClientsTakeTurnsAndEachKeepsItsOrder) {
  SceneQueue queue;
  queue.push(parcel(1, 10));
  queue.push(parcel(1, 30));
  queue.push(parcel(1, 50));
  queue.push(parcel(2, 20));
  queue.push(parcel(2, 40));
  for (const std::size_t bytes : {10U, 20U, 30U, 40U, 50U}) EXPECT_EQ(queue.take()->bytes, bytes);
  EXPECT_FALSE(queue.take());
  EXPECT_TRUE(queue.empty());
}

TEST(SceneQueueTest, WhatComesLaterWaitsForAParcelBeforeOthers) {
  SceneQueue queue;
  const auto clear = [&](scene::ClientId client, std::size_t bytes) {
    SceneParcel last = parcel(client, bytes);
    last.beforeOthers = true;
    queue.push(std::move(last));
  };
  queue.push(parcel(1, 1));
  clear(1, 2);
  queue.push(parcel(2, 5));
  queue.push(parcel(0, 6));  // the server's own
  clear(2, 7);
  queue.push(parcel(3, 8));
  queue.pushFront(parcel(3, 9));
  for (const std::size_t bytes : {9U, 1U, 6U, 2U, 5U, 7U, 8U}) EXPECT_EQ(queue.take()->bytes, bytes);
  EXPECT_FALSE(queue.take());
  EXPECT_TRUE(queue.empty());
}

TEST(SceneQueueTest, AnUrgentParcelIsTakenFirst) {
  SceneQueue queue;
  queue.push(parcel(1, 10));
  queue.pushFront(parcel(2, 0));
  EXPECT_EQ(queue.take()->client, 2U);
}

TEST(SceneQueueTest, OnlyTheClientThatExceedsTheLimitIsFull) {
  SceneQueue queue;
  queue.push(parcel(1, 5 * kMiB));
  queue.push(parcel(2, 100));
  EXPECT_FALSE(queue.full(1));
  queue.push(parcel(1, 4 * kMiB));
  EXPECT_TRUE(queue.full(1));
  EXPECT_FALSE(queue.full(2));
  EXPECT_FALSE(queue.full(3));
}

TEST(SceneQueueTest, TakenBytesStayChargedUntilTheyAreApplied) {
  SceneQueue queue;
  queue.push(parcel(1, 9 * kMiB));
  ASSERT_TRUE(queue.take());
  EXPECT_TRUE(queue.full(1));
  EXPECT_TRUE(queue.done(1, 9 * kMiB, 5));
  EXPECT_FALSE(queue.full(1));
}

TEST(SceneQueueTest, AFullClientIsRelievedOnceWhenHalfOfTheLimitIsFree) {
  SceneQueue queue;
  for (int i = 0; i < 5; ++i) queue.push(parcel(1, 2 * kMiB));
  ASSERT_TRUE(queue.full(1));
  EXPECT_FALSE(queue.done(1, 2 * kMiB, 1));
  EXPECT_FALSE(queue.done(1, 2 * kMiB, 2));
  EXPECT_TRUE(queue.full(1)) << "below the limit, but not yet relieved";
  EXPECT_TRUE(queue.done(1, 2 * kMiB, 3));
  EXPECT_FALSE(queue.full(1));
  EXPECT_FALSE(queue.done(1, 2 * kMiB, 4)) << "relieved once";
}

TEST(SceneQueueTest, AClientIsPendingUntilItsLastEditIsPublished) {
  SceneQueue queue;
  EXPECT_FALSE(queue.pending(1));
  queue.push(parcel(1, 10));
  queue.push(parcel(2, 10));
  EXPECT_TRUE(queue.pending(1));
  queue.take();
  queue.done(1, 10, 100);
  queue.published(100);  // an edit at exactly this time is not yet published
  EXPECT_TRUE(queue.pending(1));
  queue.published(101);
  EXPECT_FALSE(queue.pending(1));
  EXPECT_TRUE(queue.pending(2)) << "not even applied";
  queue.take();
  queue.done(2, 10, 200);
  queue.published(std::nullopt);
  EXPECT_FALSE(queue.pending(2));
}

}  // namespace
}  // namespace hapticd::server
