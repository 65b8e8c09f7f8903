// What depends on the picture: Billboards, layouts, ScreenGroups, and text whose size is in points.
#include <algorithm>

#include <rtsg/core/x3d.h>

#include "flattener_impl.h"

namespace rtsg {

bool Flattener::Impl::localForEye(std::uint32_t index, const Node& node, const TypeRole& role,
                                  const WorldFromLocal& worldFromParent, WorldFromLocal& m) {
    if (role.axis != kNoField) return flatten::turnTowards(node, role, worldFromParent, viewer ? &*viewer : nullptr, m);
    const Occurrence& o = tree[index];
    const LayerSight* sight = flatten::sightOf(sights, o.layer);
    const flatten::Region* around = regionAround(o.parent);
    if (role.layout == kNoField)
        return flatten::scaleToPixels(worldFromParent, flatten::pixelAt(sight, around, worldFromParent[3]), m);
    const bool outermost = node.is(x3d::LayoutLayer::type);
    const Node* layout = scene->find(flatten::resolve(*scene, roles, flatten::read<NodeId>(node, role.layout)));
    if (layout && !layout->is(x3d::Layout::type)) layout = nullptr;
    if (!outermost && !around) {
        if (layout) {
            const std::string_view name = scene->name(node.id());
            told.warning(std::string("LayoutGroup ") + std::string(name) + (name.empty() ? "" : " ") +
                             "is in no LayoutLayer: its layout is not used",
                         diagnostics);
        }
        return false;
    }
    flatten::Region region = outermost ? flatten::wholeRegion(sight) : *around;
    if (layout) {
        Diagnostics problems;
        const flatten::LayoutParams params = flatten::readLayout(*scene, *layout, problems);
        if (!problems.all().empty()) told.append(problems, diagnostics);
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
    if (inPoints == o.ownsFrame) return;
    o.ownsFrame = inPoints;
    o.turned = inPoints || tree[o.parent].turned;
    o.isMover = inPoints && viewer.has_value();
    if (inPoints) {
        screened.insert(index);
        if (freeFrames.empty()) {
            o.frame = static_cast<std::uint32_t>(frames.size());
            frames.emplace_back();
        } else {
            o.frame = freeFrames.back();
            freeFrames.pop_back();
        }
        const WorldFromLocal& around = frames[tree[o.parent].frame];
        WorldFromLocal local;
        const Node& node = scene->node(o.node);
        frames[o.frame] = localForEye(index, node, roles.of(node), around, local) ? compose(around, local) : around;
    } else {
        screened.erase(index);
        freeFrames.push_back(o.frame);
        o.frame = tree[o.parent].frame;
    }
    if (o.slot == kNone) return;
    instances.records[o.slot].worldFromLocal = frames[o.frame];
    instances.records[o.slot].heard = isHeard(o);
    instances.markMoved(o.slot, stamp);
    instances.markRebound(o.slot, stamp);
    spreadMotion(index);
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

}  // namespace rtsg
