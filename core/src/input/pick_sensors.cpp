// Finds what pick sensors meet (ISO/IEC 19775-1 V4.0, clause 38) when a frame begins (38.2.2), in the state that the
// last frame left, and sends it as events of the root: replicas and replays need no geometry.
//
// Primitives are solid whatever sides of them are drawn (38.4.4), a volume is the convex hull of its geometry (38.4.5).
// Where the clause says nothing: a sensor stands where its first path leads; "BOUNDS" compares the boxes of the two
// geometries, each along the axes of its own coordinates, "GEOMETRY" their surfaces; "ALL", too, reports in order of
// distance, and "ANY" reports the closest; points are in the sensor's coordinates.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <type_traits>

#include <fmt/format.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>

#include "box_overlap.h"
#include "convex_body.h"
#include "pick_report.h"
#include "state/state.h"

namespace rtsg {

namespace {

constexpr std::size_t kMaxElements = 65'536;     // segments or points of one sensor
constexpr std::size_t kMaxSurfaces = 1'000'000;  // that all sensors together meet in a frame
constexpr std::size_t kMaxTests = 20'000'000;    // of triangles against points of a body, all sensors, in a frame
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Path = std::vector<NodeId>;
using Segment = std::array<Vec3d, 2>;

bool areNumbers(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool contains(const Array<String>& list, std::string_view text) {
    return std::ranges::any_of(list, [&](const String& one) { return one.view() == text; });
}

/// A field of this name and type; otherwise nothing.
template <class T>
const T* findField(const Node& node, std::string_view name) {
    const FieldIndex index = node.type().findExact(name);
    if (index == kNoField || node.type().fields[index].type != FieldTypeOf<T>::value) return nullptr;
    return &node.get(Field<T>{index});
}

// ---- the picking geometry --------------------------------------------------------------------------------------

std::vector<Vec3d> coordinatesOf(const Scene& scene, const Node& geometry) {
    std::vector<Vec3d> points;
    const NodeId* id = findField<NodeId>(geometry, "coord");
    const Node* coord = id ? scene.effectiveNode(*id) : nullptr;
    if (!coord) return points;
    if (const auto* single = findField<Array<Vec3f>>(*coord, "point"))
        for (const Vec3f& p : *single) points.emplace_back(p);
    else if (const auto* twice = findField<Array<Vec3d>>(*coord, "point"))
        points.assign(twice->begin(), twice->end());
    return points;
}

std::vector<Segment> segmentsOf(const Scene& scene, const Node& geometry) {
    std::vector<Segment> segments;
    const std::vector<Vec3d> points = coordinatesOf(scene, geometry);
    if (geometry.is(x3d::LineSet::type)) {
        std::size_t first = 0;
        for (const std::int32_t count : geometry.get(x3d::LineSet::vertexCount)) {
            const std::size_t end = std::min(points.size(), first + static_cast<std::size_t>(std::max(0, count)));
            for (std::size_t i = first; i + 1 < end; ++i) segments.push_back({points[i], points[i + 1]});
            first = end;
        }
    } else if (geometry.is(x3d::IndexedLineSet::type)) {
        std::int64_t before = -1;
        for (const std::int32_t index : geometry.get(x3d::IndexedLineSet::coordIndex)) {
            const bool isPoint = index >= 0 && static_cast<std::size_t>(index) < points.size();
            if (isPoint && before >= 0)
                segments.push_back({points[static_cast<std::size_t>(before)], points[static_cast<std::size_t>(index)]});
            before = isPoint ? index : -1;
        }
    }
    return segments;
}

struct Box {
    Vec3d low{kInfinity}, high{-kInfinity};
    bool empty() const { return !(low.x <= high.x && low.y <= high.y && low.z <= high.z); }
};

bool isPrimitive(const Node& geometry) {
    return geometry.is(x3d::Box::type) || geometry.is(x3d::Cone::type) || geometry.is(x3d::Cylinder::type) ||
           geometry.is(x3d::Sphere::type);
}

/// The box of a geometry in its own coordinates; if it is no primitive, the box of `corners`, which may be empty.
Box boundsOf(const Node& geometry, std::span<const Vec3d> corners) {
    const auto about = [](const Vec3d& half) { return Box{-half, half}; };
    if (geometry.is(x3d::Box::type)) return about(Vec3d(geometry.get(x3d::Box::size)) * .5);
    if (geometry.is(x3d::Sphere::type)) return about(Vec3d(double(geometry.get(x3d::Sphere::radius))));
    if (geometry.is(x3d::Cone::type)) {
        const double r = geometry.get(x3d::Cone::bottomRadius);
        return about({r, geometry.get(x3d::Cone::height) * .5, r});
    }
    if (geometry.is(x3d::Cylinder::type)) {
        const double r = geometry.get(x3d::Cylinder::radius);
        return about({r, geometry.get(x3d::Cylinder::height) * .5, r});
    }
    Box box;
    for (const Vec3d& p : corners) {
        box.low = glm::min(box.low, p);
        box.high = glm::max(box.high, p);
    }
    return box;
}

/// Precondition: as of boundsOf(); its box is not empty.
ConvexBody bodyOf(const Node& geometry, const Box& bounds, std::span<const Vec3d> corners) {
    const Vec3d half = bounds.high;
    if (geometry.is(x3d::Box::type)) return ConvexBody::box(half);
    if (geometry.is(x3d::Sphere::type)) return ConvexBody::sphere(half.x);
    if (geometry.is(x3d::Cone::type)) return ConvexBody::cone(half.x, half.y);
    if (geometry.is(x3d::Cylinder::type)) return ConvexBody::cylinder(half.x, half.y);
    return ConvexBody::hull({corners.begin(), corners.end()});
}

// ---- what may be picked ----------------------------------------------------------------------------------------

/// 38.3.1, 38.3.2: of the labels of a pickable object and of a sensor.
bool labelsMatch(const Array<String>& object, const Array<String>& sensor, std::string_view criterion) {
    if (contains(object, "NONE") || contains(sensor, "NONE")) return false;
    if (contains(object, "ALL") || contains(sensor, "ALL")) return true;
    std::size_t matches = 0;
    for (const String& one : sensor) matches += contains(object, one.view()) ? 1 : 0;
    if (criterion == "MATCH_EVERY") return matches == sensor.size() && matches > 0;
    return criterion == "MATCH_ONLY_ONE" ? matches == 1 : matches > 0;
}

/// One thing that is picked, and where.
struct Picked {
    NodeId geometry;
    double distance = kInfinity;
    std::vector<std::pair<double, PickedSurface>> surfaces;
};

/// Data that the sensors of a frame share.
struct Round {
    SpaceQueries& queries;
    std::map<NodeId, std::vector<Vec3d>>& corners;           // as Scene::State::pickCorners
    std::optional<std::vector<ShapeBox>> boxes{};            // of all Shapes, once somebody has needed them
    std::size_t surfaces = kMaxSurfaces, tests = kMaxTests;  // how many more there may be
};

template <class N>
class Picking final : private TriangleTest {
  public:
    Picking(const Scene& scene, const Node& sensor, Round& round, std::vector<std::string>& warnings)
        : scene_(scene), sensor_(sensor), round_(round), warnings_(warnings) {}

    PickReport go() {
        PickReport report{sensor_.id(), {}, {}};
        const Node* geometry = scene_.effectiveNode(sensor_.get(N::pickingGeometry));
        if (!geometry || sensor_.get(N::pickTarget).empty()) return report;
        WorldTransforms positions(scene_);
        worldFromSensor_ = positions.worldFromLocal(sensor_.id(), scene_.root());
        const double volume = glm::determinant(worldFromSensor_);
        if (volume == 0 || !std::isfinite(volume)) return report;
        sensorFromWorld_ = glm::inverse(worldFromSensor_);
        const bool exact = sensor_.get(N::intersectionType).view() == "GEOMETRY";
        if constexpr (std::is_same_v<N, x3d::PointPickSensor>)
            pickByPoints(*geometry, exact);
        else if (std::is_same_v<N, x3d::LinePickSensor> && exact)
            pickByLines(*geometry);
        else
            pickByBody(*geometry, exact);
        sortInto(report);
        return report;
    }

  private:
    static bool isOf(const Node& geometry) {
        if (std::is_same_v<N, x3d::PointPickSensor>) return geometry.is(x3d::PointSet::type);
        if (std::is_same_v<N, x3d::LinePickSensor>)
            return geometry.is(x3d::LineSet::type) || geometry.is(x3d::IndexedLineSet::type);
        return !std::is_same_v<N, x3d::PrimitivePickSensor> || isPrimitive(geometry);
    }
    bool accepts(const Node& geometry) {
        if (!isOf(geometry)) warnings_.push_back(fmt::format("picks nothing by a {}", geometry.type().name));
        return isOf(geometry);
    }

    /// The node that is reported for a Shape on this path: the last one on it that belongs to the document of the pick
    /// target, so that nobody is handed the inside of a PROTO instance or an Inline. None if the Shape is not to be
    /// picked.
    NodeId pickable(const Path& path) const {
        const auto& targets = sensor_.get(N::pickTarget);
        const auto isTarget = [&](NodeId id) { return std::ranges::find(targets, id) != targets.end(); };
        const auto target = std::ranges::find_if(path, isTarget);
        if (target == path.end()) return {};
        const NodeId scope = scene_.node(*target).scope();
        NodeId reported;
        bool anyLabels = false;
        for (auto it = path.begin(); it != path.end(); ++it) {
            const Node& node = scene_.node(*it);
            if (it >= target && node.scope() == scope) reported = *it;
            if (!node.type().isA("X3DPickableObject")) continue;
            const bool* on = findField<bool>(node, "pickable");
            if (on && !*on) return {};
            const auto* labels = findField<Array<String>>(node, "objectType");
            if (!labels) continue;
            anyLabels = true;
            if (!labelsMatch(*labels, sensor_.get(N::objectType), sensor_.get(N::matchCriterion).view())) return {};
        }
        // A Shape that is in no pickable object matches every label.
        if (!anyLabels && (sensor_.get(N::objectType).empty() || contains(sensor_.get(N::objectType), "NONE")))
            return {};
        return reported;
    }

    Picked* pickedAt(const Path& path) {
        if (const auto known = picked_.find(path); known != picked_.end())
            return known->second.geometry ? &known->second : nullptr;
        Picked& one = picked_[path];
        one.geometry = pickable(path);
        return one.geometry ? &one : nullptr;
    }

    template <class E>
    void limit(std::vector<E>& elements) {
        if (elements.size() <= kMaxElements) return;
        warnings_.push_back(fmt::format("picks by the first {} of its lines or points", kMaxElements));
        elements.resize(kMaxElements);
    }

    /// 38.4.1: the hit that is closest to the first vertex of its segment comes first.
    void pickByLines(const Node& geometry) {
        if (!accepts(geometry)) return;
        std::vector<Segment> segments = segmentsOf(scene_, geometry);
        limit(segments);
        const glm::dmat3 normalToSensor = glm::transpose(glm::dmat3(worldFromSensor_));
        for (const Segment& segment : segments) {
            const Vec3d from = toWorld(segment[0]), along = toWorld(segment[1]) - from;
            const double length = glm::length(along);
            if (!areNumbers(from) || !(length > 0) || !std::isfinite(length)) continue;
            for (const Crossing& crossing : crossings(from, along, length)) {
                Picked* one = pickedAt(crossing.path);
                if (!one) continue;
                const double distance = glm::distance(from, crossing.point);
                const Vec3d normal = normalToSensor * crossing.normal;
                const double size = glm::length(normal);
                one->distance = std::min(one->distance, distance);
                one->surfaces.emplace_back(
                    distance, PickedSurface{Vec3f(Vec3d(sensorFromWorld_ * glm::dvec4(crossing.point, 1))),
                                            size > 0 ? Vec3f(normal / size) : Vec3f(0), Vec3f(crossing.texCoord)});
            }
        }
    }

    /// 38.4.3: points have no distance. A point is inside a surface if a ray from it and the opposite ray both cross
    /// the surface an odd number of times; open surfaces contain nothing.
    void pickByPoints(const Node& geometry, bool exact) {
        if (!accepts(geometry)) return;
        std::vector<Vec3d> points = coordinatesOf(scene_, geometry);
        limit(points);
        for (const Vec3d& local : points) {
            const Vec3d point = toWorld(local);
            if (!areNumbers(point)) continue;
            for (const Path& path : exact ? pathsAround(point) : pathsOfBoxesAround(point))
                if (Picked* one = pickedAt(path)) {
                    one->distance = 0;
                    one->surfaces.emplace_back(0, PickedSurface{Vec3f(local), {}, {}});
                }
        }
    }
    std::vector<Path> pathsAround(const Vec3d& point) {
        // Along no edge or diagonal that authors are likely to draw.
        const Vec3d skew = glm::normalize(Vec3d(.5377, .6180, .5736));
        std::map<Path, std::array<std::size_t, 2>> counts;
        for (const std::size_t side : {0u, 1u})
            for (Crossing& crossing : crossings(point, side == 0 ? skew : -skew, kInfinity))
                ++counts[std::move(crossing.path)][side];
        std::vector<Path> paths;
        for (const auto& [path, count] : counts)
            if (count[0] % 2 == 1 && count[1] % 2 == 1) paths.push_back(path);
        return paths;
    }
    std::vector<Path> pathsOfBoxesAround(const Vec3d& point) {
        std::vector<Path> paths;
        for (const ShapeBox& box : boxes()) {
            const double volume = glm::determinant(box.worldFromShape);
            if (volume == 0 || !std::isfinite(volume)) continue;
            const Vec3d local = glm::inverse(box.worldFromShape) * glm::dvec4(point, 1);
            if (glm::all(glm::lessThanEqual(box.low, local)) && glm::all(glm::lessThanEqual(local, box.high)))
                paths.push_back(box.path);
        }
        return paths;
    }

    /// The corners of a geometry: for a VolumePickSensor those of its triangles, for lines and points all that they
    /// might use.
    std::span<const Vec3d> cornersOf(const Node& geometry) {
        if (isPrimitive(geometry)) return {};
        if (!std::is_same_v<N, x3d::VolumePickSensor>) return coordinates_ = coordinatesOf(scene_, geometry);
        const auto [known, isNew] = round_.corners.try_emplace(geometry.id());
        if (isNew) {
            known->second = round_.queries.corners(geometry);
            std::erase_if(known->second, [](const Vec3d& p) { return !areNumbers(p); });
        }
        limit(known->second);
        return known->second;
    }

    void pickByBody(const Node& geometry, bool exact) {
        if (!accepts(geometry)) return;
        const std::span<const Vec3d> corners = cornersOf(geometry);
        const Box own = boundsOf(geometry, corners);
        if (own.empty()) {
            if (std::is_same_v<N, x3d::VolumePickSensor>)
                warnings_.push_back(fmt::format("picks nothing by its {}, which has no corners", geometry.type().name));
            return;
        }
        const Vec3d middle = (own.low + own.high) * .5;
        // 38.4.4: of a cone the closest is that to its vertex.
        const bool fromApex = std::is_same_v<N, x3d::PrimitivePickSensor> && geometry.is(x3d::Cone::type);
        const Vec3d origin = toWorld(fromApex ? Vec3d(0, own.high.y, 0) : middle);
        const auto take = [&](const ShapeBox& box, const double* nearest) {
            Picked* one = pickedAt(box.path);
            if (!one) return;
            const Vec3d at(box.worldFromShape * glm::dvec4((box.low + box.high) * .5, 1));
            one->distance = nearest ? *nearest : glm::distance(origin, at);
        };
        if (exact) {
            body_ = bodyOf(geometry, own, corners);
            double radius = 0;
            for (const double x : {own.low.x, own.high.x})
                for (const double y : {own.low.y, own.high.y})
                    for (const double z : {own.low.z, own.high.z})
                        radius = std::max(radius, glm::distance(origin, toWorld({x, y, z})));
            if (!areNumbers(origin) || !std::isfinite(radius)) return;
            radius *= 1 + 1e-6;  // what touches a corner of the body, too
            // 38.4.5: volumes sort by the middles of the boxes.
            for (const Meeting& one : round_.queries.meetings(origin, radius, *this))
                take(one.box, std::is_same_v<N, x3d::VolumePickSensor> ? nullptr : &one.distance);
            return;
        }
        for (const ShapeBox& box : boxes()) {
            const glm::dmat4 local = sensorFromWorld_ * box.worldFromShape;
            const Vec3d half = (box.high - box.low) * .5, at(local * glm::dvec4((box.low + box.high) * .5, 1));
            const glm::dvec3 edges[3] = {glm::dvec3(local[0]) * half.x, glm::dvec3(local[1]) * half.y,
                                         glm::dvec3(local[2]) * half.z};
            if (areNumbers(at) && boxesMeet((own.high - own.low) * .5, at - middle, edges)) take(box, nullptr);
        }
    }
    bool concerns(const Path& path) override { return pickedAt(path) != nullptr; }
    bool meets(const std::array<Vec3d, 3>& corners) override {
        const std::size_t cost = body_->pointCount();
        if (round_.tests < cost) {
            warnings_.push_back(
                fmt::format("pick sensors test more than {} triangles in a frame, each as often as a volume has "
                            "corners: what is beyond is left out",
                            kMaxTests));
            round_.tests = 0;
            return false;
        }
        round_.tests -= cost;
        ConvexBody::Triangle local;
        for (std::size_t i = 0; i < 3; ++i) local[i] = Vec3d(sensorFromWorld_ * glm::dvec4(corners[i], 1));
        return body_->meets(local);
    }

    void sortInto(PickReport& report) {
        std::vector<Picked*> all;
        for (auto& [path, one] : picked_)
            if (one.geometry && one.distance < kInfinity) all.push_back(&one);
        std::ranges::stable_sort(all, {}, &Picked::distance);
        const std::string_view order = sensor_.get(N::sortOrder).view();
        if (order != "ALL" && order != "ALL_SORTED" && !all.empty()) all.erase(all.begin() + 1, all.end());
        for (Picked* one : all) {
            if (std::ranges::find(report.geometry, one->geometry) == report.geometry.end())
                report.geometry.push_back(one->geometry);
            std::ranges::stable_sort(one->surfaces, {}, [](const auto& surface) { return surface.first; });
            for (const auto& surface : one->surfaces) report.surfaces.push_back(surface.second);
        }
    }

    std::vector<Crossing> crossings(const Vec3d& from, const Vec3d& along, double length) {
        if (round_.surfaces == 0) return {};
        auto found = round_.queries.crossings(from, along, length);
        round_.surfaces -= std::min(round_.surfaces, found.size() + 1);
        if (round_.surfaces == 0)
            warnings_.push_back(fmt::format(
                "pick sensors meet more than {} surfaces in a frame: what is beyond is left out", kMaxSurfaces));
        return found;
    }

    const std::vector<ShapeBox>& boxes() {
        if (!round_.boxes) round_.boxes = round_.queries.boxes();
        return *round_.boxes;
    }
    Vec3d toWorld(const Vec3d& p) const { return Vec3d(worldFromSensor_ * glm::dvec4(p, 1)); }

    const Scene& scene_;
    const Node& sensor_;
    Round& round_;
    std::vector<std::string>& warnings_;
    std::vector<Vec3d> coordinates_;
    std::optional<ConvexBody> body_;
    glm::dmat4 worldFromSensor_{1}, sensorFromWorld_{1};
    std::map<Path, Picked> picked_;  // what is not to be picked without geometry
};

std::string nameFor(const Scene& scene, const Node& node) {
    const std::string_view name = scene.name(node.id());
    return name.empty() ? std::to_string(node.id().value) : std::string(name);
}

/// Whether a sensor's outputs say this already.
template <class N>
bool isReported(const Node& node, const PickReport& report) {
    if (node.get(N::isActive) == report.geometry.empty()) return false;
    if (!std::ranges::equal(node.get(N::pickedGeometry), report.geometry)) return false;
    if constexpr (requires { N::pickedPoint; })
        if (!std::ranges::equal(node.get(N::pickedPoint), report.surfaces, {}, {}, &PickedSurface::point)) return false;
    if constexpr (requires { N::pickedNormal; })
        if (!std::ranges::equal(node.get(N::pickedNormal), report.surfaces, {}, {}, &PickedSurface::normal) ||
            !std::ranges::equal(node.get(N::pickedTextureCoordinate), report.surfaces, {}, {},
                                &PickedSurface::texCoord))
            return false;
    return true;
}

}  // namespace

bool Scene::State::isPickSensor(TypeIndex type) {
    return type == x3d::LinePickSensor::type || type == x3d::PointPickSensor::type ||
           type == x3d::PrimitivePickSensor::type || type == x3d::VolumePickSensor::type;
}

void Scene::State::pick() {
    // The aspects of fields on which a sensor's answer depends. Labels and switches of sensors and groups have the
    // aspect none.
    constexpr std::uint32_t kConcerned = aspectBit(Aspect::structure) | aspectBit(Aspect::transform) |
                                         aspectBit(Aspect::view) | aspectBit(Aspect::geometry) |
                                         aspectBit(Aspect::none);
    constexpr std::uint32_t kShapes = aspectBit(Aspect::structure) | aspectBit(Aspect::geometry);
    if (((touched | touchedBefore) & kShapes) != 0) pickCorners.clear();
    if (!queries || pickSensors.empty() || ((touched | touchedBefore) & kConcerned) == 0) return;
    // The queries may edit the scene to bring themselves up to date; so call them before anything is held.
    (void)queries->crossings({}, {0, 0, -1}, 0);
    Round round{*queries, pickCorners};
    const auto evaluate = [&]<class N>(const Node& node) {
        if (!node.get(N::enabled)) return;
        std::vector<std::string> warnings;
        PickReport report{node.id(), {}, {}};
        if (isInScene(owner, node.id())) report = Picking<N>(owner, node, round, warnings).go();
        for (const std::string& text : warnings)
            if (warned.emplace(node.id(), text).second)
                diagnostics.warning({}, fmt::format("{} {}: {}", node.type().name, nameFor(owner, node), text));
        if (!isReported<N>(node, report))
            inputQueue.push_back({owner.root(), x3d::RtsgScene::picked.index, Value(report.toValue())});
    };
    for (const NodeId id : std::vector<NodeId>(pickSensors)) {
        if (!find(id)) continue;
        const Node& node = *find(id);
        if (node.is(x3d::LinePickSensor::type)) evaluate.operator()<x3d::LinePickSensor>(node);
        if (node.is(x3d::PointPickSensor::type)) evaluate.operator()<x3d::PointPickSensor>(node);
        if (node.is(x3d::PrimitivePickSensor::type)) evaluate.operator()<x3d::PrimitivePickSensor>(node);
        if (node.is(x3d::VolumePickSensor::type)) evaluate.operator()<x3d::VolumePickSensor>(node);
    }
}

}  // namespace rtsg
