// Room openings: how much of a source's energy escapes from a room, and where most of it leaves.
//
//     TraceOptions options{.exits = 64};
//     const TraceResult traced = tracer.trace(source, listener, options);
//     const RoomOpenings found = geometry.openings(source, traced.exits, traced.escaped);
//
// A ray that escaped is followed to a point from which a tenth of all directions lead out. From there other rays find
// the rim of the opening, so that it need not be part of a mesh; if the rim is the open boundary of one mesh, this is
// the exact outline. Shapes that transmit sound count as closed here.
// Threading: pure functions over data that may be read on any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/core/value.h>

namespace rtsg {

class RayView;

/// A ray that left the geometry: its last hit, and the share of its energy that it still carried.
struct EscapedRay {
    glm::dvec3 origin{0}, direction{0, 0, 1};  // world; unit
    Bands energy{};
};

/// A shape that texts name.
struct WallShape {
    NodeId shape, geometry;
    AcousticBox box;   // in the world
    std::string name;  // given by the author, or else of its type; set by SoundRenderer only
};
/// Precondition: the slot of an instance with a mesh.
WallShape wallShapeOf(const RayView& rays, std::uint32_t slot);

/// The reason why nothing is heard: shapes that separate a source from a listener.
struct Seal {
    bool sourceInside = true;  // otherwise the listener is inside, and the source is not
    /// Whether each of `shapes` is closed and has exactly one of the two inside. Otherwise some thousand scattered rays
    /// found no path.
    bool proven = false;
    std::vector<WallShape> shapes;  // around the inner one: the smallest first, or the three that were hit most
    std::size_t more = 0;           // number of other shapes that were hit
};

struct RoomOpenings {
    /// The share of the emitted energy that escaped, mean over bands.
    double escaped = 0;
    /// More than three tenths of the source's view is sky: this is no room, and no opening was looked for.
    bool outdoors = false;

    /// The share that leaves by the opening that takes most for its size; 0: none was found, as where sound
    /// passes through walls. What follows is about this one.
    double fraction = 0;
    glm::dvec3 center{0};
    double length = 0, width = 0, area = 0;  // m along its longest axis and across, and m^2
    /// Small compared with the room, and so hardly intended: less than a hundredth of V^(2/3) and half a square metre,
    /// narrower than 3 cm, or one triangle of a mesh. V: the volume seen from the source.
    bool leak = false;
    bool triangle = false;          // one triangle of the first shape beside is missing
    std::vector<WallShape> beside;  // largest part of the rim first, three at most
};

/// `exits`: some of the rays that escaped, each chosen with the same probability; `escaped`: the share of all energy
/// that escaped. Takes some thousand rays.
RoomOpenings findRoomOpenings(const RayView& rays, const glm::dvec3& source, std::span<const EscapedRay> exits,
                              const Bands& escaped);

}  // namespace rtsg
