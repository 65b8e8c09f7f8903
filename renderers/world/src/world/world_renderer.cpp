// The common part of a shared world's renderers: they follow it, and find the nodes that they render themselves.
#include <rtsg/renderers/world_renderer.h>

#include <atomic>
#include <set>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

struct WorldRenderer::Impl final : InstanceSubscriber {
    Impl(WorldRenderer& r, SharedWorld& w) : renderer(r), world(w) {}

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override {
        if (changes.isSnapshot()) known = false;
        if (known)
            for (const Change& change : changes.changes) {
                if (change.kind == ChangeKind::destroyNode) own.erase(change.node.value);
                if (change.kind != ChangeKind::createNode) continue;
                if (const Node* node = scene.find(change.node)) take(*node);
            }
        return renderer.follow(scene, changes, delta);
    }
    std::shared_ptr<const void> freeze() override { return renderer.freezeTables(); }
    std::optional<PictureSight> looksFrom() override { return renderer.looksFrom(); }
    std::string subscriberName() const override { return renderer.subscriberName(); }
    void take(const Node& node) {
        if (renderer.ownsType(node.type())) own.insert(node.id().value);
    }

    WorldRenderer& renderer;
    SharedWorld& world;
    bool added = false;
    std::uint64_t number = 0;  // in the world
    std::atomic<std::uint64_t> presented{0};
    bool registered = false;      // any node renderer of its own
    bool known = false;           // `own` is up to date
    std::set<std::uint32_t> own;  // nodes of the types registered
};

WorldRenderer::WorldRenderer(SharedWorld& world, std::shared_ptr<const NodeRenderers> types)
    : Renderer(std::move(types)), impl_(std::make_unique<Impl>(*this, world)) {}

WorldRenderer::~WorldRenderer() {
    if (impl_->added) impl_->world.remove(*impl_);
}

SharedWorld& WorldRenderer::world() const {
    return impl_->world;
}

Result<> WorldRenderer::attachToScene(Scene& scene) {
    if (&scene != &impl_->world.scene()) return fail("the renderer's world is that of another scene");
    if (auto ok = Renderer::attachToScene(scene); !ok) return ok;
    impl_->known = false;
    impl_->added = true;
    impl_->number = impl_->world.add(*impl_);
    if (const std::string why = failure(); !why.empty()) return fail(why);
    return {};
}

void WorldRenderer::detachFromScene() {
    if (std::exchange(impl_->added, false)) impl_->world.remove(*impl_);
    Renderer::detachFromScene();
}

bool WorldRenderer::attached() const {
    return impl_->added && failure().empty();
}

std::string WorldRenderer::failure() const {
    return impl_->added ? impl_->world.failure(*impl_) : std::string();
}

void WorldRenderer::registerNodeRenderer(std::string_view type, NodeRenderer renderer) {
    Renderer::registerNodeRenderer(type, std::move(renderer));
    impl_->registered = true;
    impl_->known = false;
}

Result<> WorldRenderer::renderFrame(const WorldState&) {
    return fail(subscriberName() + ": it renders on the scene's thread only");
}

std::shared_ptr<const void> WorldRenderer::tables(const WorldState& state) const {
    return state.of(impl_->number);
}

std::shared_ptr<const void> WorldRenderer::begin(const WorldState& state) {
    std::shared_ptr<const void> found = tables(state);
    if (found) impl_->presented = state.sequence;
    return found;
}

void WorldRenderer::presentsNow() {
    impl_->presented = impl_->world.sequence();
}

std::uint64_t WorldRenderer::presented() const {
    return impl_->presented;
}

bool WorldRenderer::ownsNodes() const {
    return impl_->registered;
}

Result<> WorldRenderer::begin() {
    if (!impl_->added) return fail("the renderer is not attached to a scene");
    if (auto ok = impl_->world.update(); !ok) return ok;
    if (const std::string why = failure(); !why.empty()) return fail(subscriberName() + ": " + why);
    return {};
}

Result<> WorldRenderer::renderOwnNodes(Operation operation) {
    Impl& s = *impl_;
    if (!s.registered) return {};
    const Scene& scene = s.world.scene();
    if (!s.known) {
        s.own.clear();
        scene.forEachNode([&](const Node& node) { s.take(node); });
        s.known = true;
    }
    std::vector<NodeId> nodes;
    for (const std::uint32_t id : s.own)
        if (!scene.parents(NodeId{id}).empty()) nodes.push_back(NodeId{id});
    return renderNodes(nodes, operation);
}

}  // namespace rtsg
