// Places the nodes of the Geospatial component in a scene: reads their systems, and subtracts their GeoOrigins.
//
// A scene without a GeoOrigin is in geocentric metres. All in double. Threading: the scene's thread. Source: ISO/IEC
// 19775-1 V4.0 25.2.5, 25.3.
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
    /// Metres, in the coordinates around the node.
    Vec3d toScene(const Vec3d& coordinates) const;
    Vec3d fromScene(const Vec3d& point) const;
    /// The frame at the point, whose x points east, y up and -z north.
    glm::dmat4 placeOf(const Vec3d& coordinates) const;

  private:
    GeoSystem system_;
    Vec3d origin_{0};     // of the scene, geocentric
    glm::dmat3 turn_{1};  // from geocentric directions to the scene's
};

/// Whether nodes of this type move what is below them by geographic coordinates: GeoLocation, GeoTransform; or, of a
/// GeoViewpoint, themselves.
bool isGeoPlace(const NodeType& type);
/// The GeoOrigin that a node of this component has; null if it has none.
const Node* geoOriginOf(const Scene& scene, const Node& node);
/// From the coordinates in such a node to those around it. A GeoViewpoint's are those of the ground below it: x to the
/// east, y up. Error: as GeoReference::of().
Result<glm::dmat4> geoPlace(const Scene& scene, const Node& node);

/// The points of a GeoCoordinate as they lie around an anchor, which is the first of them that is finite: so that
/// single precision is enough for them. Error: as GeoReference::of().
struct AnchoredPoints {
    Vec3d anchor{0};  // metres, in the coordinates around the geometry
    Array<Vec3f> points;
};
Result<AnchoredPoints> geoPoints(const Scene& scene, const Node& coordinate);
/// The anchor alone, of the coordinates or of a GeoElevationGrid; none for other nodes, and for those with an error.
std::optional<Vec3d> geoAnchor(const Scene& scene, const Node& node);

}  // namespace rtsg
