// Charts that no kept curve parts any more.
#pragma once

#include "core/features/features.h"

namespace strata {

// The same curves and corners, but triangles of a chart belong to `into` of it (a chart that is its own image, of the same patch). Curves
// between merged charts become creases inside one. Chart ids keep their meaning; those merged away have no triangles left.
Features merge_charts(Features features, const IdMap<ChartId, ChartId>& into);

}  // namespace strata
