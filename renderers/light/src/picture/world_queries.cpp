// Asks the picker for the hits of pointers and avatars.
#include <rtsg/renderers/world_queries.h>

#include <string_view>
#include <tuple>
#include <utility>

#include <rtsg/core/navigation.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/tessellate.h>

#include "seen_surfaces.h"
#include "tables/light_tables.h"
#include "texture/texture_store.h"

namespace rtsg {

namespace {

/// Whether something in the fields of an Appearance can leave a part of a front clear. Films never do.
bool mayBeClear(const Scene& scene, NodeId appearance) {
    using A = x3d::Appearance;
    const Node* node = scene.effectiveNode(appearance);
    if (!node || !node->is(A::type)) return false;
    // Most instances have none of the nodes that would have to be looked up.
    const auto find = [&](NodeId id) { return id ? scene.effectiveNode(id) : nullptr; };
    if (const Node* fill = find(node->get(A::fillProperties));
        fill && fill->is(x3d::FillProperties::type) && !fill->get(x3d::FillProperties::filled))
        return true;
    const std::string_view mode = node->get(A::alphaMode).view();
    if (mode == "OPAQUE") return false;
    if (mode == "MASK") return true;
    const auto isPicture = [&](NodeId texture) {
        const Node* shown = find(texture);
        return shown && !shown->is(x3d::MovieTexture::type);
    };
    const auto has = [&](NodeId id) {
        const Node* material = find(id);
        if (!material) return false;
        if (material->is(x3d::Material::type)) return isPicture(material->get(x3d::Material::diffuseTexture));
        if (material->is(x3d::PhysicalMaterial::type))
            return isPicture(material->get(x3d::PhysicalMaterial::baseTexture));
        return material->is(x3d::UnlitMaterial::type) && isPicture(material->get(x3d::UnlitMaterial::emissiveTexture));
    };
    return isPicture(node->get(A::texture)) || has(node->get(A::material)) || has(node->get(A::backMaterial));
}

/// By which that layer of the picture is seen.
Camera cameraOf(const LayerSight& sight) {
    Camera camera;
    camera.position = sight.eye, camera.right = sight.right, camera.up = sight.up, camera.forward = sight.forward;
    std::tie(camera.left, camera.rightEdge, camera.bottom, camera.top) = std::tuple_cat(sight.edges);
    camera.orthographic = sight.kind == LayerSight::Kind::parallel;
    camera.panorama = sight.kind == LayerSight::Kind::around;
    return camera;
}

}  // namespace

/// Answers by the present nodes. Textures that cannot be read are reported by pictures, and not again here.
class WorldQueries::Seen final : public trace::SurfacesInPicture {
  public:
    Seen(SharedWorld& world, Resources resources) : world_(world), resources_(std::move(resources)) {}
    /// Sets the sight of the picture whose rays are asked; null: other rays.
    void useSight(const LayerSight* sight) { sight_ = sight; }

  protected:
    Drawn drawn(const RayInstance& instance) const override {
        if (!textures_)
            textures_ = std::static_pointer_cast<TextureStore>(world_.shared(
                TextureStore::nameOf(resources_), [&] { return std::make_shared<TextureStore>(resources_); }));
        Diagnostics unheard;
        auto material = std::make_shared<const Material>(
            readMaterial(world_.scene(), instance.info.appearance, *textures_, unheard));
        trace::SlotShading slot;
        slot.channels = trace::channelsOf(*material, instance.mesh.get());
        return {std::move(material), slot};
    }
    bool mayBeClear(const RayInstance& instance) const override {
        return rtsg::mayBeClear(world_.scene(), instance.info.appearance);
    }
    trace::TraceScene sceneFor(const RayView& view, const Ray& ray) const override {
        trace::TraceScene scene;
        if (sight_) {
            scene.pixelOf(view, cameraOf(*sight_), sight_->height);
            return scene;
        }
        const glm::dquat rotation = viewerPose(world_.scene()).orientation;
        scene.eye = ray.origin, scene.forward = Vec3f(rotation * Vec3d(0, 0, -1));
        scene.right = Vec3f(rotation * Vec3d(1, 0, 0)), scene.up = Vec3f(rotation * Vec3d(0, 1, 0));
        return scene;
    }

