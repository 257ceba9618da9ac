// Frames on the wire: whatever they say of themselves, what is opened is what was sealed, or it is refused.
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "proto/wire/crc32c.h"
#include "proto/wire/frame.h"

namespace strata::wire {
namespace {

constexpr std::int64_t kMost = std::int64_t{4} << 20;

std::string repeating(std::size_t size) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(i / 7 % 50);
  return bytes;
}

std::string noise(std::size_t size) {
  std::mt19937 dice(7);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(dice());
  return bytes;
}

v1::Frame sealed(const std::string& bytes, v1::Codec codec) {
  v1::Frame frame;
  frame.set_offset(17);
  frame.set_data(bytes);
  seal_frame(frame, codec);
  return frame;
}

TEST(Crc32c, IsThatOfTheStandardAndTheSameHoweverTheBytesAreCut) {
  EXPECT_EQ(crc32c("123456789"), 0xE3069283u);
  EXPECT_EQ(crc32c(std::string(32, '\0')), 0x8A9136AAu);  // RFC 3720, B.4
  const std::string bytes = noise(40'000);
  const auto one_by_one = [&](std::size_t size) {
    std::uint32_t crc = 0;
    for (std::size_t i = 0; i < size; ++i) crc = crc32c(bytes.substr(i, 1), crc);
    return crc;
  };
  for (const std::size_t size : {0, 1, 7, 8, 9, 4096, 12'287, 12'288, 12'289, 24'576, 24'583, 40'000}) {
    EXPECT_EQ(crc32c(bytes.substr(0, size)), one_by_one(size)) << size;
    EXPECT_EQ(crc32c(bytes.substr(size), crc32c(bytes.substr(0, size))), crc32c(bytes)) << size;
  }
}

TEST(Frame, OpensToWhatWasSealedWithEveryCodec) {
  for (const v1::Codec codec : {v1::CODEC_UNSPECIFIED, v1::CODEC_ZSTD})
    for (const std::size_t size : {1, 2, 100, 4096, 1 << 20})
      for (const std::string& bytes : {repeating(size), noise(size), std::string(size, 'x')}) {
        v1::Frame frame = sealed(bytes, codec);
        EXPECT_EQ(frame.crc32c(), crc32c(bytes)) << "of the plain bytes, whatever the codec";
        EXPECT_LE(frame.data().size(), bytes.size());
        ASSERT_EQ(open_frame(frame, kMost), FrameFault::None);
        EXPECT_TRUE(frame.data() == bytes);
        EXPECT_EQ(frame.codec(), v1::CODEC_UNSPECIFIED);
        EXPECT_EQ(frame.offset(), 17);
      }
}

TEST(Frame, IsPackedOnlyWhereThatSavesSomething) {
  EXPECT_EQ(sealed(repeating(1 << 20), v1::CODEC_ZSTD).codec(), v1::CODEC_ZSTD);
  EXPECT_LT(sealed(repeating(1 << 20), v1::CODEC_ZSTD).data().size(), std::size_t{1} << 17);
  EXPECT_EQ(sealed(noise(1 << 20), v1::CODEC_ZSTD).codec(), v1::CODEC_UNSPECIFIED);
  EXPECT_EQ(sealed(repeating(1 << 20), v1::CODEC_UNSPECIFIED).codec(), v1::CODEC_UNSPECIFIED);
}

TEST(Frame, AnyBitThatFlipsOnTheWayIsFound) {
  for (const v1::Codec codec : {v1::CODEC_UNSPECIFIED, v1::CODEC_ZSTD}) {
    const v1::Frame good = sealed(repeating(3000), codec);
    for (std::size_t byte = 0; byte < good.data().size(); ++byte) {
      v1::Frame bad = good;
      (*bad.mutable_data())[byte] = static_cast<char>(bad.data()[byte] ^ (1 << byte % 8));
      const FrameFault fault = open_frame(bad, kMost);
      // A packed frame may hold a bit that means nothing; then the bytes are right all the same.
      if (fault == FrameFault::None) EXPECT_TRUE(bad.data() == repeating(3000));
      else EXPECT_EQ(fault, FrameFault::Damaged);
    }
  }
}

TEST(Frame, WhatItSaysOfItsSizeIsNotBelieved) {
  const v1::Frame good = sealed(repeating(3000), v1::CODEC_ZSTD);
  for (const int size : {0, -1, -2'000'000'000, 2'000'000'000, 4 * 1024 * 1024 + 1}) {
    v1::Frame bad = good;
    bad.set_decoded_size(size);
    EXPECT_EQ(open_frame(bad, kMost), FrameFault::Size) << size;
  }
  for (const int size : {1, 2999, 3001, 4 * 1024 * 1024}) {
    v1::Frame bad = good;
    bad.set_decoded_size(size);
    EXPECT_EQ(open_frame(bad, kMost), FrameFault::Damaged) << size;
  }
  v1::Frame empty = good;
  empty.clear_data();
  EXPECT_EQ(open_frame(empty, kMost), FrameFault::Size);
  v1::Frame large = sealed(noise(5 << 20), v1::CODEC_UNSPECIFIED);
  EXPECT_EQ(open_frame(large, kMost), FrameFault::Size);
  v1::Frame strange = good;
  strange.set_codec(static_cast<v1::Codec>(77));
  EXPECT_EQ(open_frame(strange, kMost), FrameFault::Codec);
}

TEST(Frame, ASenderGivesUpPackingForAWhileWhereItSavesNothing) {
  PackingChoice choice(v1::CODEC_ZSTD);
  int tried = 0;
  for (int i = 0; i < 160; ++i) {
    tried += choice.next() == v1::CODEC_ZSTD ? 1 : 0;
    choice.sent(sealed(noise(5000), choice.next()));
  }
  EXPECT_EQ(tried, 10);
  PackingChoice worth(v1::CODEC_ZSTD);
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(worth.next(), v1::CODEC_ZSTD);
    worth.sent(sealed(repeating(5000), worth.next()));
  }
}

}  // namespace
}  // namespace strata::wire
