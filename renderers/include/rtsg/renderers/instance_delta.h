// InstanceDelta: what one ChangeSet did to the instances and to the other things a scene places in the world.
//
// Invariant: one instance per path from the root to a Shape (DEF/USE makes identity the path, not the node), and one
// per path to what displays its bounding box. Applying every delta in order gives what flattening from scratch gives,
// up to the numbering of the slots. A slot that a delta frees is handed out again by a later delta at the earliest,
// under another generation.
// Order: handle scopes, geometries, removed, added, rebound, moved, geometriesRemoved. An instance is in at most one of
// removed, added and (moved or rebound or both).
// Threading: plain data, self-contained: shape and place need no scene to be read (materials do).
// Source: ISO/IEC 19775-1 V4.0 4.3.5 (transformation hierarchy), 17.2.2 (scope of lights); paper section 5.1.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

struct Mesh;

/// Names an instance. `slot` is small and dense enough to index arrays with; `generation` tells its tenants apart.
struct InstanceId {
    std::uint32_t slot = 0xFFFFFFFF;
    std::uint32_t generation = 0;
    explicit operator bool() const { return slot != 0xFFFFFFFF; }
    friend bool operator==(const InstanceId&, const InstanceId&) = default;
    friend auto operator<=>(const InstanceId&, const InstanceId&) = default;
};

/// A place in the hierarchy that limits what a local light reaches: 0 is the whole scene. See Flattener::scopeParent.
struct ScopeId {
    std::uint32_t value = 0;
    friend bool operator==(const ScopeId&, const ScopeId&) = default;
};

/// Local to world, accumulated in double; columns 0-2 are the linear part, column 3 the translation (metres).
using WorldFromLocal = glm::dmat4x3;

/// -1 mirrored, +1 not, 0 singular (to within 1e-12 of the columns' lengths) or not finite.
int determinantSign(const WorldFromLocal& m);
/// a * b, both affine.
WorldFromLocal compose(const WorldFromLocal& a, const WorldFromLocal& b);
WorldFromLocal identityTransform();
bool isFinite(const WorldFromLocal& m);

/// How often a thing is expected to move; a hint that no result depends on.
enum class Motion : std::uint8_t { unknown, fixed, moving };

/// How lines and points are drawn: LineProperties and PointProperties (12.4.4, 12.4.7). Widths in pixels.
struct StrokeStyle {
    float lineWidth = 1, pointSize = 1;
    std::int32_t lineType = 1;   // ISO/IEC 9973: 1 solid, 2 dashed, 3 dotted, 4 dashed-dotted, 5 dash-dot-dot
    Vec3f attenuation{1, 0, 0};  // of points, by their distance r from the eye: size / (x + y r + z r^2), within
    float least = 1, most = 1;   // these; not at all if it is 1 0 0
    bool attenuated() const { return attenuation != Vec3f(1, 0, 0); }
    friend bool operator==(const StrokeStyle&, const StrokeStyle&) = default;
};

/// A Shape at the end of one path, or the box that something on it displays. Geometry may be NULL; `appearance` too
/// (then X3D's default: unlit white).
struct Instance {
    InstanceId id;
    NodeId shape;
    NodeId geometry;
    NodeId appearance;
    NodeId acoustics;         // AcousticProperties of the appearance, or of the nearest group above that has one
    ScopeId scope;            // innermost place that holds a local light
    std::uint16_t layer = 0;  // index in LayerSet.layers, from 1; 0 is the scene outside any LayerSet
    Motion motion = Motion::unknown;
    bool castShadow = true;
    /// The box of an X3DVolumeDataNode, which is its own geometry and appearance: pointers meet it, light what is in
    /// it.
    bool volume = false;
    /// Its material is wholly transparent, so nothing of it is seen in any light. Pointers and sound still meet it.
    bool clear = false;
    /// Whether eyes see it, and whether sound meets it. Both, unless a level of detail is chosen for an eye: sound
    /// meets the first level, whatever is seen. One of the two is true, but of a Collision's proxy.
    bool seen = true, heard = true;
    /// Whether it stops avatars, but for what Collision nodes say (23.4.2): what is seen does, and a Collision's proxy,
    /// which nothing else meets.
    bool felt = true;
    /// Other than 0: those with the same number hang below the same thing that moves, and as a rule move together,
    /// rigidly. A hint that no result depends on.
    std::uint32_t rigid = 0;
    /// About which it turns when that thing does, in its own local frame: the thing's origin or its `center`. A hint
    /// about the way between two states; where it is in either does not depend on it.
    Vec3f pivot{0};
    /// The edges of a box that bboxDisplay shows, in the world's directions: eyes meet them, and nothing else. `shape`
    /// is the X3DBoundedObject; `geometry`, the same for all of them, is the scene's root.
    bool boundingBox = false;
    /// Null: the default, lines and points of one pixel.
    std::shared_ptr<const StrokeStyle> strokes;
    WorldFromLocal worldFromLocal{1.0};
};

/// The other things that a scene places in the world, also one for each path.
enum class PlacedKind : std::uint8_t {
    light,
    view,
    background,
    fog,
    navigation,
    sound,
    listener,
    sensor,
    clipPlane,
    localFog,
    window  // a Viewport among children: cuts what is below it by the picture's edges
};

struct Placed {
    InstanceId id;  // its own numbering, apart from the instances'
    NodeId node;
    PlacedKind kind = PlacedKind::light;
    /// The scope in which a light shines. It is 0 unless the light is local (`global` FALSE): then the light reaches
    /// everything whose scope is this one or below it. Clip planes and local fogs have their scope here, too.
    ScopeId scope;
    std::uint16_t layer = 0;
    Motion motion = Motion::unknown;
    WorldFromLocal worldFromLocal{1.0};
};

struct InstanceDelta {
    struct Moved {
        InstanceId id;
        WorldFromLocal worldFromLocal{1.0};
    };
    /// The triangles of a geometry node; null when it has none or they could not be made.
    struct Geometry {
        NodeId node;
        std::shared_ptr<const Mesh> mesh;
    };
    /// A scope and the one around it, for walking outwards; sent before anything uses it.
    struct Scope {
        ScopeId scope;
        ScopeId parent;
    };

    std::uint64_t sequence = 0;  // of the (last) ChangeSet it came from

    std::vector<Scope> scopes;  // new or re-parented
    std::vector<InstanceId> removed;
    std::vector<Instance> added;
    std::vector<Moved> moved;
    std::vector<Instance> rebound;  // another geometry, appearance, scope, castShadow...: anything but the transform

    std::vector<Geometry> geometries;  // first used now, or changed in itself or in a node below (Coordinate...)
    /// No instance refers to them any more, nor hidden content of a displayed box.
    std::vector<NodeId> geometriesRemoved;
    /// Nodes some instance refers to with a change in any field, or in any node below (Material, ImageTexture...).
    std::vector<NodeId> appearanceChanged;
    std::vector<NodeId> acousticsChanged;

    std::vector<InstanceId> placedRemoved;
    std::vector<Placed> placedAdded;
    std::vector<Moved> placedMoved;
    std::vector<Placed> placedRebound;  // its scope or layer
    std::vector<NodeId> placedChanged;  // lights, viewpoints, sounds... with a change in any field (or in nodes below)

    bool empty() const;
    /// Empties the lists and keeps their memory.
    void clear();
};

}  // namespace rtsg
