// Reads geometry nodes of a scene into the plain structs that the tessellators take.
#include <fmt/format.h>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "particles.h"
#include "shapes/tessellate_deform.h"
#include "shapes/tessellate_nurbs.h"
#include "shapes/tessellate_text.h"

namespace rtsg {

namespace {

using detail::ComposedParams;
using detail::warn;
using Kind = PrimitiveSetParams::Kind;

/// Reads the nodes that a geometry refers to; what cannot be used is noted in `problems`.
class PropertyReader {
  public:
    PropertyReader(const Scene& scene, Mesh& problems, const detail::PointsOf* points = nullptr)
        : scene_(scene), problems_(problems), points_(points) {}

    Array<Vec3f> points(NodeId id) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return {};
        if (const Array<Vec3f>* moved = movedOf(*node)) return *moved;
        if (node->is(x3d::Coordinate::type)) return node->get(x3d::Coordinate::point);
        if (node->is(x3d::CoordinateDouble::type)) {
            const Array<Vec3d>& source = node->get(x3d::CoordinateDouble::point);
            Array<Vec3f> result = Array<Vec3f>::ofSize(source.size());
            Vec3f* out = result.mutableData();
            for (std::size_t i = 0; i < source.size(); ++i) out[i] = Vec3f(source[i]);
            return result;
        }
        if (node->is(x3d::GeoCoordinate::type)) {
            auto placed = geoPoints(scene_, *node);
            if (placed) return anchor_ = placed->anchor, std::move(placed->points);
            warn(problems_, fmt::format("coord: GeoCoordinate: {}: nothing is drawn", placed.error().text));
            return {};
        }
        notUsed("coord", *node);
        return {};
    }
    /// The Mesh::anchor of the points that were read last.
    const Vec3d& anchor() const { return anchor_; }

    void colors(NodeId id, auto& params) {
        const Node* color = scene_.effectiveNode(id);
        if (!color) return;
        if (color->is(x3d::Color::type))
            params.color = color->get(x3d::Color::color);
        else if (color->is(x3d::ColorRGBA::type))
            params.colorRGBA = color->get(x3d::ColorRGBA::color);
        else
            notUsed("color", *color);
    }

    /// For the nodes of X3DComposedGeometryNode, whose common fields have their own handles in each type.
    template <class T>
    void surface(const Node& node, SurfaceParams& params) {
        params.ccw = node.get(T::ccw);
        params.solid = node.get(T::solid);
        params.colorPerVertex = node.get(T::colorPerVertex);
        params.normalPerVertex = node.get(T::normalPerVertex);
        colors(node.get(T::color), params);
        normals(node.get(T::normal), params.normal);
        texCoord(node.get(T::texCoord), params.texCoord, true);
        if constexpr (requires { T::fogCoord; }) fogCoord(node.get(T::fogCoord), params.fogDepth);
        if constexpr (requires { T::tangent; }) tangent(node.get(T::tangent), params.tangent);
    }

    void normals(NodeId id, Array<Vec3f>& vectors) {
        const Node* normal = scene_.effectiveNode(id);
        if (!normal) return;
        if (const Array<Vec3f>* moved = movedOf(*normal))
            vectors = *moved;
        else if (normal->is(x3d::Normal::type))
            vectors = normal->get(x3d::Normal::vector);
        else
            notUsed("normal", *normal);
    }

    void fogCoord(NodeId id, Array<float>& depths) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return;
        if (node->is(x3d::FogCoordinate::type))
            depths = node->get(x3d::FogCoordinate::depth);
        else
            notUsed("fogCoord", *node);
    }

