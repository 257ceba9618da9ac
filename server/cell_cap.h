// Keeps a job that could never fit from growing its whole octree to find that out: the tree is grown for larger cells instead, and what they cost
// says that the smaller ones cost too much.
#pragma once

#include <cstdint>

namespace strata {
struct Diagnostic;
struct Estimate;
struct MeshSpec;
}  // namespace strata

namespace strata::server {

class CellCap {
 public:
  // Bounds the cells of the specification by what the memory could hold at the very least. A budget of 0 is none.
  void put_on(MeshSpec& spec, std::int64_t memory_budget_bytes);
  // Of the run. True when it was the cap that made cells larger: nobody asked for that, and nobody will get it.
  bool hear(const Diagnostic& adjustment);
  // The estimate of what was asked for, given that of what was grown: more than the budget when the cap was reached.
  [[nodiscard]] Estimate of_what_was_asked(Estimate grown) const;

 private:
  bool on_ = false;
  double larger_ = 1;  // cells, by this factor
  std::int64_t budget_ = 0;
};

}  // namespace strata::server