  private:
    SharedWorld& world_;
    Resources resources_;
    mutable std::shared_ptr<TextureStore> textures_;  // from when one is asked for
    const LayerSight* sight_ = nullptr;
};

WorldQueries::WorldQueries(SharedWorld& world, Resources resources)
    : WorldQueries([&world]() -> SharedWorld& { return world; }, std::move(resources)) {}
WorldQueries::WorldQueries(std::function<SharedWorld&()> make, Resources resources)
    : make_(std::move(make)), resources_(std::move(resources)) {}
WorldQueries::~WorldQueries() = default;

bool WorldQueries::follow() {
    if (!world_) {
        world_ = &make_();
        seen_ = std::make_unique<Seen>(*world_, resources_);
    }
    const auto updated = world_->update();
    if (!updated && !std::exchange(reported_, true))
        world_->scene().diagnostics().error({}, "pointers meet nothing: " + updated.error().text);
    return updated.has_value();
}

std::optional<PointerHit> WorldQueries::firstHit(const Vec3d& origin, const Vec3d& direction) {
    if (!follow()) return std::nullopt;
    seen_->useSight(nullptr);
    auto pick = Picker(world_->rays(), world_->flattener()).ray(origin, direction, *seen_);
    if (!pick) return std::nullopt;
    return hitOf(std::move(*pick));
}

std::optional<PointerHit> WorldQueries::hitOf(Pick&& pick) const {
    if (!pick) return std::nullopt;
    std::optional<PointerHit> result(std::in_place, pick.point, pick.normal, Vec2d(pick.texCoord),
                                     std::move(pick.path));
    PointerHit& hit = *result;
    for (auto& [at, parentFromLocal] : world_->flattener().byPicture(pick.instance))
        hit.byPicture.push_back({at, parentFromLocal});
    return result;
}

std::optional<PictureHit> WorldQueries::throughPicture(double x, double y, std::optional<NodeId> layer) {
    if (!follow()) return std::nullopt;
    const Flattener& flattener = world_->flattener();
    if (!flattener.usesPixels() || flattener.sights().empty()) return std::nullopt;
    std::optional<PictureHit> behind;
    const auto& sights = flattener.sights();
    for (auto sight = sights.rbegin(); sight != sights.rend(); ++sight) {
        if (layer && flattener.layerOf(*layer) != sight->layer) continue;
        const auto& [left, right, top, bottom] = sight->part;
        const double across = (x - left) / (right - left), down = (y - top) / (bottom - top);
        if (!layer && !(across >= 0 && across <= 1 && down >= 0 && down <= 1)) continue;
        const auto [origin, direction] = sight->ray(across, down);
        seen_->useSight(&*sight);
        const PixelLens lens = trace::lensOf(world_->rays(), cameraOf(*sight), sight->height);
        auto pick = Picker(world_->rays(), flattener)
                        .ray(origin, direction, sight->layer, sight->limit, lens, nullptr, seen_.get());
        if (!pick) continue;
        PictureHit seen{origin, direction, hitOf(std::move(*pick))};
        if (seen.hit) return seen;
        if (!behind || sight->layer == 0) behind = std::move(seen);
    }
    return behind;
}

std::vector<std::vector<NodeId>> WorldQueries::within(const Vec3d& center, double radius) {
    std::vector<std::vector<NodeId>> paths;
    if (!follow()) return paths;
    const auto picks = Picker(world_->rays(), world_->flattener()).overlaps(center, radius, Surfaces::felt);
    if (!picks) return paths;
    for (const Pick& pick : *picks) paths.push_back(pick.path);
    return paths;
}

std::vector<Crossing> WorldQueries::crossings(const Vec3d& origin, const Vec3d& direction, double length) {
    return crossings(origin, direction, length, Surfaces::seen);
}

std::vector<Crossing> WorldQueries::obstacles(const Vec3d& origin, const Vec3d& direction, double length) {
    if (!rules_.stops(length)) return {};
    return crossings(origin, direction, length, Surfaces::felt);
}

std::vector<Crossing> WorldQueries::crossings(const Vec3d& origin, const Vec3d& direction, double length,
                                              Surfaces surfaces) {
    std::vector<Crossing> all;
    if (!follow()) return all;
    const auto picks = Picker(world_->rays(), world_->flattener()).crossings(origin, direction, length, surfaces);
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
    const Flattener& flattener = world_->flattener();
    for (const Instance& instance : flattener.instances()) {
        if (!instance.id || !instance.seen || instance.boundingBox) continue;
        if (auto box = boxOf(world_->rays().instance(instance.id.slot), flattener.path(instance.id)))
            all.push_back(std::move(*box));
    }
    return all;
}

std::vector<Meeting> WorldQueries::meetings(const Vec3d& center, double radius, TriangleTest& test) {
    return meetings(center, radius, test, Surfaces::seen);
}

std::vector<Meeting> WorldQueries::obstaclesNear(const Vec3d& center, double radius, TriangleTest& test) {
    if (!rules_.walls) return {};
    return meetings(center, radius, test, Surfaces::felt);
}

std::vector<Meeting> WorldQueries::meetings(const Vec3d& center, double radius, TriangleTest& test, Surfaces surfaces) {
    std::vector<Meeting> all;
    if (!follow()) return all;
    const Flattener& flattener = world_->flattener();
    const auto picks = Picker(world_->rays(), flattener)
                           .overlaps(
                               center, radius, [&](const InstanceId& id) { return test.concerns(flattener.path(id)); },
                               [&](const std::array<Vec3d, 3>& triangle) { return test.meets(triangle); }, surfaces);
    if (!picks) return all;
    for (const Pick& pick : *picks)
        if (auto box = boxOf(world_->rays().instance(pick.instance.slot), pick.path))
            all.push_back({std::move(*box), pick.distance});
    return all;
}

std::vector<Vec3d> WorldQueries::corners(const Node& geometry) {
    std::vector<Vec3d> points;
    if (!follow()) return points;
    const auto mesh = tessellate(world_->scene(), geometry.id());
    if (!mesh || !*mesh) return points;
    std::vector<bool> used((*mesh)->positions.size());
    for (std::uint32_t i = 0; i < (*mesh)->triangleCount + (*mesh)->strokeCount; ++i)
        for (const std::uint32_t corner : {0u, 1u, 2u}) used[(*mesh)->vertexIndex(i, corner)] = true;
    for (std::size_t i = 0; i < used.size(); ++i)
        if (used[i]) points.emplace_back((*mesh)->positions[i]);
    return points;
}

}  // namespace rtsg