  private:
    /// The points or normals of a node as joints have moved them; null if none do.
    const Array<Vec3f>* movedOf(const Node& node) const {
        if (!points_) return nullptr;
        const auto found = points_->find(node.id().value);
        return found == points_->end() ? nullptr : &found->second;
    }
    void tangent(NodeId id, Array<Vec4f>& tangents) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return;
        if (node->is(x3d::Tangent::type))
            tangents = node->get(x3d::Tangent::vector);
        else
            notUsed("tangent", *node);
    }
    void texCoord(NodeId id, std::vector<TexCoordParams>& channels, bool mayBeMulti) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return;
        if (mayBeMulti && node->is(x3d::MultiTextureCoordinate::type)) {
            for (const NodeId channel : node->get(x3d::MultiTextureCoordinate::texCoord))
                texCoord(channel, channels, false);
            return;
        }
        TexCoordParams channel;
        if (node->is(x3d::TextureCoordinate::type)) {
            channel.point = node->get(x3d::TextureCoordinate::point);
            channel.mapping = node->get(x3d::TextureCoordinate::mapping);
        } else if (node->is(x3d::TextureCoordinate3D::type)) {
            channel.point3 = node->get(x3d::TextureCoordinate3D::point);
            channel.mapping = node->get(x3d::TextureCoordinate3D::mapping);
        } else if (node->is(x3d::TextureCoordinate4D::type)) {
            channel.point4 = node->get(x3d::TextureCoordinate4D::point);
            channel.mapping = node->get(x3d::TextureCoordinate4D::mapping);
        } else if (node->is(x3d::TextureCoordinateGenerator::type)) {
            const String& mode = node->get(x3d::TextureCoordinateGenerator::mode);
            channel.mapping = node->get(x3d::TextureCoordinateGenerator::mapping);
            channel.fromPosition = mode.view() == "COORD";
            using G = TexCoords::Generator;
            constexpr std::pair<std::string_view, G> kModes[] = {
                {"SPHERE", G::sphere},
                {"CAMERASPACENORMAL", G::cameraSpaceNormal},
                {"CAMERASPACEPOSITION", G::cameraSpacePosition},
                {"CAMERASPACEREFLECTIONVECTOR", G::cameraSpaceReflection},
                {"SPHERE-LOCAL", G::sphereLocal},
                {"COORD-EYE", G::coordEye},
                {"NOISE", G::noise},
                {"NOISE-EYE", G::noiseEye},
                {"SPHERE-REFLECT", G::sphereReflect},
                {"SPHERE-REFLECT-LOCAL", G::sphereReflectLocal},
                {"WORLDSPACENORMAL", G::worldSpaceNormal},
                {"WORLDSPACEREFLECTIONVECTOR", G::worldSpaceReflection},
            };
            for (const auto& [name, generator] : kModes)
                if (mode.view() == name) channel.generator = generator;
            for (const float p : node->get(x3d::TextureCoordinateGenerator::parameter)) channel.parameter.push_back(p);
            if (!channel.fromPosition && channel.generator == G::none) {
                warn(problems_,
                     fmt::format("TextureCoordinateGenerator mode {} is not known: taken as SPHERE", mode.view()));
                channel.generator = G::sphere;
            }
        } else {
            notUsed("texCoord", *node);
            return;
        }
        channels.push_back(std::move(channel));
    }

    void notUsed(const char* field, const Node& node) {
        warn(problems_, fmt::format("{}: {} is not supported here and left out", field, node.type().name));
    }

    const Scene& scene_;
    Mesh& problems_;
    const detail::PointsOf* points_;
    Vec3d anchor_{0};
};

/// The fields of a composed geometry node.
class ComposedReader {
  public:
    ComposedReader(const Scene& scene, const Node& node, Mesh& problems, const detail::PointsOf* points)
        : node_(node), properties_(scene, problems, points) {}

    ComposedParams read() {
        switch (node_.typeIndex().value) {
            case x3d::TriangleSet::type.value:
                return set<x3d::TriangleSet>(Kind::triangleSet);
            case x3d::TriangleStripSet::type.value:
                return set<x3d::TriangleStripSet>(Kind::triangleStripSet);
            case x3d::TriangleFanSet::type.value:
                return set<x3d::TriangleFanSet>(Kind::triangleFanSet);
            case x3d::QuadSet::type.value:
                return set<x3d::QuadSet>(Kind::quadSet);
            case x3d::IndexedTriangleSet::type.value:
                return set<x3d::IndexedTriangleSet>(Kind::indexedTriangleSet);
            case x3d::IndexedTriangleStripSet::type.value:
                return set<x3d::IndexedTriangleStripSet>(Kind::indexedTriangleStripSet);
            case x3d::IndexedTriangleFanSet::type.value:
                return set<x3d::IndexedTriangleFanSet>(Kind::indexedTriangleFanSet);
            case x3d::IndexedQuadSet::type.value:
                return set<x3d::IndexedQuadSet>(Kind::indexedQuadSet);
            default:
                return faces();
        }
    }

