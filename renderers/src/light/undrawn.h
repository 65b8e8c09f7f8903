// Undrawn: names, once each, the kinds of nodes that a scene has and pictures do not show as their authors meant.
//
// Geometry without a mesh and textures that cannot be had are named where they are looked for; these are the rest.
// Threading: one thread, the scene's.
#pragma once

#include <string_view>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

class Scene;

class Undrawn {
  public:
    Undrawn();
    /// Looks at the nodes that a set creates; a snapshot has them all.
    void follow(const Scene& scene, const ChangeSet& changes, Diagnostics& into);

  private:
    std::vector<std::string_view> outcome_;  // by type; empty: drawn, or named already
};

}  // namespace rtsg
