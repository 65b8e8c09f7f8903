// Bounding boxes that are displayed: which content each goes around, and its instance.
//
// A shape below such a node (a leaf) knows its box in the world and the innermost displayed box around it; displayed
// boxes know the next one outwards. A leaf that comes, moves or changes makes that box larger at once; if it was the
// leaf that held one of the sides out, the boxes of the leaves below are joined anew. Hidden leaves count like all
// others, so leaves have a hold on their geometry's mesh; things that only ears meet do not count. A box whose author
// says how large it is needs no leaves.
#include "bounding_boxes.h"

#include <algorithm>
#include <utility>

#include "flattener_impl.h"

namespace rtsg {

using flatten::WorldBox;

namespace {

/// Whether a box that was put together of others may be smaller when this one has changed.
bool mayShrink(const WorldBox& box, const WorldBox& was, const WorldBox& now) {
    if (was.empty()) return false;
    for (int k = 0; k < 3; ++k)
        if ((was.min[k] <= box.min[k] && now.min[k] > box.min[k]) ||
            (was.max[k] >= box.max[k] && now.max[k] < box.max[k]))
            return true;
    return false;
}

}  // namespace

// ---- who has one --------------------------------------------------------------------------------------------------

void Flattener::Impl::noteBoxes(NodeId changed) {
    for (std::uint32_t o = state(changed).firstOccurrence; o != kNone; o = tree[o].nextOfNode) boxes.noted.push_back(o);
}

void Flattener::Impl::followBoxes() {
    if (boxes.noted.empty() && boxes.touched.empty()) return;
    std::sort(boxes.noted.begin(), boxes.noted.end());
    boxes.noted.erase(std::unique(boxes.noted.begin(), boxes.noted.end()), boxes.noted.end());
    for (const std::uint32_t index : boxes.noted) {
        dropBox(index);
        if (displaysBox(index)) makeBox(index);
    }
    boxes.noted.clear();
    for (const std::uint32_t index : boxes.touched) {
        if (const auto box = boxes.shown.find(index); box != boxes.shown.end()) {
            if (tree[index].node)
                boxes.due.insert({~tree[index].depth, index});
            else
                dropBox(index);
        }
        followLeaf(index);
    }
    boxes.touched.clear();
}

void Flattener::Impl::touchBoxesBelow(std::uint32_t top) {
    walking.assign(1, top);
    while (!walking.empty()) {
        const std::uint32_t index = walking.back();
        walking.pop_back();
        boxes.touched.push_back(index);
        for (std::uint32_t c = tree[index].firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    }
}

bool Flattener::Impl::displaysBox(std::uint32_t index) {
    const Occurrence& o = tree[index];
    if (!o.node || o.role == Role::placed) return false;
    const Node& node = scene->node(o.node);
    const TypeRole& role = roles.of(node);
    return role.bboxDisplay != kNoField && flatten::read<bool>(node, role.bboxDisplay);
}

void Flattener::Impl::makeBox(std::uint32_t index) {
    const Node& node = scene->node(tree[index].node);
    DisplayedBox& box = boxes.shown[index];
    box.authored = flatten::authoredBox(node, roles.of(node));
    box.depth = tree[index].depth;
    boxes.due.insert({~box.depth, index});
    if (box.authored) return;
    box.whole = true;
    box.around = boxAround(tree[index].parent);
    handLeaves(index, index);
    // From now on the shapes inside report to this box, which has not yet told the box around it that it has them: that
    // one is computed as a whole.
    const auto around = boxes.shown.find(box.around);
    if (around == boxes.shown.end()) return;
    around->second.whole = true;
    boxes.due.insert({~around->second.depth, box.around});
}

void Flattener::Impl::dropBox(std::uint32_t index) {
    const auto known = boxes.shown.find(index);
    if (known == boxes.shown.end()) return;
    const DisplayedBox box = known->second;
    boxes.shown.erase(known);
    boxes.due.erase({~box.depth, index});
    if (box.slot != kNone) {
        instances.remove(box.slot, stamp);
        --boxes.instances;
    }
    if (box.authored) return;
    if (tree[index].node)
        handLeaves(index, box.around);
    else
        changeBox(box.around, box.content, {});
}

std::uint32_t Flattener::Impl::boxAround(std::uint32_t index) const {
    for (; index != kNone; index = tree[index].parent)
        if (const auto box = boxes.shown.find(index); box != boxes.shown.end() && !box->second.authored) return index;
    return kNone;
}

template <class OnBox, class OnShape>
void Flattener::Impl::visitContent(std::uint32_t top, const OnBox& onBox, const OnShape& onShape) const {
    std::vector<std::uint32_t> path{top};
    while (!path.empty()) {
        const std::uint32_t index = path.back();
        path.pop_back();
        const auto inner = index == top ? boxes.shown.end() : boxes.shown.find(index);
        if (inner != boxes.shown.end() && !inner->second.authored) {
            onBox(index);
            continue;
        }
        if (tree[index].role == Role::shape) onShape(index);
        for (std::uint32_t c = tree[index].firstChild; c != kNone; c = tree[c].next) path.push_back(c);
    }
}

/// To another box.
void Flattener::Impl::handLeaves(std::uint32_t top, std::uint32_t box) {
    visitContent(
        top, [&](std::uint32_t inner) { boxes.shown.at(inner).around = box; },
        [&](std::uint32_t leaf) {
            if (box == kNone)
                forgetLeaf(leaf);
            else
                setLeaf(leaf, box);
        });
}

// ---- what is in them ----------------------------------------------------------------------------------------------

void Flattener::Impl::setLeaf(std::uint32_t index, std::uint32_t box) {
    BoxLeaf& leaf = boxes.leaves[index];
    leaf.box = box;
    const NodeId geometry = flatten::geometryOf(*scene, roles, scene->node(tree[index].node));
    if (geometry != leaf.geometry) {
        use(leaf.geometry, &NodeState::geometryUses, -1);
        use(geometry, &NodeState::geometryUses, 1);
        boxes.leavesOf.erase({leaf.geometry, index});
        if (geometry) boxes.leavesOf.insert({geometry, index});
        leaf.geometry = geometry;
    }
    boxes.stale.push_back(index);
}

void Flattener::Impl::forgetLeaf(std::uint32_t index) {
    const auto leaf = boxes.leaves.find(index);
    if (leaf == boxes.leaves.end()) return;
    use(leaf->second.geometry, &NodeState::geometryUses, -1);
    boxes.leavesOf.erase({leaf->second.geometry, index});
    boxes.leaves.erase(leaf);
}

void Flattener::Impl::followLeaf(std::uint32_t index) {
    const Occurrence& o = tree[index];
    const auto leaf = boxes.leaves.find(index);
    const bool known = leaf != boxes.leaves.end();
    if (!o.node) {
        if (!known) return;
        changeBox(leaf->second.box, leaf->second.world, {});
        forgetLeaf(index);
    } else if (o.role == Role::shape && (known || o.created == stamp)) {
        const std::uint32_t box = known ? leaf->second.box : boxAround(index);
        if (box != kNone) setLeaf(index, box);
    }
}

void Flattener::Impl::measureLeaf(std::uint32_t index) {
    const auto known = boxes.leaves.find(index);
    if (known == boxes.leaves.end()) return;
    BoxLeaf& leaf = known->second;
    const Occurrence& o = tree[index];
    const auto its = meshes.find(leaf.geometry.value);
    const std::shared_ptr<const Mesh> mesh = its == meshes.end() ? nullptr : its->second;
    WorldBox now;
    // Text in points has its size where it is shown.
    if (mesh && o.seen && !(mesh->inPixels && o.slot == kNone)) {
        const WorldFromLocal& m = frames[o.frame];
        const glm::dmat3 linear(m[0], m[1], m[2]);
        if (mesh != leaf.mesh || linear != leaf.linear) {
            leaf.turned = flatten::boundsOf(*mesh, linear);
            leaf.mesh = mesh, leaf.linear = linear;
        }
        now = flatten::moved(leaf.turned, m[3]);
    }
    if (now == leaf.world) return;
    changeBox(leaf.box, std::exchange(leaf.world, now), now);
}

void Flattener::Impl::changeBox(std::uint32_t index, const WorldBox& was, const WorldBox& now) {
    const auto known = boxes.shown.find(index);
    if (known == boxes.shown.end()) return;
    DisplayedBox& box = known->second;
    boxes.due.insert({~box.depth, index});
    if (mayShrink(box.next, was, now))
        box.whole = true;
    else
        box.next.extend(now);
}

// ---- where they are -----------------------------------------------------------------------------------------------

WorldBox Flattener::Impl::boxOfContent(std::uint32_t top) const {
    WorldBox all;
    visitContent(
        top, [&](std::uint32_t inner) { all.extend(boxes.shown.at(inner).content); },
        [&](std::uint32_t shape) {
            if (const auto leaf = boxes.leaves.find(shape); leaf != boxes.leaves.end()) all.extend(leaf->second.world);
        });
    return all;
}

void Flattener::Impl::updateBoxes() {
    if (boxes.shown.empty() && !boxes.geometry) return;
    for (const InstanceDelta::Geometry& geometry : delta.geometries)
        for (auto leaf = boxes.leavesOf.lower_bound({geometry.node, 0});
             leaf != boxes.leavesOf.end() && leaf->first == geometry.node; ++leaf)
            boxes.stale.push_back(leaf->second);
    // Text in points that has found its place since.
    boxes.stale.insert(boxes.stale.end(), boxes.touched.begin(), boxes.touched.end());
    boxes.touched.clear();
    for (const std::uint32_t index : boxes.stale) measureLeaf(index);
    boxes.stale.clear();
    while (!boxes.due.empty()) {  // inner ones first
        const std::uint32_t index = boxes.due.begin()->second;
        boxes.due.erase(boxes.due.begin());
        DisplayedBox& box = boxes.shown.at(index);
        if (std::exchange(box.whole, false)) box.next = boxOfContent(index);
        const WorldBox was = std::exchange(box.content, box.next);
        if (was != box.content) changeBox(box.around, was, box.content);
        showBox(index, box);
    }
    const NodeId wantedGeometry = boxes.instances > 0 ? scene->root() : NodeId{};
    if (boxes.geometry == wantedGeometry) return;
    if (boxes.geometry) {
        delta.geometriesRemoved.push_back(boxes.geometry);
        meshes.erase(boxes.geometry.value);
    }
    boxes.geometry = wantedGeometry;
    if (!wantedGeometry) return;
    meshes[wantedGeometry.value] = flatten::boxEdges();
    delta.geometries.push_back({wantedGeometry, flatten::boxEdges()});
}

void Flattener::Impl::showBox(std::uint32_t index, DisplayedBox& box) {
    const Occurrence& o = tree[index];
    std::optional<WorldFromLocal> worldFromLocal;
    if (o.seen)
        worldFromLocal =
            flatten::transformOfEdges(box.authored ? flatten::worldBox(*box.authored, frames[o.frame]) : box.content);
    if (!worldFromLocal) {
        if (box.slot == kNone) return;
        instances.remove(std::exchange(box.slot, kNone), stamp);
        --boxes.instances;
        return;
    }
    if (box.slot == kNone) {
        box.slot = instances.create(index, stamp);
        ++boxes.instances;
        Instance& instance = instances.records[box.slot];
        const InstanceId id = instance.id;
        instance = flatten::edgesInstance(*scene, o.node, *worldFromLocal);
        instance.id = id;
        instance.layer = o.layer;
        instance.scope = scopeOf(o.scope);
        return;
    }
    Instance& instance = instances.records[box.slot];
    if (std::exchange(instance.worldFromLocal, *worldFromLocal) != *worldFromLocal)
        instances.markMoved(box.slot, stamp);
    if (std::exchange(instance.scope, scopeOf(o.scope)) != scopeOf(o.scope)) instances.markRebound(box.slot, stamp);
}

}  // namespace rtsg