  private:
    template <class T>
    const T& get(Field<T> field) const {
        return node_.get(field);
    }

    IndexedFaceSetParams faces() {
        using T = x3d::IndexedFaceSet;
        IndexedFaceSetParams p;
        properties_.surface<T>(node_, p);
        p.coord = properties_.points(get(T::coord));
        p.anchor = properties_.anchor();
        p.coordIndex = get(T::coordIndex);
        p.colorIndex = get(T::colorIndex);
        p.normalIndex = get(T::normalIndex);
        p.texCoordIndex = get(T::texCoordIndex);
        p.convex = get(T::convex);
        p.creaseAngle = get(T::creaseAngle);
        return p;
    }

    template <class T>
    PrimitiveSetParams set(Kind kind) {
        PrimitiveSetParams p;
        p.kind = kind;
        properties_.surface<T>(node_, p);
        p.coord = properties_.points(get(T::coord));
        p.anchor = properties_.anchor();
        if constexpr (requires { T::index; }) p.index = get(T::index);
        if constexpr (requires { T::stripCount; }) p.count = get(T::stripCount);
        if constexpr (requires { T::fanCount; }) p.count = get(T::fanCount);
        return p;
    }

    const Node& node_;
    PropertyReader properties_;
};

class SceneTessellator {
  public:
    SceneTessellator(const Scene& scene, const Node& node, const TessellationOptions& options, detail::TextMaker* text,
                     const detail::PointsOf* points)
        : scene_(scene),
          node_(node),
          options_(options),
          text_(text),
          points_(points),
          properties_(scene, problems_, points) {}

    Mesh run() {
        Mesh mesh = dispatch();
        problems_.diagnostics.append(mesh.diagnostics);
        mesh.diagnostics = std::move(problems_.diagnostics);
        return mesh;
    }

  private:
    template <class T>
    const T& get(Field<T> field) const {
        return node_.get(field);
    }

    Mesh dispatch() {
        if (detail::isComposed(node_))
            return std::visit(
                [](const auto& p) {
                    Mesh mesh = tessellate(p);
                    mesh.anchor = p.anchor;
                    return mesh;
                },
                detail::readComposed(scene_, node_, problems_, points_));
        if (detail::isNurbs(node_)) return detail::tessellateNurbs(scene_, node_, options_);
        switch (node_.typeIndex().value) {
            case x3d::Box::type.value:
                return tessellate(BoxParams{get(x3d::Box::size), get(x3d::Box::solid)});
            case x3d::Sphere::type.value:
                return tessellate(SphereParams{get(x3d::Sphere::radius), get(x3d::Sphere::solid)}, options_);
            case x3d::Cone::type.value:
                return tessellate(ConeParams{get(x3d::Cone::bottomRadius), get(x3d::Cone::height), get(x3d::Cone::side),
                                             get(x3d::Cone::bottom), get(x3d::Cone::solid)},
                                  options_);
            case x3d::Cylinder::type.value:
                return tessellate(
                    CylinderParams{get(x3d::Cylinder::radius), get(x3d::Cylinder::height), get(x3d::Cylinder::side),
                                   get(x3d::Cylinder::top), get(x3d::Cylinder::bottom), get(x3d::Cylinder::solid)},
                    options_);
            case x3d::ElevationGrid::type.value:
                return grid();
            case x3d::GeoElevationGrid::type.value:
                return geoGrid();
            case x3d::Extrusion::type.value:
                return extrusion();
            case x3d::Disk2D::type.value:
                return tessellate(
                    Disk2DParams{get(x3d::Disk2D::innerRadius), get(x3d::Disk2D::outerRadius), get(x3d::Disk2D::solid)},
                    options_);
            case x3d::Rectangle2D::type.value:
                return tessellate(Rectangle2DParams{get(x3d::Rectangle2D::size), get(x3d::Rectangle2D::solid)});
            case x3d::TriangleSet2D::type.value:
                return tessellate(
                    TriangleSet2DParams{get(x3d::TriangleSet2D::vertices), get(x3d::TriangleSet2D::solid)});
            case x3d::ArcClose2D::type.value:
                return arc();
            case x3d::PointSet::type.value:
            case x3d::LineSet::type.value:
            case x3d::IndexedLineSet::type.value:
            case x3d::Polypoint2D::type.value:
            case x3d::Polyline2D::type.value:
                return strokes();
            case x3d::Arc2D::type.value:
                return tessellate(
                    Arc2DParams{get(x3d::Arc2D::startAngle), get(x3d::Arc2D::endAngle), get(x3d::Arc2D::radius)},
                    options_);
            case x3d::Circle2D::type.value:
                return tessellate(Arc2DParams{0, 0, get(x3d::Circle2D::radius)}, options_);
            case x3d::Text::type.value: {
                const TextParams params = detail::readText(scene_, node_, problems_);
                return text_ ? text_->make(params, options_) : tessellate(params, options_);
            }
            default:
                break;
        }
        Mesh mesh;
        warn(mesh, "has no triangles, lines or points that could be made here: it is not drawn");
        return mesh;
    }

