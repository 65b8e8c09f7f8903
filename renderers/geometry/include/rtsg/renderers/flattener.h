// Flattener: keeps the paths of a scene (one occurrence for each path) and turns ChangeSets into InstanceDeltas.
//
// Invariant: after apply() the occurrences are the same as if built from the scene anew; the cost follows the changes
// and the nodes below them, not the scene. It does not recurse: nesting may be of any depth. It finds Shapes below
// groups, the chosen child of Switch and LOD, the first node of a PROTO's body, all of an Inline's, the children of
// Collision and, for avatars alone, its proxy; and boxes that bboxDisplay shows. Billboards turn to the viewer if there
// is one, and sound does not meet shapes below them; LayoutLayers, LayoutGroups, ScreenGroups and text in points
// likewise depend on the picture. Threading: the scene's thread; the deltas may go to any other. Source: ISO/IEC
// 19775-1 V4.0 4.3.5, 10.4 (grouping), 10.4.4 (Transform), 10.4.3 (Switch), 23.4.3 (LOD), 35 (layers), 36 (layouts).
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

/// How a picture shows a layer; things with a size in pixels need it (36.2).
struct LayerSight {
    std::uint16_t layer = 0;                 // as Instance::layer
    int width = 0, height = 0;               // of the layer's rectangle in the picture, in pixels; above 0
    std::array<double, 4> part{0, 1, 0, 1};  // the rectangle's left, right, top and bottom, as shares of the picture
    Vec3d eye{0}, right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};
    enum class Kind : std::uint8_t { perspective, parallel, around } kind = Kind::perspective;
    /// Left, right, bottom and top edge: at distance 1 from the eye; `parallel`: in metres; `around`: in radians.
    std::array<double, 4> edges{-1, 1, -1, 1};
    double limit = std::numeric_limits<double>::infinity();  // nothing beyond is seen
    /// The height of a pixel, in the unit of the edges.
    double pixel() const { return (edges[3] - edges[2]) / height * std::min(glm::length(right), glm::length(up)); }
    struct Ray {
        Vec3d origin, direction;  // a unit vector
    };
    /// `x`, `y` from 0 (left, top) to 1 (right, bottom) of the rectangle.
    Ray ray(double x, double y) const;
    friend bool operator==(const LayerSight&, const LayerSight&) = default;
};
/// Whether two pictures have the same layout.
bool areOfOneSize(const std::vector<LayerSight>& a, const std::vector<LayerSight>& b);

/// The position in world space from which a picture is made.
struct EyePosition {
    EyePosition(const Vec3d& at, const Vec3d& above = Vec3d(0, 1, 0)) : position(at), up(above) {}
    Vec3d position, up;  // up: the picture's upward direction, of any length
    friend bool operator==(const EyePosition&, const EyePosition&) = default;
};

struct PictureSight {
    EyePosition eye{Vec3d(0)};
    std::vector<LayerSight> layers;
};

/// Makes the mesh of a geometry node; null if it has none. It is called once for each new or changed geometry; it does
/// not receive the points of skins.
using MeshSource = std::function<std::shared_ptr<const Mesh>(const Scene& scene, NodeId geometry)>;

class Flattener {
  public:
    struct Options {
        /// Makes the meshes. If it is empty, the flattener uses a Tessellator of its own, with the points of skins, and
        /// adds its diagnostics.
        MeshSource meshes;
        /// The largest number of paths to shapes; further ones are left out with a diagnostic. Sharing can make the
        /// number of paths exponential.
        std::size_t maxOccurrences = 8'000'000;
        /// How finely curved geometry is divided into triangles. An error in pixels is measured from the last picture's
        /// eye to the nearest place of a geometry, and chooses a level of the Tessellator. A finer level is used at
        /// once, a coarser one only if the present one is more than half a level too fine, so that an eye that sways
        /// changes nothing. Without an eye, or with a MeshSource, the Tessellator's own level is used. A place that
        /// moves away from an eye at rest keeps its level.
        TessellationError error{};
    };
    /// Statistics of curved geometry under Options::error.
    struct Cuts {
        std::size_t geometries = 0, triangles = 0;  // of curved geometry; each geometry once, however often it is used
        std::size_t tooCoarse = 0;                  // geometries whose finest level is coarser than the error asks for
        std::array<std::size_t, 8> ofLevel{};       // number of geometries at each level
        std::uint64_t created = 0;                  // meshes made since the start
    };
    Cuts cuts() const;

