// A body's mesh as a tree of features is made of it, by what distances on paths and limits of approach share.
#pragma once

#include "step/clearance/feature_tree.h"

namespace dccd {

/// False: it is the mesh that it was.
inline bool takesMesh(const Body& body, SceneBody& scene) {
  Body& setup = scene.setup;
  if (setup.topology == body.topology && setup.vertex_mask == body.vertex_mask) return false;
  scene = SceneBody();
  setup.topology = body.topology;
  setup.vertex_mask = body.vertex_mask;
  scene.slot_vertex.assign(body.topology->usedVertices().begin(), body.topology->usedVertices().end());
  if (!body.vertex_mask.empty()) scene.asked.assign(body.topology->vertexCount(), 1);
  for (const Index v : body.vertex_mask) scene.asked[v] = 0;
  return true;
}

inline VertexMotion atRestAt(const Vec3& p) { return {{p[0], p[1], p[2], 0}, {p[0], p[1], p[2], 0}}; }

}  // namespace dccd