    Mesh grid() {
        using T = x3d::ElevationGrid;
        ElevationGridParams p;
        properties_.surface<T>(node_, p);
        p.height = get(T::height);
        p.xDimension = get(T::xDimension);
        p.zDimension = get(T::zDimension);
        p.xSpacing = get(T::xSpacing);
        p.zSpacing = get(T::zSpacing);
        p.creaseAngle = get(T::creaseAngle);
        return tessellate(p);
    }

    /// 25.3.2: heights above the ellipsoid, on a grid of longitudes and latitudes, or of eastings and northings.
    Mesh geoGrid() {
        using T = x3d::GeoElevationGrid;
        Mesh none;
        const std::int32_t columns = get(T::xDimension), rows = get(T::zDimension);
        if (columns < 2 || rows < 2) return none;
        const auto reference = GeoReference::of(scene_, node_);
        if (!reference || reference->system().kind == GeoSystem::Kind::geocentric) {
            warn(none, fmt::format("{}: nothing is drawn",
                                   reference ? "geoSystem: GC has no heights" : reference.error().text));
            return none;
        }
        const Array<double>& height = get(T::height);
        const std::size_t drawn = detail::gridRowsToDraw(none, height.size(), static_cast<std::size_t>(columns),
                                                         static_cast<std::size_t>(rows));
        if (drawn < 2) return none;
        PointGridParams p;
        surface(p);
        p.columns = columns;
        p.creaseAngle = static_cast<float>(get(T::creaseAngle));
        p.anchor = geoAnchor(scene_, node_).value_or(Vec3d(0));
        p.coord = Array<Vec3f>::ofSize(drawn * static_cast<std::size_t>(columns));
        Vec3f* out = p.coord.mutableData();
        std::size_t at = 0;
        for (std::size_t j = 0; j < drawn; ++j)
            for (std::int32_t i = 0; i < columns; ++i, ++at) {
                const double up = at < height.size() ? height[at] : 0;
                *out++ = Vec3f(reference->toScene(gridPoint(*reference, i, double(j), up)) - p.anchor);
            }
        Mesh mesh = tessellate(p);
        mesh.diagnostics.append(none.diagnostics);
        return mesh;
    }
    /// Coordinates in the grid's system.
    Vec3d gridPoint(const GeoReference& reference, double column, double row, double height) const {
        using T = x3d::GeoElevationGrid;
        Vec3d by(row * get(T::zSpacing), column * get(T::xSpacing), height * double(get(T::yScale)));
        if (reference.system().isSwapped) std::swap(by.x, by.y);
        return get(T::geoGridOrigin) + by;
    }
    void surface(PointGridParams& p) { properties_.surface<x3d::GeoElevationGrid>(node_, p); }

