// InstanceDelta: the effect of one ChangeSet on the instances and on the other things that a scene places in the world.
//
// Invariant: there is one instance for each path from the root to a Shape (with DEF/USE, the path is the identity, not
// the node), and one for each path to a node that displays its bounding box. Applying every delta in order gives the
// same as flattening from scratch, apart from the numbers of the slots. A slot that a delta frees is used again by a
// later delta at the earliest, with another generation. Order: handle scopes, geometries, removed, added, rebound,
// moved, geometriesRemoved. An instance is in at most one of removed, added and (moved or rebound or both). Threading:
// plain data that needs no scene for shapes and places (materials do). Source: ISO/IEC 19775-1 V4.0 4.3.5
// (transformation hierarchy), 17.2.2 (scope of lights); paper section 5.1.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/core/value.h>

namespace rtsg {

struct Mesh;

/// Names an instance. `slot` is small and dense, for indexing arrays; `generation` tells successive users of a slot
/// apart.
struct InstanceId {
    std::uint32_t slot = 0xFFFFFFFF;
    std::uint32_t generation = 0;
    explicit operator bool() const { return slot != 0xFFFFFFFF; }
    friend bool operator==(const InstanceId&, const InstanceId&) = default;
    friend auto operator<=>(const InstanceId&, const InstanceId&) = default;
};

/// A part of the hierarchy that limits a local light: 0 is the whole scene. See Flattener::scopeParent.
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

/// Whether a thing is expected to move; a hint that no result depends on.
enum class Motion : std::uint8_t { unknown, fixed, moving };

/// How lines and points are drawn: LineProperties and PointProperties (12.4.4, 12.4.7). Widths in pixels.
struct StrokeStyle {
    float lineWidth = 1, pointSize = 1;
    std::int32_t lineType = 1;       // ISO/IEC 9973: 1 solid, 2 dashed, 3 dotted, 4 dashed-dotted, 5 dash-dot-dot
    Vec3f attenuation{1, 0, 0};      // of points at distance r from the eye: size / (x + y r + z r^2),
    float minimum = 1, maximum = 1;  // limited to these; 1 0 0: no attenuation
    bool attenuated() const { return attenuation != Vec3f(1, 0, 0); }
    friend bool operator==(const StrokeStyle&, const StrokeStyle&) = default;
};

/// A Shape at the end of one path, or a bounding box that is displayed there. Geometry may be NULL; so may `appearance`
/// (X3D's default then: unlit white).
struct Instance {
    InstanceId id;
    NodeId shape;
    NodeId geometry;
    NodeId appearance;
    NodeId acoustics;         // AcousticProperties of the appearance, or of the nearest group above that has one
    ScopeId scope;            // the innermost scope that holds a local light
    std::uint16_t layer = 0;  // index in LayerSet.layers, from 1; 0 is the scene outside any LayerSet
    Motion motion = Motion::unknown;
    bool castShadow = true;
    /// The box of an X3DVolumeDataNode, which is its own geometry and appearance: pointers meet the box, light meets
    /// the volume inside.
    bool volume = false;
    /// Its material is wholly transparent, so it is invisible in any light. Pointers and sound still meet it.
    bool clear = false;
    /// Whether eyes see it, and whether sound meets it. Both are true, unless a level of detail is chosen for an eye:
    /// sound meets the first level whatever is seen. At least one is true, except for a Collision's proxy.
    bool seen = true, heard = true;
    /// Whether it stops avatars, apart from the rules of Collision nodes (23.4.2): visible shapes do, and a Collision's
    /// proxy, which meets nothing else.
    bool felt = true;
    /// If not 0, instances with the same number hang below the same moving thing, and usually move together, rigidly. A
    /// hint that no result depends on.
    std::uint32_t rigid = 0;
    /// The point about which it turns when that thing turns, in its own local frame: the thing's origin or its
    /// `center`. A hint for the motion between two states; it does not affect the states.
    Vec3f pivot{0};
    /// The edges of a box that bboxDisplay shows, along the world's axes: only eyes meet them. `shape` is the
    /// X3DBoundedObject; `geometry` is the scene's root for all of them.
    bool boundingBox = false;
    /// Null: the default, which is one pixel for lines and points.
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
    window  // a Viewport among children: the picture's edges cut the things below it
};

struct Placed {
    InstanceId id;  // its own numbering, apart from the instances'
    NodeId node;
    PlacedKind kind = PlacedKind::light;
    /// The scope in which a light shines. It is 0 unless the light is local (`global` FALSE): then the light reaches
    /// everything in this scope and in scopes below it. Clip planes and local fogs use it in the same way.
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
    /// The triangles of a geometry node; null if it has none or they could not be made.
    struct Geometry {
        NodeId node;
        std::shared_ptr<const Mesh> mesh;
    };
    /// A scope and its parent; sent before anything uses the scope.
    struct Scope {
        ScopeId scope;
        ScopeId parent;
    };

    std::uint64_t sequence = 0;  // of the (last) ChangeSet it came from

    std::vector<Scope> scopes;  // new or re-parented
    std::vector<InstanceId> removed;
    std::vector<Instance> added;
    std::vector<Moved> moved;
    std::vector<Instance> rebound;  // anything but the transform has changed: geometry, appearance, scope,
                                    // castShadow...

    std::vector<Geometry> geometries;  // used for the first time, or changed in itself or in a node below
                                       // (Coordinate...)
    /// No instance refers to them any more, nor does hidden content of a displayed box.
    std::vector<NodeId> geometriesRemoved;
    /// Nodes used by an instance that have a change in any field, or in any node below (Material, ImageTexture...).
    std::vector<NodeId> appearanceChanged;
    std::vector<NodeId> acousticsChanged;

    std::vector<InstanceId> placedRemoved;
    std::vector<Placed> placedAdded;
    std::vector<Moved> placedMoved;
    std::vector<Placed> placedRebound;  // with another scope or layer
    std::vector<NodeId> placedChanged;  // lights, viewpoints, sounds... with a change in any field (or in nodes below)

    bool empty() const;
    /// Empties the lists and keeps their memory.
    void clear();
};

}  // namespace rtsg
