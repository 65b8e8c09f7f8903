// Visits the whole scene every frame and hands the differences to a RayWorld of its own.
#include "full_traversal.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <unordered_map>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include "flatten/bounding_boxes.h"
#include "flatten/flattener_roles.h"
#include "flatten/layout.h"

namespace rtsg {

using flatten::Role;
using flatten::TypeRole;

struct FullTraversalRenderer::Impl {
    struct Level {
        WorldFromLocal worldFromLocal;
        std::uint64_t key;  // of the path
        bool hidden;
        std::uint16_t layer = 0;
        std::optional<flatten::Region> region = std::nullopt;  // that it is laid out in
    };
    struct Known {
        Instance instance;
        std::uint64_t seen = 0;  // frame
    };
    /// A geometry's fields and those of the nodes it refers to, as they were when its mesh was made. Holding the values
    /// keeps their arrays from being freed, and so a new array from being mistaken for an old one.
    struct Shot {
        NodeId node;
        FieldIndex field;
        Value value;
    };
    struct Geometry {
        std::vector<Shot> shots;
        std::uint64_t checked = 0, seen = 0;
        std::shared_ptr<const Mesh> mesh;
        bool inPixels() const { return mesh && mesh->inPixels; }
    };
    /// A box that is displayed by a node whose content is being visited.
    struct OpenBox {
        NodeId owner;
        std::size_t depth;  // in the stack
        std::optional<Bounds> authored;
        flatten::WorldBox content;
    };

    Impl(const RayWorld::Options& options, MeshSource source) : meshes(std::move(source)), world(options) {}

    Result<> enter(FullTraversalRenderer& renderer, const Node& node);
    void leave();
    void layOut(const Node& node, const TypeRole& role, Level& level);
    void toPixels(Level& level) const;
    void shape(const Node& node, const TypeRole& role, const Level& level);
    void note(Instance now, std::uint64_t key);
    void checkGeometry(NodeId id);
    void take(NodeId id, std::vector<Shot>& shots) const;

