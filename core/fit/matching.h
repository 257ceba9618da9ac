// The state of feature matching: which vertex is which corner, which edges are which route.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/fit/point_tree.h"
#include "core/fit/routes.h"
#include "core/fit/skin.h"

namespace strata {

class Context;

struct Port {             // how a route leaves a corner
  VertexId vertex;        // the corner's vertex
  std::int32_t edge = -1; // skin edge to leave by; -1: any
};

struct Matching {
  const HexMesh& mesh;
  const Ground& ground;
  const Skin& skin;
  const PointTree& tree;
  const RoutePlan& plan;
  const IdMap<VertexId, double>& size;         // local edge length
  IdMap<CornerId, VertexId> corner_vertex;     // invalid: no vertex represents the corner
  IdMap<VertexId, CornerId> corner_at;
  IdMap<VertexId, std::int32_t> route_at;      // the route whose path a vertex lies on, or -1; not set at corners
  IdMap<VertexId, std::int32_t> reserved;      // the route that wants to leave its corner over this vertex, or -1
  std::vector<std::int32_t> route_of_edge;     // per skin edge, or -1
  std::vector<std::array<Port, 2>> ports;      // per route
  std::vector<std::vector<std::int32_t>> path; // per route: skin edges; empty: not routed
};

// One vertex a corner, and the edges by which its routes leave.
void match_corners(Matching& m);

// Edge paths for the routes, important ones first; who stands in the way of another is moved aside.
void route_paths(Matching& m, Context& context);

// Charts and patches of quads, attachments of vertices. Charts that only softened curves part are labelled as one: returns by which, for every
// chart.
IdMap<ChartId, ChartId> label_quads(const Matching& m, HexMesh& mesh);

}  // namespace strata
