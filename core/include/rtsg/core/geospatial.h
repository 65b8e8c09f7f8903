// Places the nodes of the Geospatial component in a scene: converts their coordinates, and subtracts their GeoOrigins.
//
// A scene without a GeoOrigin is in geocentric metres. All numbers are double. Threading: the scene's thread. Source:
// ISO/IEC 19775-1 V4.0 25.2.5, 25.3.
#pragma once

#include <optional>

#include <rtsg/core/geo_system.h>

namespace rtsg {

class Node;
class NodeType;
class Scene;

/// Maps a node's coordinates into the scene's, as its geoSystem and geoOrigin say (25.2.5).
class GeoReference {
  public:
    /// The reference of a node of this component. Errors: those of GeoSystem::read(), for the node or its GeoOrigin.
    static Result<GeoReference> of(const Scene& scene, const Node& node);

    const GeoSystem& system() const { return system_; }
    /// Converts to metres in the coordinates around the node, and back.
    Vec3d toScene(const Vec3d& coordinates) const;
    Vec3d fromScene(const Vec3d& point) const;
    /// The transform from a frame at the point, whose x points east, y up and -z north.
    glm::dmat4 transformAt(const Vec3d& coordinates) const;

  private:
    GeoSystem system_;
    Vec3d origin_{0};         // of the scene, geocentric
    glm::dmat3 rotation_{1};  // from geocentric directions to the scene's
};

/// Whether nodes of this type place their children by geographic coordinates (GeoLocation, GeoTransform), or themselves
/// (GeoViewpoint).
bool isGeoTransform(const NodeType& type);
/// The GeoOrigin of a node of this component; null if it has none.
const Node* geoOriginOf(const Scene& scene, const Node& node);
/// The transform from the coordinates in such a node to those around it. The inside of a GeoViewpoint has x to the east
/// and y up at the ground below it. Error: as for GeoReference::of().
Result<glm::dmat4> geoTransform(const Scene& scene, const Node& node);

/// The points of a GeoCoordinate relative to an anchor, which is the first finite point, so that single precision is
/// enough. Error: as for GeoReference::of().
struct AnchoredPoints {
    Vec3d anchor{0};  // metres, in the coordinates around the geometry
    Array<Vec3f> points;
};
Result<AnchoredPoints> geoPoints(const Scene& scene, const Node& coordinate);
/// The anchor alone, for a GeoCoordinate or a GeoElevationGrid; nothing for other nodes, and for those with an error.
std::optional<Vec3d> geoAnchor(const Scene& scene, const Node& node);

}  // namespace rtsg