    MeshSource meshes;
    RayWorld world;
    InstanceDelta delta;
    flatten::RoleTable roles;
    std::vector<Level> stack;
    std::vector<OpenBox> open;
    std::unordered_map<std::uint64_t, Known> known;  // by path
    std::unordered_map<std::uint32_t, Geometry> geometries;
    std::vector<std::uint32_t> freeSlots, freedSlots;
    std::uint32_t slots = 0, generation = 0;
    std::uint64_t frame = 0;
    const Scene* scene = nullptr;
    std::vector<NodeId> below;
    std::vector<LayerSight> sights;
    NodeId layerSet;  // whose layers are entered
    Stats stats;
};

namespace {

std::uint64_t mix(std::uint64_t h, std::uint64_t v) {
    h = (h ^ v) * 0x9E3779B97F4A7C15ull;
    h = (h ^ h >> 32) * 0xD6E8FEB86659FD93ull;
    return h ^ h >> 29;
}

}  // namespace

Result<> FullTraversalRenderer::Impl::enter(FullTraversalRenderer& renderer, const Node& node) {
    ++stats.nodesVisited;
    const TypeRole& role = roles.of(node);
    Level level = stack.back();
    level.key = mix(level.key, node.id().value);
    if (role.visible != kNoField && !flatten::read<bool>(node, role.visible)) level.hidden = true;
    if (role.bboxDisplay != kNoField && flatten::read<bool>(node, role.bboxDisplay))
        open.push_back({node.id(), stack.size(), flatten::authoredBox(node, role), {}});
    if (role.role == Role::shape) {
        shape(node, role, level);
        stack.push_back(level);
        return {};
    }
    WorldFromLocal local;
    if (layerSet && !level.layer) {
        const auto& layers = scene->node(layerSet).get(x3d::LayerSet::layers);
        if (const auto* at = std::find(layers.begin(), layers.end(), node.id()); at != layers.end())
            level.layer = static_cast<std::uint16_t>(at - layers.begin() + 1);
    }
    if (role.layout != kNoField)
        layOut(node, role, level);
    else if (node.is(x3d::ScreenGroup::type))
        toPixels(level);
    else if (role.hasTransform && flatten::localTransform(*scene, node, role, local))
        level.worldFromLocal = compose(level.worldFromLocal, local);
    if (node.is(x3d::LayerSet::type)) layerSet = node.id();
    stack.push_back(level);
    below.clear();
    flatten::desiredChildren(node, role, 0, below);
    renderer.descend(below, collect);
    return {};
}

void FullTraversalRenderer::Impl::leave() {
    const Level level = stack.back();
    stack.pop_back();
    if (open.empty() || open.back().depth != stack.size()) return;
    const OpenBox box = open.back();
    open.pop_back();
    const std::optional<WorldFromLocal> worldFromLocal =
        flatten::transformOfEdges(box.authored ? flatten::worldBox(*box.authored, level.worldFromLocal) : box.content);
    if (!worldFromLocal) return;
    Instance now = flatten::edgesInstance(*scene, box.owner, *worldFromLocal);
    now.layer = level.layer;
    Geometry& edges = geometries[now.geometry.value];
    if (std::exchange(edges.seen, frame) == 0) delta.geometries.push_back({now.geometry, flatten::boxEdges()});
    constexpr std::uint64_t kBox = 0xB0B0;  // no child's number leads to the same key
    note(now, mix(level.key, kBox << 32));
}

void FullTraversalRenderer::Impl::layOut(const Node& node, const TypeRole& role, Level& level) {
    const bool outermost = node.is(x3d::LayoutLayer::type);
    if (!outermost && !level.region) return;
    if (outermost) level.region = flatten::wholeRegion(flatten::sightOf(sights, level.layer));
    const Node* layout = scene->find(flatten::resolve(*scene, roles, flatten::read<NodeId>(node, role.layout)));
    if (!layout || !layout->is(x3d::Layout::type)) return;
    Diagnostics problems;  // the flattener tells of them
    WorldFromLocal local;
    level.region = flatten::layOut(flatten::readLayout(*scene, *layout, problems), outermost, *level.region, local);
    level.worldFromLocal = compose(level.worldFromLocal, local);
}

void FullTraversalRenderer::Impl::toPixels(Level& level) const {
    const LayerSight* sight = flatten::sightOf(sights, level.layer);
    const double pixel = flatten::pixelAt(sight, level.region.has_value(), level.worldFromLocal[3]);
    WorldFromLocal local;
    if (flatten::scaleToPixels(level.worldFromLocal, pixel, local))
        level.worldFromLocal = compose(level.worldFromLocal, local);
}

void FullTraversalRenderer::Impl::shape(const Node& node, const TypeRole& role, const Level& level) {
    if (level.hidden && std::ranges::all_of(open, [](const OpenBox& b) { return b.authored.has_value(); })) return;
    Instance now;
    now.shape = node.id();
    now.geometry = flatten::geometryOf(*scene, roles, node);
    now.appearance = flatten::appearanceOf(*scene, roles, node);
    now.volume = role.isVolume;
    now.castShadow = !role.isVolume && flatten::read<bool>(node, role.castShadow);
    now.strokes = flatten::strokeStyle(*scene, now.appearance);
    now.layer = level.layer;
    now.worldFromLocal = level.worldFromLocal;
    if (now.geometry) checkGeometry(now.geometry);
    const Geometry* geometry = now.geometry ? &geometries[now.geometry.value] : nullptr;
    if (geometry && geometry->inPixels()) {
        Level own = level;
        toPixels(own);
        now.worldFromLocal = own.worldFromLocal;
    }
    if (geometry && geometry->mesh && geometry->mesh->anchor != Vec3d(0))
        now.worldFromLocal = compose(now.worldFromLocal, flatten::movedBy(geometry->mesh->anchor));
    if (geometry && geometry->mesh && !(level.hidden && geometry->inPixels()) && !open.empty()) {
        const flatten::WorldBox box = flatten::worldBox(*geometry->mesh, now.worldFromLocal);
        for (OpenBox& around : open) around.content.extend(box);
    }
    if (!level.hidden) note(now, level.key);
}

void FullTraversalRenderer::Impl::note(Instance now, std::uint64_t key) {
    Known* known_ = &known[key];
    while (known_->seen == frame) known_ = &known[key = mix(key, 1)];  // the same path twice: a child listed twice
    const bool isNew = known_->seen == 0;
    known_->seen = frame;
    Instance& before = known_->instance;
    if (isNew) {
        if (freeSlots.empty()) {
            now.id = {slots++, generation};
        } else {
            now.id = {freeSlots.back(), generation};
            freeSlots.pop_back();
        }
        before = now;
        delta.added.push_back(now);
        return;
    }
    now.id = before.id;
    const bool restyled =
        now.strokes && before.strokes ? *now.strokes != *before.strokes : now.strokes != before.strokes;
    if (now.geometry != before.geometry || now.appearance != before.appearance || now.castShadow != before.castShadow ||
        restyled)
        delta.rebound.push_back(now);
    else if (now.worldFromLocal != before.worldFromLocal)
        delta.moved.push_back({now.id, now.worldFromLocal});
    before = now;
}

void FullTraversalRenderer::Impl::take(NodeId id, std::vector<Shot>& shots) const {
    // Geometry is shallow (IndexedFaceSet, TextureCoordinate below MultiTextureCoordinate), and the scene has no
    // cycles.
    const Node& node = scene->node(id);
    for (std::size_t i = 0; i < node.type().fields.size(); ++i) {
        const FieldDef& field = node.type().fields[i];
        if (!field.readable() || field.aspect == Aspect::none || field.aspect == Aspect::time) continue;
        const auto index = static_cast<FieldIndex>(i);
        shots.push_back({id, index, node.value(index)});
    }
    for (const FieldIndex i : node.type().nodeFields()) {
        if (!node.type().fields[i].readable() || node.type().fields[i].aspect == Aspect::none) continue;
        const Value value = node.value(i);
        if (value.type() == FieldType::SFNode) {
            if (const NodeId child = value.as<NodeId>(); child && scene->find(child)) take(child, shots);
        } else {
            for (const NodeId child : value.as<Array<NodeId>>())
                if (child && scene->find(child)) take(child, shots);
        }
    }
}

void FullTraversalRenderer::Impl::checkGeometry(NodeId id) {
    Geometry& geometry = geometries[id.value];
    if (std::exchange(geometry.seen, frame) == frame) return;
    bool same = geometry.checked != 0;
    for (std::size_t i = 0; same && i < geometry.shots.size(); ++i) {
        const Shot& shot = geometry.shots[i];
        const Node* node = scene->find(shot.node);
        same = node && equalStorage(shot.value.type(), node->storage(shot.field), shot.value.storage());
    }
    geometry.checked = frame;
    if (same) return;
    geometry.shots.clear();
    take(id, geometry.shots);
    std::shared_ptr<const Mesh> mesh;
    if (meshes)
        mesh = meshes(*scene, id);
    else if (auto created = tessellate(*scene, id))
        mesh = *std::move(created);
    geometry.mesh = mesh;
    delta.geometries.push_back({id, std::move(mesh)});
}

FullTraversalRenderer::FullTraversalRenderer(const RayWorld::Options& options, MeshSource meshes)
    : impl_(std::make_unique<Impl>(options, std::move(meshes))) {
    const NodeRenderer visit = nodeRendererFor<FullTraversalRenderer>(
        [](FullTraversalRenderer& r, const Node& n, Operation) { return r.impl_->enter(r, n); },
        [](FullTraversalRenderer& r, const Node&, Operation) { r.impl_->leave(); });
    flatten::forEachGroupType([&](std::string_view type) { registerNodeRenderer(type, visit); });
    registerNodeRenderer("Shape", visit);
    registerNodeRenderer("ParticleSystem", visit);
    registerNodeRenderer("X3DVolumeDataNode", visit);
}

FullTraversalRenderer::~FullTraversalRenderer() = default;

Result<> FullTraversalRenderer::attachToScene(Scene& scene) {
    if (Result<> result = Renderer::attachToScene(scene); !result) return result;
    impl_->scene = &scene;
    return renderFrame();
}

Result<> FullTraversalRenderer::renderFrame() {
    const auto start = std::chrono::steady_clock::now();
    Impl& i = *impl_;
    ++i.frame;
    ++i.generation;
    i.delta.clear();
    i.stats = {};
    i.freeSlots.insert(i.freeSlots.end(), i.freedSlots.begin(), i.freedSlots.end());
    i.freedSlots.clear();
    i.stack.assign(1, {identityTransform(), 0, false});
    i.layerSet = {};
    if (Result<> result = renderScene(collect); !result) return result;
    std::erase_if(i.known, [&](const auto& entry) {
        if (entry.second.seen == i.frame) return false;
        i.delta.removed.push_back(entry.second.instance.id);
        i.freedSlots.push_back(entry.second.instance.id.slot);
        return true;
    });
    std::erase_if(i.geometries, [&](const auto& entry) {
        if (entry.second.seen == i.frame) return false;
        i.delta.geometriesRemoved.push_back(NodeId{entry.first});
        return true;
    });
    i.stats.traverseSeconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    i.world.apply(i.delta);
    return {};
}

void FullTraversalRenderer::setSights(std::vector<LayerSight> sights) {
    impl_->sights = std::move(sights);
}

const RayWorld& FullTraversalRenderer::world() const {
    return impl_->world;
}
const InstanceDelta& FullTraversalRenderer::delta() const {
    return impl_->delta;
}
FullTraversalRenderer::Stats FullTraversalRenderer::stats() const {
    return impl_->stats;
}

}  // namespace rtsg
