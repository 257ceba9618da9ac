// Whatever happens to a file, a reader returns a sound soup or throws MeshError.
#include <gtest/gtest.h>

#include <random>

#include "tests/core/io/samples.h"

namespace strata::test {
namespace {

void read_or_refuse(const std::string& bytes, io::SurfaceFormat format) {
  try {
    const TriangleSoup soup = read(bytes, format);
    ASSERT_FALSE(soup.triangles.empty());
    ASSERT_EQ(soup.patch.size(), soup.triangles.size());
    for (const auto& t : soup.triangles)
      for (const std::int32_t v : t) ASSERT_TRUE(v >= 0 && static_cast<std::size_t>(v) < soup.points.size());
    for (const std::int32_t p : soup.patch) ASSERT_TRUE(p >= 0 && static_cast<std::size_t>(p) < soup.patch_names.size());
    for (const Vec3& p : soup.points) ASSERT_TRUE(p.allFinite());
  } catch (const MeshError& error) {
    ASSERT_EQ(error.failure(), Failure::InvalidInput);
    ASSERT_FALSE(error.diagnostic().message.empty());
  }
}

TEST(DamagedFiles, CutAtAnyByteAreReadOrRefused) {
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    for (std::size_t size = 0; size <= sample.bytes.size(); ++size) read_or_refuse(sample.bytes.substr(0, size), sample.format);
  }
}

TEST(DamagedFiles, WithBytesChangedAreReadOrRefused) {
  std::mt19937 random(20260101);
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    for (int trial = 0; trial < 3000; ++trial) {
      std::string bytes = sample.bytes;
      for (int k = 1 + static_cast<int>(random() % 4); k > 0; --k) bytes[random() % bytes.size()] = static_cast<char>(random());
      read_or_refuse(bytes, sample.format);
    }
  }
}

TEST(DamagedFiles, WithDigitsChangedAreReadOrRefused) {
  const std::string digits = "0123456789-.e ";
  std::mt19937 random(7);
  for (const Sample& sample : samples()) {
    SCOPED_TRACE(sample.name);
    for (int trial = 0; trial < 2000; ++trial) {
      std::string bytes = sample.bytes;
      for (int k = 0; k < 6; ++k) {
        const std::size_t at = random() % bytes.size();
        if (digits.find(bytes[at]) != std::string::npos) bytes[at] = digits[random() % digits.size()];
      }
      read_or_refuse(bytes, sample.format);
    }
  }
}

TEST(DamagedFiles, ReadAsAnotherFormatAreReadOrRefused) {
  for (const Sample& sample : samples())
    for (const auto format :
         {io::SurfaceFormat::Stl, io::SurfaceFormat::Obj, io::SurfaceFormat::Off, io::SurfaceFormat::Ply, io::SurfaceFormat::Medit})
      read_or_refuse(sample.bytes, format);
}

}  // namespace
}  // namespace strata::test
