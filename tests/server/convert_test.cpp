#include "server/convert.h"
#include "core/mesher.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>

namespace strata::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Gives every field another value that is not its default; repeated fields get two entries.
class Filler {
 public:
  void fill(Message& message) {
    const auto& reflection = *message.GetReflection();
    for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
      const FieldDescriptor& field = *message.GetDescriptor()->field(i);
      const int times = field.is_repeated() ? 2 : 1;
      for (int k = 0; k < times; ++k) fill(message, reflection, field);
    }
  }

 private:
  void fill(Message& m, const google::protobuf::Reflection& r, const FieldDescriptor& f) {
    const int next = ++counter_;
    switch (f.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE: f.is_repeated() ? r.AddDouble(&m, &f, next + 0.5) : r.SetDouble(&m, &f, next + 0.5); break;
      case FieldDescriptor::CPPTYPE_INT32: f.is_repeated() ? r.AddInt32(&m, &f, next) : r.SetInt32(&m, &f, next); break;
      case FieldDescriptor::CPPTYPE_INT64: f.is_repeated() ? r.AddInt64(&m, &f, next) : r.SetInt64(&m, &f, next); break;
      case FieldDescriptor::CPPTYPE_UINT64: r.SetUInt64(&m, &f, static_cast<std::uint64_t>(next)); break;
      case FieldDescriptor::CPPTYPE_BOOL: r.SetBool(&m, &f, true); break;
      case FieldDescriptor::CPPTYPE_STRING: {
        const std::string text = "text" + std::to_string(next);
        f.is_repeated() ? r.AddString(&m, &f, text) : r.SetString(&m, &f, text);
        break;
      }
      case FieldDescriptor::CPPTYPE_ENUM: {
        const auto* value = f.enum_type()->value(f.enum_type()->value_count() - 1);
        f.is_repeated() ? r.AddEnum(&m, &f, value) : r.SetEnum(&m, &f, value);
        break;
      }
      case FieldDescriptor::CPPTYPE_MESSAGE: fill(f.is_repeated() ? *r.AddMessage(&m, &f) : *r.MutableMessage(&m, &f)); break;
      default: FAIL() << "teach the test about " << f.full_name();
    }
  }

  int counter_ = 0;
};

TEST(Convert, EveryFieldOfTheSpecificationSurvivesTheRoundTrip) {
  v1::MeshSpec spec;
  Filler().fill(spec);
  const v1::MeshSpec back = to_wire(from_wire(spec));
  google::protobuf::util::MessageDifferencer differencer;
  std::string difference;
  differencer.ReportDifferencesToString(&difference);
  google::protobuf::util::DefaultFieldComparator close;  // angles change unit and back
  close.set_float_comparison(google::protobuf::util::DefaultFieldComparator::APPROXIMATE);
  differencer.set_field_comparator(&close);
  EXPECT_TRUE(differencer.Compare(spec, back)) << difference;
}

TEST(Convert, AnEmptySpecificationIsTheDefaults) {
  const MeshSpec spec = from_wire(v1::MeshSpec());
  EXPECT_EQ(spec.volume.mode, VolumeMode::All);
  EXPECT_DOUBLE_EQ(spec.features.ridge_angle, FeatureSpec().ridge_angle);
  EXPECT_EQ(spec.features.sharp_edges, SharpEdges::Auto);
  EXPECT_EQ(spec.sizing.gradation, 2);
}

TEST(Convert, AMissingPointOrAnUnknownEnumIsRefusedByName) {
  const auto field_of = [](const v1::MeshSpec& spec) {
    try {
      from_wire(spec);
    } catch (const MeshError& error) {
      return error.diagnostic().field;
    }
    return std::string("accepted");
  };
  v1::MeshSpec spec;
  spec.mutable_sizing()->add_boxes();
  EXPECT_EQ(field_of(spec), "sizing.boxes[0].min");
  spec.Clear();
  spec.add_layers()->set_ending(static_cast<v1::Ending>(99));
  EXPECT_EQ(field_of(spec), "layers[0].ending");
  spec.Clear();
  spec.add_layers()->add_give_up(v1::LayerSpec::GIVE_UP_UNSPECIFIED);
  EXPECT_EQ(field_of(spec), "layers[0].give_up[0]");
}

TEST(Convert, ADiagnosticKeepsAllItKnows) {
  Diagnostic diagnostic;
  diagnostic.reason = Reason::SurfaceNotClosed;
  diagnostic.severity = Severity::Warning;
  diagnostic.message = "open";
  diagnostic.patch = "wing";
  diagnostic.field = "layers[0]";
  diagnostic.triangles = {3, 5};
  diagnostic.count = 9;
  diagnostic.box.add(Vec3(0, 1, 2));
  diagnostic.values = {{"gap", 0.25}};
  const v1::Diagnostic wire = to_wire(diagnostic);
  EXPECT_EQ(wire.reason(), "SURFACE_NOT_CLOSED");
  EXPECT_EQ(wire.severity(), v1::SEVERITY_WARNING);
  EXPECT_EQ(wire.message(), "open");
  EXPECT_EQ(wire.patch(), "wing");
  EXPECT_EQ(wire.field(), "layers[0]");
  EXPECT_EQ(wire.triangles(1), 5);
  EXPECT_EQ(wire.count(), 9);
  EXPECT_EQ(wire.box().max().z(), 2);
  EXPECT_EQ(wire.values().at("gap"), 0.25);
}

