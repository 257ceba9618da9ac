// What grows where: patches matched to entries, borders to endings, charts to groups. Pure decisions, no geometry is moved.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/features/features.h"
#include "core/layers/facets.h"
#include "core/mesh/hex_mesh.h"
#include "core/spec/mesh_spec.h"
#include "core/surface/surface.h"

namespace strata {

// What was asked for a patch; entry < 0: no layers.
struct PatchWish {
  int entry = -1;
  ResolvedLayers law;
};
IdMap<PatchId, PatchWish> match_patches(const std::vector<LayerSpec>& entries, const IdMap<PatchId, std::string>& patch_names);

// How two neighbouring fronts meet.
enum class Meeting { Regular, CrossImprint, Imprint, Wedge };

// Between two fronts with layers; `a` and `b` are what either asked of the other. Dossier 7.4: a joint sheet beats a crossing above 120
// degrees (sin t = sin t/2); a crossing close to flat has no volume, whatever was asked.
Meeting meeting_of_layers(Ending a, Ending b, double angle);
// Between a front with layers, which asked `asked`, and one without.
Meeting meeting_with_bare(Ending asked, double angle);
// What an entry asks of a neighbour patch.
Ending ending_towards(const LayerSpec& entry, const std::string& neighbour);

// One group: patches that one set of sheets covers jointly.
struct LayerGroup {
  int count = 0;                               // physical layers
  std::vector<FrontIndex> fronts;              // ascending
  std::vector<VertexId> wedge_vertices;        // of borders where the layers run out to nothing; sorted
  std::vector<QuadId> beyond;                  // bare quads that the layers go on over before they run out
  double relative_thickness = 0;               // mean wished thickness over the local quad size: thick groups go first
};

struct LayerPlan {
  std::vector<std::int32_t> group_of_front;    // by FrontIndex; -1: no layers
  std::vector<LayerGroup> groups;              // in order of insertion
  std::vector<QuadId> bare;                    // quads of fronts with layers that are left out, ascending: the layers run out round them
  std::vector<Diagnostic> changed;             // EndingChanged, LayersFewer
  // Fronts of groups that were to end in wedges where the quads do not allow it: a fresh row (border_row.h) would.
  std::vector<std::vector<FrontIndex>> want_row;
};

// What earlier attempts taught.
struct PlanLessons {
  std::vector<std::uint8_t> excluded;                        // by FrontIndex, may be empty: fronts that must stay bare
  std::vector<QuadId> bare;                                  // of the band as it was cut: quads that must stay bare, ascending
  std::vector<std::pair<FrontIndex, FrontIndex>> joined;     // fronts that must be in one group: their crossing could not be made valid
};

LayerPlan plan_layers(const HexMesh& mesh, const JoinedFacets& facets, const std::vector<LayerSpec>& entries,
                      const IdMap<PatchId, PatchWish>& wishes, const Surface& surface, const Features& features,
                      const PlanLessons& lessons);

}  // namespace strata