    Array<Vec3f> flat(const Array<Vec2f>& points) {
        Array<Vec3f> result = Array<Vec3f>::ofSize(points.size());
        Vec3f* out = result.mutableData();
        for (const Vec2f& p : points) *out++ = Vec3f(p, 0);
        return result;
    }
    template <class T>
    void coordinates(StrokeParams& p) {
        p.coord = properties_.points(get(T::coord));
        properties_.colors(get(T::color), p);
        properties_.fogCoord(get(T::fogCoord), p.fogDepth);
        properties_.normals(get(T::normal), p.normal);
    }
    Mesh strokes() {
        StrokeParams p;
        if (node_.is(x3d::PointSet::type)) {
            p.kind = Mesh::Strokes::points;
            coordinates<x3d::PointSet>(p);
        } else if (node_.is(x3d::Polypoint2D::type)) {
            p.kind = Mesh::Strokes::points;
            p.coord = flat(get(x3d::Polypoint2D::point));
        } else if (node_.is(x3d::LineSet::type)) {
            coordinates<x3d::LineSet>(p);
            p.vertexCount = get(x3d::LineSet::vertexCount);
        } else if (node_.is(x3d::IndexedLineSet::type)) {
            using T = x3d::IndexedLineSet;
            coordinates<T>(p);
            p.indexed = true;
            p.coordIndex = get(T::coordIndex), p.colorIndex = get(T::colorIndex);
            p.colorPerVertex = get(T::colorPerVertex);
        } else {
            p.coord = flat(get(x3d::Polyline2D::lineSegments));
            if (!p.coord.empty()) p.vertexCount = {static_cast<std::int32_t>(p.coord.size())};
        }
        Mesh mesh = tessellate(p);
        mesh.anchor = properties_.anchor();
        if (node_.is(x3d::LineSet::type) && p.vertexCount.empty() && !p.coord.empty())
            warn(mesh, fmt::format("vertexCount is empty: of {} points no line is drawn", p.coord.size()));
        return mesh;
    }

    Mesh extrusion() {
        using T = x3d::Extrusion;
        ExtrusionParams p;
        p.crossSection = get(T::crossSection);
        p.orientation = get(T::orientation);
        p.scale = get(T::scale);
        p.spine = get(T::spine);
        p.beginCap = get(T::beginCap);
        p.endCap = get(T::endCap);
        p.ccw = get(T::ccw);
        p.convex = get(T::convex);
        p.solid = get(T::solid);
        p.creaseAngle = get(T::creaseAngle);
        return tessellate(p);
    }

    Mesh arc() {
        using T = x3d::ArcClose2D;
        ArcClose2DParams p;
        const std::string_view closure = get(T::closureType).view();
        if (closure == "CHORD")
            p.closure = ArcClose2DParams::Closure::chord;
        else if (closure != "PIE")
            warn(problems_, fmt::format("closureType \"{}\" is neither PIE nor CHORD: taken as PIE", closure));
        p.startAngle = get(T::startAngle);
        p.endAngle = get(T::endAngle);
        p.radius = get(T::radius);
        p.solid = get(T::solid);
        return tessellate(p, options_);
    }

    const Scene& scene_;
    const Node& node_;
    const TessellationOptions& options_;
    detail::TextMaker* text_;
    const detail::PointsOf* points_;
    Mesh problems_;  // only its diagnostics
    PropertyReader properties_;
};

}  // namespace

bool detail::isComposed(const Node& geometry) {
    switch (geometry.typeIndex().value) {
        case x3d::IndexedFaceSet::type.value:
        case x3d::TriangleSet::type.value:
        case x3d::TriangleStripSet::type.value:
        case x3d::TriangleFanSet::type.value:
        case x3d::QuadSet::type.value:
        case x3d::IndexedTriangleSet::type.value:
        case x3d::IndexedTriangleStripSet::type.value:
        case x3d::IndexedTriangleFanSet::type.value:
        case x3d::IndexedQuadSet::type.value:
            return true;
        default:
            return false;
    }
}

detail::ComposedParams detail::readComposed(const Scene& scene, const Node& geometry, Mesh& problems,
                                            const PointsOf* points) {
    return ComposedReader(scene, geometry, problems, points).read();
}

