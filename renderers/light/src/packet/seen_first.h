// SeenFirst: the surfaces that a rasteriser found in a picture, for use in place of a tile's primary rays.
//
// Threading: immutable once made, asked by any number of tiles.
#pragma once

#include <cstdint>
#include <vector>

#include <rtsg/renderers/primary_sight.h>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

class SeenFirst {
  public:
    /// Both must outlive it; of the scene all is read that a picture is made of.
    SeenFirst(const TraceScene& scene, const PrimarySight& sight);
    const PrimarySight& sight() const { return sight_; }
    /// Whether the rasteriser's colour of such a pixel stays. `instance`: as in the sight.
    bool stays(std::uint32_t instance) const {
        return instance < slots_.size() ? slots_[instance].stays : instance == kNoInstance && skyStays_;
    }
    /// Whether the sight knows how far it is.
    bool hasDepth(std::uint32_t instance) const { return instance < slots_.size() && slots_[instance].deep; }
    /// By how much of itself a depth may be off.
    static constexpr float kDepthError = 1e-3f;

  private:
    struct Slot {
        bool stays = false, deep = false;
    };
    const PrimarySight& sight_;
    std::vector<Slot> slots_;
    bool skyStays_ = false;
};

}  // namespace rtsg::trace
