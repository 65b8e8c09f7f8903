// Flattener: keeps the paths of a scene (one occurrence per path) and turns ChangeSets into InstanceDeltas.
//
// Invariant: after apply() the occurrences are those that building from the scene anew would give; the work follows the
// changes and what lies below the changed nodes, never the scene. Nothing recurses: nesting may be of any depth. It
// finds Shapes below groups, the chosen child of Switch and LOD, the first node of a PROTO's body, the whole of an
// Inline's, the children of Collision and, for avatars alone, its proxy; and boxes that bboxDisplay shows. Billboards
// turn to the viewer if there is one, and shapes below them are not heard; LayoutLayers, LayoutGroups, ScreenGroups and
// text in points likewise follow the picture. Threading: one thread, the scene's; the deltas may go to any other.
// Source: ISO/IEC 19775-1 V4.0 4.3.5, 10.4 (grouping), 10.4.4 (Transform), 10.4.3 (Switch), 23.4.3 (LOD), 35 (layers),
// 36 (layouts).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/bus.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/instance_delta.h>
#include <rtsg/renderers/tessellate.h>

namespace rtsg {

class Scene;

/// How a picture shows a layer: what must be known by things whose size is in pixels (36.2).
struct LayerSight {
    std::uint16_t layer = 0;                 // as Instance::layer
    int width = 0, height = 0;               // of the rectangle that it is seen in, in pixels; above 0
    std::array<double, 4> part{0, 1, 0, 1};  // of the picture: left, right, top, bottom of it, as shares
    Vec3d eye{0}, right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};
    enum class Kind : std::uint8_t { perspective, parallel, around } kind = Kind::perspective;
    /// Left, right, bottom and top edge: at distance 1 before the eye, of `parallel` metres, of `around` radians.
    std::array<double, 4> edges{-1, 1, -1, 1};
    double limit = std::numeric_limits<double>::infinity();  // nothing beyond is seen
    /// How high a pixel is, as the edges are measured.
    double pixel() const { return (edges[3] - edges[2]) / height * std::min(glm::length(right), glm::length(up)); }
    struct Ray {
        Vec3d origin, direction;  // a unit vector
    };
    /// `x`, `y` from 0 (left, top) to 1 (right, bottom) of the rectangle.
    Ray ray(double x, double y) const;
    friend bool operator==(const LayerSight&, const LayerSight&) = default;
};
/// Whether what is laid out for one picture is for the other.
bool areOfOneSize(const std::vector<LayerSight>& a, const std::vector<LayerSight>& b);

/// The place of a viewer in world space, from which a picture is made.
struct EyePlace {
    EyePlace(const Vec3d& at, const Vec3d& above = Vec3d(0, 1, 0)) : position(at), up(above) {}
    Vec3d position, up;  // up: of its picture, of any length
    friend bool operator==(const EyePlace&, const EyePlace&) = default;
};

struct PictureSight {
    EyePlace eye{Vec3d(0)};
    std::vector<LayerSight> layers;
};

/// The mesh of a geometry node; null when it has none. Called once per new or changed geometry; the points of skins are
/// not handed to it.
using MeshSource = std::function<std::shared_ptr<const Mesh>(const Scene& scene, NodeId geometry)>;

class Flattener {
  public:
    struct Options {
        /// Makes the meshes. If empty, a Tessellator of the flattener's own does, with the points of skins; its
        /// diagnostics are added to the flattener's.
        MeshSource meshes;
        /// The most paths to shapes that are followed; the rest is left out with a diagnostic. Sharing can make paths
        /// exponential in number.
        std::size_t maxOccurrences = 8'000'000;
        /// How finely curved geometry is cut. An error in pixels goes by the last picture's eye and by the nearest
        /// place of a geometry, and chooses a level of Tessellator's. A finer level is taken at once, a coarser one
        /// only when the present one is more than half a level too fine, so that an eye that sways changes nothing.
        /// Without an eye, or with a MeshSource, Tessellator's own level is used. A place that moves away from a
        /// resting eye keeps its level.
        TessellationError error{};
    };
    /// How finely Options::error has curved geometry cut.
    struct Cuts {
        std::size_t geometries = 0, triangles = 0;  // of curved ones; each geometry once, wherever it stands
        std::size_t tooCoarse = 0;                  // of them, those whose finest level is less than was asked for
        std::array<std::size_t, 8> ofLevel{};       // geometries
        std::uint64_t made = 0;                     // meshes, since the start
    };
    Cuts cuts() const;

