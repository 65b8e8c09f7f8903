// Asks the picker for what pointers and avatars meet.
#include <rtsg/renderers/world_queries.h>

#include <rtsg/core/scene.h>

#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/tessellate.h>

namespace rtsg {

bool WorldQueries::follow() {
    const auto updated = world_.update();
    if (!updated && !std::exchange(told_, true))
        world_.scene().diagnostics().error({}, "pointers meet nothing: " + updated.error().text);
    return updated.has_value();
}

std::optional<PointerHit> WorldQueries::firstHit(const Vec3d& origin, const Vec3d& direction) {
    if (!follow()) return std::nullopt;
    const auto pick = Picker(world_.rays(), world_.flattener()).ray(origin, direction);
    if (!pick) return std::nullopt;
    return hitOf(*pick);
}

std::optional<PointerHit> WorldQueries::hitOf(const Pick& pick) const {
    if (!pick) return std::nullopt;
    PointerHit hit{pick.point, pick.normal, {pick.texCoord.x, pick.texCoord.y}, pick.path};
    for (auto& [at, parentFromLocal] : world_.flattener().byPicture(pick.instance))
        hit.byPicture.push_back({at, parentFromLocal});
    return hit;
}

std::optional<PictureHit> WorldQueries::throughPicture(double x, double y, std::optional<NodeId> layer) {
    if (!follow()) return std::nullopt;
    const Flattener& flattener = world_.flattener();
    if (!flattener.usesPixels() || flattener.sights().empty()) return std::nullopt;
    std::optional<PictureHit> behind;
    const auto& sights = flattener.sights();
    for (auto sight = sights.rbegin(); sight != sights.rend(); ++sight) {
        if (layer && flattener.layerOf(*layer) != sight->layer) continue;
        const auto& [left, right, top, bottom] = sight->part;
        const double across = (x - left) / (right - left), down = (y - top) / (bottom - top);
        if (!layer && !(across >= 0 && across <= 1 && down >= 0 && down <= 1)) continue;
        const auto [origin, direction] = sight->ray(across, down);
        const bool isParallel = sight->kind == LayerSight::Kind::parallel;
        const PickPixel pixel = isParallel ? PickPixel{0, sight->pixel()} : PickPixel{sight->pixel(), 0};
        const auto pick = Picker(world_.rays(), flattener).ray(origin, direction, sight->layer, sight->limit, pixel);
        if (!pick) continue;
        PictureHit seen{origin, direction, hitOf(*pick)};
        if (seen.hit) return seen;
        if (!behind || sight->layer == 0) behind = std::move(seen);
    }
    return behind;
}

std::vector<std::vector<NodeId>> WorldQueries::within(const Vec3d& center, double radius) {
    std::vector<std::vector<NodeId>> paths;
    if (!follow()) return paths;
    const auto picks = Picker(world_.rays(), world_.flattener()).overlaps(center, radius, Surfaces::felt);
    if (!picks) return paths;
    for (const Pick& pick : *picks) paths.push_back(pick.path);
    return paths;
}

std::vector<Crossing> WorldQueries::crossings(const Vec3d& origin, const Vec3d& direction, double length) {
    return crossings(origin, direction, length, Surfaces::seen);
}

std::vector<Crossing> WorldQueries::obstacles(const Vec3d& origin, const Vec3d& direction, double length) {
    return crossings(origin, direction, length, Surfaces::felt);
}

std::vector<Crossing> WorldQueries::crossings(const Vec3d& origin, const Vec3d& direction, double length,
                                              Surfaces surfaces) {
    std::vector<Crossing> all;
    if (!follow()) return all;
    const auto picks = Picker(world_.rays(), world_.flattener()).crossings(origin, direction, length, surfaces);
    if (!picks) return all;
    for (const Pick& pick : *picks) all.push_back({pick.point, pick.normal, Vec3d(pick.texCoord), pick.path});
    return all;
}

namespace {

/// Nothing: it has no size.
std::optional<ShapeBox> boxOf(const RayInstance& instance, std::vector<NodeId> path) {
    if (!instance.mesh || instance.mesh->bounds.empty()) return {};
    const Bounds& bounds = instance.mesh->bounds;
    return ShapeBox{glm::dmat4(instance.info.worldFromLocal), Vec3d(bounds.min), Vec3d(bounds.max), std::move(path)};
}

}  // namespace

std::vector<ShapeBox> WorldQueries::boxes() {
    std::vector<ShapeBox> all;
    if (!follow()) return all;
    const Flattener& flattener = world_.flattener();
    for (const Instance& instance : flattener.instances()) {
        if (!instance.id || !instance.seen || instance.boundingBox) continue;
        if (auto box = boxOf(world_.rays().instance(instance.id.slot), flattener.path(instance.id)))
            all.push_back(std::move(*box));
    }
    return all;
}

std::vector<Meeting> WorldQueries::meetings(const Vec3d& center, double radius, TriangleTest& test) {
    std::vector<Meeting> all;
    if (!follow()) return all;
    const Flattener& flattener = world_.flattener();
    const auto picks = Picker(world_.rays(), flattener)
                           .overlaps(
                               center, radius, [&](const InstanceId& id) { return test.concerns(flattener.path(id)); },
                               [&](const std::array<Vec3d, 3>& triangle) { return test.meets(triangle); });
    if (!picks) return all;
    for (const Pick& pick : *picks)
        if (auto box = boxOf(world_.rays().instance(pick.instance.slot), pick.path))
            all.push_back({std::move(*box), pick.distance});
    return all;
}

std::vector<Vec3d> WorldQueries::corners(const Node& geometry) {
    std::vector<Vec3d> points;
    const auto mesh = tessellate(world_.scene(), geometry.id());
    if (!mesh || !*mesh) return points;
    std::vector<bool> used((*mesh)->positions.size());
    for (std::uint32_t i = 0; i < (*mesh)->triangleCount + (*mesh)->strokeCount; ++i)
        for (const std::uint32_t corner : {0u, 1u, 2u}) used[(*mesh)->vertexIndex(i, corner)] = true;
    for (std::size_t i = 0; i < used.size(); ++i)
        if (used[i]) points.emplace_back((*mesh)->positions[i]);
    return points;
}

}  // namespace rtsg
