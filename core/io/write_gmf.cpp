// GMF .meshb and .solb (layout in gmf.h), in the byte order of the machine, coordinates as doubles. Version 2 while positions fit 32 bits,
// else version 3; indices fit 32 bits always.
#include <limits>
#include <string>
#include <vector>

#include "core/io/gmf.h"
#include "core/io/mesh_writers.h"

namespace strata::io {
namespace {

constexpr std::size_t kWord = 4;
constexpr std::size_t kVertexBytes = 3 * sizeof(double) + kWord;
constexpr std::size_t kHexBytes = 9 * kWord;
constexpr std::size_t kQuadBytes = 5 * kWord;

struct Block {
  GmfKeyword keyword;
  std::size_t data_bytes;  // behind keyword and position
};

// Writes block heads, knowing where each block will end.
class GmfStream {
 public:
  GmfStream(ByteStream& out, const std::vector<Block>& blocks) : out_(out) {
    wide_ = total(blocks, sizeof(std::int32_t)) > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    std::string head;
    append<std::int32_t>(head, 1);
    append<std::int32_t>(head, wide_ ? 3 : 2);
    out_.write(head);
    at_ = head.size();
  }

  void begin(const Block& block) {
    std::string head;
    append(head, static_cast<std::int32_t>(block.keyword));
    at_ += kWord + position_bytes() + block.data_bytes;
    append_position(head, at_);
    out_.write(head);
  }
  void end() {
    std::string head;
    append(head, static_cast<std::int32_t>(GmfKeyword::End));
    append_position(head, 0);
    out_.write(head);
  }

 private:
  static std::size_t total(const std::vector<Block>& blocks, std::size_t position_bytes) {
    std::size_t bytes = 2 * kWord + kWord + position_bytes;
    for (const Block& block : blocks) bytes += kWord + position_bytes + block.data_bytes;
    return bytes;
  }
  [[nodiscard]] std::size_t position_bytes() const { return wide_ ? sizeof(std::int64_t) : sizeof(std::int32_t); }
  void append_position(std::string& head, std::size_t position) const {
    if (wide_) append(head, static_cast<std::int64_t>(position));
    else append(head, static_cast<std::int32_t>(position));
  }

  ByteStream& out_;
  bool wide_ = false;
  std::size_t at_ = 0;
};

void write_word(ByteStream& out, std::size_t value) {
  std::string text;
  append(text, static_cast<std::int32_t>(value));
  out.write(text);
}

template <class Elements, class Reference>
void write_elements(ByteStream& out, const Elements& elements, const Reference& reference) {
  write_word(out, elements.size());
  write_parallel(out, elements.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t e = begin; e < end; ++e) {
      for (const VertexId v : elements.values()[e]) append<std::int32_t>(text, v.value + 1);
      append<std::int32_t>(text, reference(e));
    }
  });
}

void write_vertices(const HexMesh& mesh, ByteStream& out) {
  write_word(out, mesh.position.size());
  write_parallel(out, mesh.position.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t v = begin; v < end; ++v) {
      for (const double x : mesh.position[VertexId(v)]) append(text, x);
      append<std::int32_t>(text, 0);
    }
  });
}

constexpr Block kDimension{GmfKeyword::Dimension, kWord};

}  // namespace

void write_gmf(const HexMesh& mesh, ByteStream& out) {
  const Block vertices{GmfKeyword::Vertices, kWord + kVertexBytes * mesh.position.size()};
  const Block quads{GmfKeyword::Quadrilaterals, kWord + kQuadBytes * mesh.quads.size()};
  const Block hexes{GmfKeyword::Hexahedra, kWord + kHexBytes * mesh.hexes.size()};
  GmfStream gmf(out, {kDimension, vertices, quads, hexes});
  gmf.begin(kDimension);
  write_word(out, 3);
  gmf.begin(vertices);
  write_vertices(mesh, out);
  gmf.begin(quads);
  write_elements(out, mesh.quads, [&](std::size_t q) { return reference_of_quad(mesh, q); });
  gmf.begin(hexes);
  write_elements(out, mesh.hexes, [&](std::size_t h) { return reference_of_hex(mesh, h); });
  gmf.end();
}

void write_gmf_layers(const HexMesh& mesh, ByteStream& out) {
  const Block solution{GmfKeyword::SolAtHexahedra, 3 * kWord + sizeof(double) * mesh.hexes.size()};
  GmfStream gmf(out, {kDimension, solution});
  gmf.begin(kDimension);
  write_word(out, 3);
  gmf.begin(solution);
  write_word(out, mesh.hexes.size());
  write_word(out, 1);  // one field
  write_word(out, 1);  // a scalar
  write_parallel(out, mesh.hexes.size(), [&](std::size_t begin, std::size_t end, std::string& text) {
    for (std::size_t h = begin; h < end; ++h) append(text, static_cast<double>(layer_of_hex(mesh, h)));
  });
  gmf.end();
}

}  // namespace strata::io
