// Updates everything that depends on the picture: Billboards, layouts, ScreenGroups, and text whose size is in points.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "flattener_impl.h"
#include "tessellate/particles.h"

namespace rtsg {

bool Flattener::Impl::localForEye(std::uint32_t index, const Node& node, const TypeRole& role,
                                  const WorldFromLocal& worldFromParent, WorldFromLocal& m) {
    const Occurrence& o = tree[index];
    if (role.axis != kNoField) {
        const std::optional<EyePosition> eye = eyeIn(o.layer);
        return flatten::rotateTowards(node, role, worldFromParent, eye ? &*eye : nullptr, m);
    }
    const LayerSight* sight = flatten::sightOf(sights, o.layer);
    const flatten::Region* around = regionAround(o.parent);
    if (role.layout == kNoField)
        return flatten::scaleToPixels(worldFromParent, flatten::pixelAt(sight, around, worldFromParent[3]), m);
    const bool outermost = node.is(x3d::LayoutLayer::type);
    const Node* layout = scene->find(flatten::resolve(*scene, roles, flatten::read<NodeId>(node, role.layout)));
    if (layout && !layout->is(x3d::Layout::type)) layout = nullptr;
    const auto report = [&](std::string_view what) {
        const std::string_view name = scene->name(node.id());
        reportOnce.warning(fmt::format("LayoutGroup{}{} {}", name.empty() ? "" : " ", name, what), diagnostics,
                           scene->locationOf(node.id()));
    };
    if (!outermost && !around) {
        if (layout) report("is in no LayoutLayer: its layout is not used");
        if (role.viewport != kNoField && flatten::read<NodeId>(node, role.viewport))
            report("is in no LayoutLayer: its viewport is not used");
        return false;
    }
    flatten::Region region = outermost ? flatten::wholeRegion(sight) : *around;
    if (layout) {
        Diagnostics problems;
        const flatten::LayoutParams params = flatten::readLayout(*scene, *layout, problems);
        if (!problems.all().empty()) reportOnce.append(problems, diagnostics);
        region = flatten::layOut(params, outermost, region, m);
    }
    flatten::Region& before = regions[index];
    regionChanged = before != region;
    before = region;
    return layout != nullptr;
}

const flatten::Region* Flattener::Impl::regionAround(std::uint32_t index) const {
    if (regions.empty()) return nullptr;
    for (; index != kNone; index = tree[index].parent)
        if (const auto region = regions.find(index); region != regions.end()) return &region->second;
    return nullptr;
}

void Flattener::Impl::followLayouts() {
    if (viewerMoved && !regions.empty())
        for (const std::uint32_t index : billboards) layoutsChanged.push_back(tree[index].node);
    for (const NodeId id : layoutsChanged) {
        ++walk;
        climbing.assign(1, id);
        while (!climbing.empty()) {
            const NodeId at = climbing.back();
            climbing.pop_back();
            const Node* node = scene->find(at);
            if (!node || std::exchange(state(at).visited, walk) == walk) continue;
            const TypeRole& role = roles.of(*node);
            if (role.layout != kNoField)
                transformed.push_back(at);
            else if (role.role == Role::none || role.role == Role::first)
                for (const ParentRef& parent : scene->parents(at)) climbing.push_back(parent.node);
        }
    }
    layoutsChanged.clear();
}

void Flattener::Impl::followScreened(std::uint32_t index) {
    Occurrence& o = tree[index];
    const bool inPoints =
        o.slot != kNone && !screenTexts.empty() && screenTexts.contains(instances.records[o.slot].geometry.value);
    const bool anchored = anchorOf(o) != nullptr, owned = o.ownsFrame;
    if (inPoints == screened.contains(index) && (inPoints || anchored) == owned && !anchored) return;
    o.ownsFrame = inPoints || anchored;
    o.turned = inPoints || tree[o.parent].turned;
    o.isMover = inPoints && viewer.has_value();
    if (inPoints)
        screened.insert(index);
    else
        screened.erase(index);
    if (o.ownsFrame) {
        if (owned) {
            // as it is
        } else if (freeFrames.empty()) {
            o.frame = static_cast<std::uint32_t>(frames.size());
            frames.emplace_back();
        } else {
            o.frame = freeFrames.back();
            freeFrames.pop_back();
        }
        const WorldFromLocal& around = frames[tree[o.parent].frame];
        WorldFromLocal local;
        const Node& node = scene->node(o.node);
        frames[o.frame] = localOf(index, node, roles.of(node), around, local) ? compose(around, local) : around;
    } else {
        freeFrames.push_back(o.frame);
        o.frame = tree[o.parent].frame;
    }
    touchBoxes(index);
    if (o.slot == kNone) return;
    instances.records[o.slot].worldFromLocal = frames[o.frame];
    instances.records[o.slot].heard = isHeard(o);
    instances.markMoved(o.slot, stamp);
    instances.markRebound(o.slot, stamp);
    spreadMotion(index);
}

const Vec3d* Flattener::Impl::anchorOf(const Occurrence& shape) const {
    if (anchors.empty() || shape.slot == kNone) return nullptr;
    const auto known = anchors.find(instances.records[shape.slot].geometry.value);
    return known == anchors.end() ? nullptr : &known->second;
}

void Flattener::Impl::noteAnchor(NodeId geometry, const Vec3d& anchor) {
    if (anchors.empty() && anchor == Vec3d(0)) return;
    const auto known = anchors.find(geometry.value);
    const Vec3d before = known == anchors.end() ? Vec3d(0) : known->second;
    if (before == anchor) return;
    if (anchor == Vec3d(0))
        anchors.erase(known);
    else
        anchors[geometry.value] = anchor;
    rescreened.push_back(geometry);
}

void Flattener::Impl::noteScreenText(NodeId geometry, bool inPixels) {
    if (inPixels == (!screenTexts.empty() && screenTexts.contains(geometry.value))) return;
    if (inPixels)
        screenTexts.insert(geometry.value);
    else
        screenTexts.erase(geometry.value);
    rescreened.push_back(geometry);
}

void Flattener::Impl::runScreened() {
    for (const NodeId geometry : rescreened) shapesAbove(geometry);
    rescreened.clear();
    for (const NodeId shape : shapes)
        for (std::uint32_t o = state(shape).firstOccurrence; o != kNone; o = tree[o].nextOfNode) followScreened(o);
    shapes.clear();
}

std::optional<Vec3d> Flattener::Impl::eyeOf(NodeId system) {
    std::uint32_t occurrence = state(system).firstOccurrence;
    if (!viewer || occurrence == kNone) return std::nullopt;
    for (std::uint32_t o = tree[occurrence].nextOfNode; o != kNone; o = tree[o].nextOfNode)
        if (path(o) < path(occurrence)) occurrence = o;
    const WorldFromLocal& m = frames[tree[occurrence].frame];
    if (determinantSign(m) == 0 || !isFinite(m)) return std::nullopt;
    return glm::inverse(glm::dmat3(m[0], m[1], m[2])) * (eyeIn(tree[occurrence].layer)->position - m[3]);
}

std::optional<EyePosition> Flattener::Impl::eyeIn(std::uint16_t layer) const {
    const LayerSight* sight = viewer && layer != 0 ? flatten::sightOf(sights, layer) : nullptr;
    return sight ? EyePosition(sight->eye, sight->up) : viewer;
}

std::shared_ptr<const Mesh> Flattener::Impl::particleMesh(NodeId geometry) {
    const Node* node = scene->find(geometry);
    if (!node || !node->is(x3d::ParticleSystem::type)) return nullptr;
    std::optional<Vec3d> eye;
    if (detail::facesTheEye(*scene, *node))
        sprites[geometry.value] = eye = eyeOf(geometry);
    else
        sprites.erase(geometry.value);
    return tessellator.particles(*scene, geometry, eye);
}

void Flattener::Impl::followSprites() {
    for (const auto& [id, eye] : sprites) {
        const NodeId system{id};
        if (state(system).geometryUses == 0 || eyeOf(system) == eye) continue;
        state(system).meshStale = true;
        touchGeometry(system);
    }
}

std::vector<std::pair<std::size_t, WorldFromLocal>> Flattener::byPicture(InstanceId id) const {
    std::vector<std::pair<std::size_t, WorldFromLocal>> placed;
    const auto& table = impl_->instances;
    const auto& tree = impl_->tree;
    if (impl_->billboards.empty() || id.slot >= table.records.size() || table.records[id.slot].id != id) return placed;
    const std::uint32_t shape = table.states[id.slot].occurrence;
    for (std::uint32_t index = shape; index != kNone && tree[index].parent != kNone; index = tree[index].parent) {
        const Occurrence& o = tree[index];
        if (!o.ownsFrame || o.slot >= impl_->billboards.size() || impl_->billboards[o.slot] != index) continue;
        const glm::dmat4 parent(impl_->frames[tree[o.parent].frame]), own(impl_->frames[o.frame]);
        if (determinantSign(impl_->frames[tree[o.parent].frame]) == 0) continue;
        placed.emplace_back(o.depth - 1, WorldFromLocal(glm::inverse(parent) * own));
    }
    std::ranges::reverse(placed);
    return placed;
}

std::uint16_t Flattener::layerOf(NodeId layer) const {
    const auto* known = impl_->nodes.find(layer.value);
    return known && known->firstOccurrence != kNone ? impl_->tree[known->firstOccurrence].layer : std::uint16_t{0};
}

}  // namespace rtsg
