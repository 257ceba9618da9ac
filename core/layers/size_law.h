// The heights of the layers over one wall vertex, given what the column really measures.
#pragma once

#include <span>

#include "core/spec/mesh_spec.h"

namespace strata {

// What a column should carry: count physical layers h1, h1 r, ..., then `blending` layers up to the size of the volume above.
struct ColumnLaw {
  double first_height = 0;   // working frame
  double growth = 1;
  int count = 0;
  int blending = 0;
  bool give_up_growth_first = false;  // where it is too thin: lower the growth before the heights
};

double physical_thickness(const ColumnLaw& law);

// Blending layers that lead from the last height to about half of `size` with a ratio near kBlendingGrowth; 0 when the last is near it.
int blending_layers(const ColumnLaw& law, double size);

// Thickness the column would like: the physical layers and blending up to half of `size`.
double wished_thickness(const ColumnLaw& law, double size);

// The largest count, up to those the laws have and down to `least`, with which at least `share` of the columns have room; `room` is the
// thickness of each.
int count_that_fits(std::span<const ColumnLaw> laws, std::span<const double> room, int least, double share);

// Thickness under which the physical layers would have to shrink: they and the thinnest blending that is of use.
double least_thickness(const ColumnLaw& law);

// Where the levels 1 .. count+blending lie as fractions of a column of the given thickness; the last is 1. Physical heights are kept
// exactly while there is room for them, blending layers take the rest; else all shrink by one factor (or the growth first).
// Returns the thickness of the physical layers over what was wished.
double column_fractions(const ColumnLaw& law, double thickness, std::span<double> levels);

inline constexpr double kBlendingGrowth = 1.6;

}  // namespace strata