// A tetrahedron as typed arrays.
v1::Surface arrays_of(std::string& bytes, std::array<std::uint32_t, 12> triangles, int patches) {
  const double points[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::int32_t patch[4] = {0, 0, 1, 1};
  bytes.assign(reinterpret_cast<const char*>(points), sizeof points);
  bytes.append(reinterpret_cast<const char*>(triangles.data()), sizeof triangles);
  if (patches > 0) bytes.append(reinterpret_cast<const char*>(patch), sizeof patch);
  v1::Surface surface;
  surface.set_format(v1::SURFACE_FORMAT_ARRAYS);
  surface.mutable_arrays()->set_point_count(4);
  surface.mutable_arrays()->set_triangle_count(4);
  for (int i = 0; i < patches; ++i) surface.mutable_arrays()->add_patch_names("p" + std::to_string(i));
  return surface;
}

constexpr std::array<std::uint32_t, 12> kTetrahedron = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};

TEST(TypedArrays, BecomeASoupWithPatches) {
  std::string bytes;
  const v1::Surface surface = arrays_of(bytes, kTetrahedron, 2);
  const TriangleSoup soup = read_wire_surface(surface, bytes);
  EXPECT_EQ(soup.points.size(), 4u);
  EXPECT_EQ(soup.triangles[1], (std::array<std::int32_t, 3>{0, 1, 3}));
  EXPECT_EQ(soup.patch, (std::vector<std::int32_t>{0, 0, 1, 1}));
  EXPECT_EQ(soup.patch_names, (std::vector<std::string>{"p0", "p1"}));
}

TEST(TypedArrays, WithoutNamesAreOnePatchNamedSurface) {
  std::string bytes;
  const v1::Surface surface = arrays_of(bytes, kTetrahedron, 0);
  EXPECT_EQ(read_wire_surface(surface, bytes).patch_names, std::vector<std::string>{"surface"});
}

TEST(TypedArrays, WithMorePatchesThanARecordCanTellOfAreRefused) {
  std::string bytes;
  v1::Surface surface = arrays_of(bytes, kTetrahedron, 2);
  const auto reason = [&] {
    try {
      read_wire_surface(surface, bytes);
    } catch (const MeshError& error) {
      return std::string(reason_name(error.diagnostic().reason));
    }
    return std::string("accepted");
  };
  for (int i = 2; i < 10'000; ++i) surface.mutable_arrays()->add_patch_names("a face of the CAD model, " + std::to_string(i));
  EXPECT_EQ(reason(), "accepted");
  for (std::string& name : *surface.mutable_arrays()->mutable_patch_names()) name += std::string(100, 'x');
  EXPECT_EQ(reason(), "FILE_TOO_LARGE");
}

TEST(TypedArrays, ThatLieAreRefused) {
  const auto reason_of = [](const v1::Surface& surface, const std::string& bytes) {
    try {
      read_wire_surface(surface, bytes);
    } catch (const MeshError& error) {
      return std::string(reason_name(error.diagnostic().reason));
    }
    return std::string("accepted");
  };
  std::string bytes;
  v1::Surface surface = arrays_of(bytes, {0, 2, 1, 0, 1, 3, 1, 2, 4, 0, 3, 2}, 0);
  EXPECT_EQ(reason_of(surface, bytes), "SURFACE_INDEX_OUT_OF_RANGE");
  surface = arrays_of(bytes, kTetrahedron, 1);
  EXPECT_EQ(reason_of(surface, bytes), "SURFACE_INDEX_OUT_OF_RANGE");  // patch 1 of 1
  surface = arrays_of(bytes, kTetrahedron, 2);
  EXPECT_EQ(reason_of(surface, bytes.substr(1)), "FILE_MALFORMED");
  surface.mutable_arrays()->set_point_count(std::int64_t{1} << 62);
  EXPECT_EQ(reason_of(surface, bytes), "FILE_MALFORMED");
  surface = arrays_of(bytes, kTetrahedron, 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::memcpy(bytes.data() + 8, &nan, 8);
  EXPECT_EQ(reason_of(surface, bytes), "SURFACE_NON_FINITE");
}

TEST(Blocks, LieAtMultiplesOf64AndHoldTheArrays) {
  HexMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.position.push_back(Vec3(i, 2 * i, 3 * i));
  HexVertices hex;
  for (int i = 0; i < 8; ++i) hex[static_cast<std::size_t>(i)] = VertexId(i);
  mesh.hexes.push_back(hex);
  mesh.region.push_back(RegionId(0));
  mesh.layer.push_back(3);
  mesh.quads.push_back({VertexId(0), VertexId(3), VertexId(2), VertexId(1)});
  mesh.patch.push_back(PatchId(4));
  const v1::MeshBlocks blocks = blocks_of(mesh);
  std::string bytes;
  write_blocks(mesh, blocks, [&](std::span<const char> piece) { bytes.append(piece.data(), piece.size()); });
  ASSERT_EQ(blocks.blocks_size(), 6);
  for (const v1::Block& block : blocks.blocks()) EXPECT_EQ(block.offset() % 64, 0);
  EXPECT_EQ(static_cast<std::int64_t>(bytes.size()), blocks.blocks(5).offset() + blocks.blocks(5).size_bytes());
  const auto at = [&]<class T>(int block, std::size_t i, T) {
    T value;
    std::memcpy(&value, bytes.data() + blocks.blocks(block).offset() + static_cast<std::int64_t>(i * sizeof(T)), sizeof(T));
    return value;
  };
  EXPECT_EQ(at(0, 23, 0.0), 21.0);
  EXPECT_EQ(at(1, 7, std::uint32_t{0}), 7u);
  EXPECT_EQ(at(2, 1, std::uint32_t{0}), 3u);
  EXPECT_EQ(at(3, 0, std::int32_t{0}), 5);  // references count from 1
  EXPECT_EQ(at(4, 0, std::int32_t{0}), 1);
  EXPECT_EQ(at(5, 0, std::uint16_t{0}), 3);
}

}  // namespace
}  // namespace strata::server
