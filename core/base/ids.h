// Typed indices. Mixing a vertex index with a hex index does not compile; the machine code is that of an int index.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <utility>
#include <vector>

namespace strata {

// An index into an IdMap. 32 bits: at most 2^31 - 1 elements of a kind. A default-made id is invalid.
template <class Tag>
struct Id {
  std::int32_t value = -1;

  constexpr Id() = default;
  constexpr explicit Id(std::int32_t index) : value(index) {}
  constexpr explicit Id(std::size_t index) : value(static_cast<std::int32_t>(index)) {}

  [[nodiscard]] constexpr bool valid() const { return value >= 0; }
  [[nodiscard]] constexpr std::size_t index() const { return static_cast<std::size_t>(value); }
  friend constexpr auto operator<=>(Id, Id) = default;
};

// The half-open range of the ids first .. first + count - 1, for range-for loops.
template <class I>
class IdRange {
 public:
  class iterator {
   public:
    constexpr explicit iterator(std::int32_t at) : at_(at) {}
    constexpr I operator*() const { return I(at_); }
    constexpr iterator& operator++() {
      ++at_;
      return *this;
    }
    friend constexpr bool operator==(iterator, iterator) = default;

   private:
    std::int32_t at_;
  };

  constexpr explicit IdRange(std::size_t count) : count_(static_cast<std::int32_t>(count)) {}
  [[nodiscard]] constexpr iterator begin() const { return iterator(0); }
  [[nodiscard]] constexpr iterator end() const { return iterator(count_); }

 private:
  std::int32_t count_;
};

// A vector indexed by one kind of id. Values lie contiguously in id order.
template <class I, class T>
class IdMap {
 public:
  using value_type = T;

  IdMap() = default;
  explicit IdMap(std::size_t count, const T& value = T()) : values_(count, value) {}
  explicit IdMap(std::vector<T> values) : values_(std::move(values)) {}
  IdMap(std::initializer_list<T> values) : values_(values) {}

  decltype(auto) operator[](I id) { return values_[id.index()]; }
  decltype(auto) operator[](I id) const { return values_[id.index()]; }

  [[nodiscard]] std::size_t size() const { return values_.size(); }
  [[nodiscard]] bool empty() const { return values_.empty(); }
  [[nodiscard]] IdRange<I> ids() const { return IdRange<I>(values_.size()); }
  [[nodiscard]] I next_id() const { return I(values_.size()); }

  I push_back(T value) {
    values_.push_back(std::move(value));
    return I(values_.size() - 1);
  }
  void resize(std::size_t count, const T& value = T()) { values_.resize(count, value); }
  void assign(std::size_t count, const T& value) { values_.assign(count, value); }
  void reserve(std::size_t count) { values_.reserve(count); }
  void clear() { values_.clear(); }

  auto begin() { return values_.begin(); }
  auto end() { return values_.end(); }
  auto begin() const { return values_.begin(); }
  auto end() const { return values_.end(); }
  [[nodiscard]] const T* data() const { return values_.data(); }
  [[nodiscard]] T* data() { return values_.data(); }
  // The plain vector underneath, for algorithms that do not index by id.
  [[nodiscard]] const std::vector<T>& values() const { return values_; }
  [[nodiscard]] std::vector<T>& values() { return values_; }

  friend bool operator==(const IdMap&, const IdMap&) = default;

 private:
  std::vector<T> values_;
};

// Elements of the hex mesh.
using VertexId = Id<struct VertexTag>;  // node of the hex mesh
using HexId = Id<struct HexTag>;
using QuadId = Id<struct QuadTag>;      // boundary or interface quad of the hex mesh

// Elements of the input surface.
using PointId = Id<struct PointTag>;        // vertex of the surface triangulation
using TriangleId = Id<struct TriangleTag>;
using PatchId = Id<struct PatchTag>;        // named patch, as the user knows it; order of first appearance in the input
using ChartId = Id<struct ChartTag>;        // connected piece of one patch between feature curves
using CurveId = Id<struct CurveTag>;        // feature curve between two corners, or closed
using CornerId = Id<struct CornerTag>;
using RegionId = Id<struct RegionTag>;      // meshed volume region; region reference in files = value + 1

}  // namespace strata