    Flattener();
    explicit Flattener(Options options);
    ~Flattener();
    Flattener(Flattener&&) noexcept;
    Flattener& operator=(Flattener&&) noexcept;

    /// Follows the scene, which is in the state `changes` leads to. The delta is valid until the next call. A snapshot
    /// starts over: everything there was is removed first.
    const InstanceDelta& apply(const Scene& scene, const ChangeSet& changes);

    /// The meshes of geometry nodes of this type come from `source`; those there are already with the next apply() or
    /// updateViewer().
    void setMeshSource(const Scene& scene, std::string_view type, MeshSource source);

    /// Sets the viewer, by whose place LOD chooses what is seen, and to whom Billboards turn; without one, every LOD
    /// shows its first level. Sound always meets the first level (Instance::seen, heard), so that a picture changes no
    /// sound. Takes effect with the next apply() or with updateViewer(). `sights` are the picture's; layouts,
    /// ScreenGroups and text in points have their size by them. A layer that has none is laid out as in a picture of
    /// 1280 by 720 pixels; outside of LayoutLayers a pixel is then 1/96 inch.
    void setViewer(std::optional<EyePlace> eye, std::vector<LayerSight> sights = {});
    /// Follows the viewer alone, between two frames.
    const InstanceDelta& updateViewer(const Scene& scene);

    /// Indexed by slot; the id of a free slot is none.
    const std::vector<Instance>& instances() const;
    const std::vector<Placed>& placed() const;
    std::size_t instanceCount() const;
    /// Whether anything has its place or size from a picture's pixels, or lies in a layer, by whose own eye it turns
    /// and pointers find it; if not, no sights are needed.
    bool usesPixels() const;
    /// The sights that setViewer() was given last.
    const std::vector<LayerSight>& sights() const;
    /// The path from a root node to the Shape, or to the node whose bounding box is displayed, both included.
    std::vector<NodeId> path(InstanceId instance) const;
    std::vector<NodeId> placedPath(InstanceId placed) const;
    ScopeId scopeParent(ScopeId scope) const;
    /// The nodes on the path whose content is placed by the picture, as indices into path(), with the transform of
    /// each.
    std::vector<std::pair<std::size_t, WorldFromLocal>> byPicture(InstanceId instance) const;
    /// The number of a layer's node, as Instance::layer; 0 if it is none.
    std::uint16_t layerOf(NodeId layer) const;
    /// A delta that leads from nothing to here, for those who come late.
    InstanceDelta snapshot() const;

    /// Diagnostics of paths that are left out and of the tessellation of geometry. Each is there once, however often a
    /// geometry changes.
    const Diagnostics& diagnostics() const;
    /// Flatteners made since the process started.
    static std::uint64_t made();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Follows a flattened scene, as light, sound, a rasteriser or an export does. It is added to a SharedWorld.
class InstanceSubscriber {
  public:
    virtual ~InstanceSubscriber() = default;
    /// On the scene's thread, in the order of attaching. `scene` and `changes` are there for materials and the like.
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) = 0;
    /// A version of the tables that it has made by its last apply(), for readers on any thread while it goes on; null
    /// if it has none. Called when a reader has asked (SharedWorld::latest()); its cost should follow the changes since
    /// the last one.
    virtual std::shared_ptr<const void> freeze() { return nullptr; }
    /// The size and eye of the pictures that it makes of such versions, for which things in pixels are laid out;
    /// nothing if it makes no pictures. Called before a version is made, if anything in the scene is in pixels.
    virtual std::optional<PictureSight> looksFrom() { return std::nullopt; }
    virtual std::string subscriberName() const { return "instance subscriber"; }
};

}  // namespace rtsg