Array<Vec3f> detail::readPoints(const Scene& scene, NodeId coordinate, Mesh& problems) {
    return PropertyReader(scene, problems).points(coordinate);
}

void detail::labelDiagnostics(const Scene& scene, const Node& geometry, Mesh& mesh) {
    if (mesh.diagnostics.all().empty()) return;
    const std::string_view name = scene.name(geometry.id());
    const std::string label = name.empty() ? geometry.type().name : fmt::format("{} {}", geometry.type().name, name);
    const NodeLocation location = scene.locationOf(geometry.id());
    Diagnostics named(location.file);
    for (const Diagnostic& d : mesh.diagnostics.all()) named.add(d.severity, location.where, label + ": " + d.text);
    mesh.diagnostics = std::move(named);
}

std::shared_ptr<const Mesh> detail::particlesNode(const Scene& scene, const Node& system,
                                                  const TessellationOptions& options, TextMaker* text,
                                                  std::optional<Vec3d> eye) {
    std::shared_ptr<Mesh> mesh(new Mesh);
    Diagnostics problems;
    const MeshOf meshOf = [&](NodeId id) -> std::shared_ptr<const Mesh> {
        const Node* node = scene.effectiveNode(id);
        if (!node || !node->type().isA("X3DGeometryNode")) return nullptr;
        auto created = tessellateNode(scene, id, options, text);
        if (!created) return nullptr;
        problems.append((*created)->diagnostics);
        return *created;
    };
    *mesh = tessellateParticles(scene, system, meshOf, eye);
    problems.append(mesh->diagnostics);
    mesh->diagnostics = std::move(problems);
    return mesh;
}

Vec3f detail::volumeSize(const Node& volume) {
    if (volume.is(x3d::VolumeData::type)) return volume.get(x3d::VolumeData::dimensions);
    if (volume.is(x3d::SegmentedVolumeData::type)) return volume.get(x3d::SegmentedVolumeData::dimensions);
    return volume.get(x3d::IsoSurfaceVolumeData::dimensions);
}

namespace {

/// The box around it, which pointers meet from inside too.
std::shared_ptr<const Mesh> volumeBox(const Scene& scene, const Node& volume) {
    const Vec3f size = detail::volumeSize(volume);
    std::shared_ptr<Mesh> mesh(new Mesh);
    if (size.x > 0 && size.y > 0 && size.z > 0 && std::isfinite(size.x + size.y + size.z))
        *mesh = tessellate(BoxParams{.size = size, .solid = false});
    else
        mesh->diagnostics.warning(
            {}, fmt::format("dimensions {} {} {} are not above 0: nothing is drawn", size.x, size.y, size.z));
    detail::labelDiagnostics(scene, volume, *mesh);
    return mesh;
}

}  // namespace

Result<std::shared_ptr<const Mesh>> detail::tessellateNode(const Scene& scene, NodeId geometry,
                                                           const TessellationOptions& options, TextMaker* text,
                                                           const PointsOf* points) {
    const Node* node = scene.effectiveNode(geometry);
    if (const Node* named = scene.find(geometry); !node && named && named->is(x3d::InlineGeometry::type))
        return std::make_shared<const Mesh>();  // not loaded: whoever loads has said why
    if (!node) return fail(fmt::format("node {} does not exist or has no body", geometry.value));
    if (node->is(x3d::ParticleSystem::type)) return particlesNode(scene, *node, options, text, std::nullopt);
    if (node->type().isA("X3DVolumeDataNode")) return volumeBox(scene, *node);
    if (!node->type().isA("X3DGeometryNode")) return fail(fmt::format("{} is not a geometry node", node->type().name));
    std::shared_ptr<Mesh> mesh(new Mesh(SceneTessellator(scene, *node, options, text, points).run()));
    detail::labelDiagnostics(scene, *node, *mesh);
    return mesh;
}

Result<std::shared_ptr<const Mesh>> tessellate(const Scene& scene, NodeId geometry,
                                               const TessellationOptions& options) {
    return detail::tessellateNode(scene, geometry, options, nullptr);
}

}  // namespace rtsg