    Flattener();
    explicit Flattener(Options options);
    ~Flattener();
    Flattener(Flattener&&) noexcept;
    Flattener& operator=(Flattener&&) noexcept;

    /// Follows the scene, which must be in the state `changes.to`. The delta is valid until the next call. A snapshot
    /// first removes everything that was there.
    const InstanceDelta& apply(const Scene& scene, const ChangeSet& changes);

    /// Sets the source of meshes for geometry nodes of this type; existing nodes get new meshes with the next apply()
    /// or updateViewer().
    void setMeshSource(const Scene& scene, std::string_view type, MeshSource source);

    /// Sets the viewer, whose position chooses levels of LODs, and to whom Billboards turn; without one, every LOD
    /// shows its first level. Sound always meets the first level (Instance::seen, heard), so that a picture changes no
    /// sound. It takes effect with the next apply() or updateViewer(). `sights` are those of the picture, and give
    /// layouts, ScreenGroups and text in points their size. A layer without a sight is laid out as in a picture of 1280
    /// by 720 pixels; outside of LayoutLayers a pixel is then 1/96 inch.
    void setViewer(std::optional<EyePosition> eye, std::vector<LayerSight> sights = {});
    /// Updates for the viewer alone, between two frames.
    const InstanceDelta& updateViewer(const Scene& scene);

    /// Indexed by slot; the id of a free slot is none.
    const std::vector<Instance>& instances() const;
    const std::vector<Placed>& placed() const;
    std::size_t instanceCount() const;
    /// Whether sights are needed: something has its position or size in pixels, or lies in a layer, so that it turns to
    /// that layer's eye and pointers find it by that eye.
    bool usesPixels() const;
    /// The sights that setViewer() was given last.
    const std::vector<LayerSight>& sights() const;
    /// The path from a root node to the Shape, or to the node whose bounding box is displayed, both included.
    std::vector<NodeId> path(InstanceId instance) const;
    std::vector<NodeId> placedPath(InstanceId placed) const;
    ScopeId scopeParent(ScopeId scope) const;
    /// The nodes on the path whose content is placed by the picture, as indices into path(), each with its transform.
    std::vector<std::pair<std::size_t, WorldFromLocal>> byPicture(InstanceId instance) const;
    /// The number of a layer's node, as Instance::layer; 0 if the node is no layer.
    std::uint16_t layerOf(NodeId layer) const;
    /// A delta from nothing to the present state, for subscribers that join late.
    InstanceDelta snapshot() const;

    /// Diagnostics of paths that are left out and of tessellation. Each is reported once, however often a geometry
    /// changes.
    const Diagnostics& diagnostics() const;
    /// Flatteners made since the process started.
    static std::uint64_t created();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Follows a flattened scene, as light, sound, a rasteriser or an export does; see SharedWorld::add().
class InstanceSubscriber {
  public:
    virtual ~InstanceSubscriber() = default;
    /// Called on the scene's thread, in the order of attaching. `scene` and `changes` are for materials and the like.
    virtual Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) = 0;
    /// Returns a version of the tables that the last apply() made, for readers on any thread; null if it has none. It
    /// is called when a reader has asked (SharedWorld::latest()); its cost should follow the changes since the last
    /// one.
    virtual std::shared_ptr<const void> freeze() { return nullptr; }
    /// The size and eye of the pictures that it makes of such versions, for the layout of things in pixels; nothing if
    /// it makes no pictures. It is called before a version is made if the scene has anything in pixels.
    virtual std::optional<PictureSight> looksFrom() { return std::nullopt; }
    virtual std::string subscriberName() const { return "instance subscriber"; }
};

}  // namespace rtsg
