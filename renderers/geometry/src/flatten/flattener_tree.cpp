// The tree of occurrences: growing, pruning, transforms, scopes. Iterative throughout: nesting may be of any depth.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/x3d.h>

#include "flattener_impl.h"

namespace rtsg {

// ---- growing ------------------------------------------------------------------------------------------------------

std::uint32_t Flattener::Impl::newOccurrence(const Node& node, const TypeRole& role, std::uint32_t parent) {
    std::uint32_t index;
    if (freeOccurrences.empty()) {
        index = static_cast<std::uint32_t>(tree.size());
        tree.emplace_back();
    } else {
        index = freeOccurrences.back();
        freeOccurrences.pop_back();
    }
    ++live;
    Occurrence& o = tree[index];
    o = Occurrence{};
    o.node = node.id();
    o.role = role.role;
    o.parent = parent;
    o.created = stamp;
    if (parent != kNone) {
        Occurrence& p = tree[parent];
        o.next = p.firstChild;
        if (o.next != kNone) tree[o.next].previous = index;
        p.firstChild = index;
        o.depth = p.depth + 1;
        o.frame = p.frame;
        o.scope = p.scope;
        o.layer = p.layer;
        o.hidden = p.hidden;
        o.turned = p.turned;
        o.isProxy = p.hasProxy && node.id() == proxyBelow(parent);
        if (p.role == Role::level)
            setSenses(o, p, levelsOf(parent));
        else
            setSenses(o, p);
        if (p.role == Role::layers) {
            const Node& set = scene->node(p.node);
            const auto& layers = flatten::read<Array<NodeId>>(set, roles.of(set).children[0]);
            const auto* at = std::find(layers.begin(), layers.end(), node.id());
            o.layer = static_cast<std::uint16_t>(at - layers.begin() + 1);
            o.isLayer = true;
            ++layerCount;
        }
    }
    if (role.visible != kNoField && !flatten::read<bool>(node, role.visible)) o.hidden = true;
    o.hasProxy = role.proxy != kNoField;
    NodeState& s = state(node.id());
    o.nextOfNode = s.firstOccurrence;
    if (o.nextOfNode != kNone) tree[o.nextOfNode].previousOfNode = index;
    s.firstOccurrence = index;
    if (role.facesViewer) {
        o.slot = static_cast<std::uint32_t>(billboards.size());
        billboards.push_back(index);
        if (role.axis == kNoField && role.layout == kNoField) screenGroups.insert(index);
        o.turned = true;
    }
    if (role.ownsGeometry()) o.turned = true;  // sound does not meet them
    if (role.hasTransform || role.facesViewer) {
        o.ownsFrame = true;
        WorldFromLocal local, world = frames[o.frame];
        if (localOf(index, node, role, world, local)) world = compose(world, local);
        if (freeFrames.empty()) {
            o.frame = static_cast<std::uint32_t>(frames.size());
            frames.push_back(world);
        } else {
            o.frame = freeFrames.back();
            freeFrames.pop_back();
            frames[o.frame] = world;
        }
    } else if (role.role == Role::level) {
        o.slot = static_cast<std::uint32_t>(levels.size());
        levels.push_back(index);
        o.level = flatten::chooseLevel(node, role, frames[o.frame], eyeIn(o.layer));
    }
    o.isMover = isMover(node, role);
    setMotion(index);
    if (role.bboxDisplay != kNoField && flatten::read<bool>(node, role.bboxDisplay)) boxes.noted.push_back(index);
    if (role.role == Role::shape) touchBoxes(index);
    return index;
}

void Flattener::Impl::grow(std::uint32_t parent, NodeId child) {
    const Node* node = scene->find(child);
    // inside a Viewport that cuts: its children are grouped elsewhere
    if (!node || tree[parent].role == Role::placed) return;
    const TypeRole& role = roleBelow(parent, *node);
    if (role.role != Role::none) growContent(newOccurrence(*node, role, parent));
}

const TypeRole& Flattener::Impl::roleBelow(std::uint32_t parent, const Node& node) {
    const auto placedAs = [](PlacedKind kind) {
        TypeRole role;
        role.role = Role::placed, role.kind = kind;
        return role;
    };
    static const TypeRole cuts = placedAs(PlacedKind::clipPlane), window = placedAs(PlacedKind::window);
    const TypeRole& own = roles.of(node);
    if (own.role != Role::all || !node.is(x3d::Viewport::type) || parent == kNone) return own;
    if (tree[parent].node == node.id()) return window;
    const Node& group = scene->node(tree[parent].node);
    const FieldIndex field = roles.of(group).viewport;
    return field != kNoField && flatten::read<NodeId>(group, field) == node.id() ? cuts : own;
}

WorldFromLocal Flattener::Impl::placedFrame(std::uint32_t index) const {
    const Occurrence& o = tree[index];
    const WorldFromLocal& frame = frames[o.frame];
    if (!scene->node(o.node).is(x3d::Viewport::type) || tree[o.parent].node == o.node) return frame;
    const flatten::Region* region = regionAround(o.parent);
    const Vec2d size = region ? region->size : Vec2d(0);
    return {frame[0] * size.x, frame[1] * size.y, frame[2], frame[3]};
}

void Flattener::Impl::growContent(std::uint32_t top) {
    growing.assign(1, top);
    while (!growing.empty()) {
        const std::uint32_t index = growing.back();
        growing.pop_back();
        const Node& node = scene->node(tree[index].node);
        const TypeRole& role = roleBelow(tree[index].parent, node);
        if (role.role == Role::shape) {
            makeInstance(index, node, role);
            continue;
        }
        if (role.role == Role::placed) {
            makePlaced(index, node, role);
            continue;
        }
        chooseChildren(index, node, role);
        const std::size_t first = growing.size();
        for (const NodeId child : wanted) {
            const Node* below = scene->find(child);
            if (!below) continue;
            const TypeRole& its = roleBelow(index, *below);
            if (its.role == Role::none) continue;
            if (live >= options.maxOccurrences) {
                if (!std::exchange(overflow, true))
                    diagnostics.error({}, "the scene has more than " + std::to_string(options.maxOccurrences) +
                                              " paths; what is beyond is left out");
                break;
            }
            growing.push_back(newOccurrence(*below, its, index));
        }
        std::reverse(growing.begin() + static_cast<std::ptrdiff_t>(first), growing.end());  // document order
    }
}

void Flattener::Impl::makeInstance(std::uint32_t index, const Node& node, const TypeRole& role) {
    Occurrence& o = tree[index];
    if (o.hidden) return;
    o.slot = instances.create(index, stamp);
    Instance& instance = instances.records[o.slot];
    instance.shape = o.node;
    instance.scope = scopeOf(o.scope);
    instance.layer = o.layer;
    instance.volume = role.isVolume;
    instance.worldFromLocal = frames[o.frame];
    instance.seen = o.seen, instance.heard = isHeard(o), instance.felt = o.felt;
    bind(instance, node, role, o);
    if (!screenTexts.empty() || !anchors.empty()) followScreened(index);
}

void Flattener::Impl::dropInstance(std::uint32_t index) {
    Occurrence& o = tree[index];
    if (o.slot == kNone) return;
    const Instance& instance = instances.records[o.slot];
    use(instance.geometry, &NodeState::geometryUses, -1);
    use(instance.appearance, &NodeState::appearanceUses, -1);
    use(instance.acoustics, &NodeState::acousticsUses, -1);
    instances.remove(o.slot, stamp);
    o.slot = kNone;
}

void Flattener::Impl::makePlaced(std::uint32_t index, const Node& node, const TypeRole& role) {
    Occurrence& o = tree[index];
    if (o.hidden && role.kind == PlacedKind::light) return;
    if (!isSensed(o, role.kind)) return;
    o.slot = placed.create(index, stamp);
    Placed& item = placed.records[o.slot];
    item.node = o.node;
    item.kind = role.kind;
    item.layer = o.layer;
    item.motion = o.moving ? Motion::moving : Motion::unknown;
    item.worldFromLocal = placedFrame(index);
    const std::uint32_t limit = limitOf(index, node, role);
    o.isLocal = limit != kNone;
    if (!o.isLocal) return;
    o.level = limit;
    item.scope = scopeOf(limit);
    changeLocalLights(index, 1);
}

void Flattener::Impl::dropPlaced(std::uint32_t index) {
    Occurrence& o = tree[index];
    if (o.slot == kNone) return;
    if (o.isLocal) changeLocalLights(index, -1);
    o.isLocal = false;
    placed.remove(o.slot, stamp);
    o.slot = kNone;
}

bool Flattener::Impl::bind(Instance& instance, const Node& shape, const TypeRole& role, const Occurrence& o) {
    const NodeId geometry = flatten::geometryOf(*scene, roles, shape);
    const NodeId appearance = flatten::appearanceOf(*scene, roles, shape);
    NodeId acoustics;
    if (appearance)
        if (const Node& node = scene->node(appearance); node.is(x3d::Appearance::type))
            acoustics = flatten::resolve(*scene, roles, node.get(x3d::Appearance::acousticProperties));
    const bool castShadow =
        !role.isVolume && (role.castShadow == kNoField || flatten::read<bool>(shape, role.castShadow));
    const auto change = [&](NodeId& now, NodeId wantedNow, std::uint32_t NodeState::* uses) {
        if (now == wantedNow) return false;
        use(now, uses, -1);
        use(wantedNow, uses, 1);
        now = wantedNow;
        return true;
    };
    bool changed = false;
    changed |= change(instance.geometry, geometry, &NodeState::geometryUses);
    const bool bends = deforms(geometry);
    const Motion motion = o.moving || bends ? Motion::moving : Motion::unknown;
    changed |= std::exchange(instance.motion, motion) != motion;
    const std::uint32_t rigid = bends ? 0 : o.rigid;
    changed |= std::exchange(instance.rigid, rigid) != rigid;
    instance.pivot = pivotOf(o);
    changed |= change(instance.appearance, appearance, &NodeState::appearanceUses);
    changed |= change(instance.acoustics, acoustics, &NodeState::acousticsUses);
    changed |= std::exchange(instance.castShadow, castShadow) != castShadow;
    const bool clear = !role.ownsGeometry() && flatten::showsNothing(*scene, geometry, appearance);
    changed |= std::exchange(instance.clear, clear) != clear;
    if (clear)
        if (const Node* material = scene->effectiveNode(scene->node(appearance).get(x3d::Appearance::material)))
            if (flatten::isClear(*material)) clearMaterials.insert(material->id().value);
    std::shared_ptr<const StrokeStyle> strokes = flatten::strokeStyle(*scene, appearance);
    if (strokes || instance.strokes) {
        changed |= !strokes || !instance.strokes || *strokes != *instance.strokes;
        instance.strokes = std::move(strokes);
    }
    return changed;
}

void Flattener::Impl::use(NodeId node, std::uint32_t NodeState::* uses, int change) {
    if (!node) return;
    state(node).*uses += static_cast<std::uint32_t>(change);
    if (uses == &NodeState::geometryUses) touchGeometry(node);
}

void Flattener::Impl::touchGeometry(NodeId geometry) {
    if (!std::exchange(state(geometry).touched, true)) geometries.push_back(geometry);
}

bool Flattener::Impl::isMover(const Node& node, const TypeRole& role) const {
    // The content of a switch or a level of detail comes and goes, so it must not be merged with what rests.
    if (role.role == Role::level || role.facesViewer) return viewer.has_value();
    if (role.role == Role::choice) return mayChange(node, Aspect::structure);
    return role.hasTransform && mayChange(node, Aspect::transform);
}

bool Flattener::Impl::deforms(NodeId geometry) const {
    const Node* node = geometry ? scene->find(geometry) : nullptr;
    if (!node) return false;
    if (mayChange(*node, Aspect::geometry)) return true;
    for (const FieldIndex field : node->type().nodeFields()) {
        const FieldDef& def = node->type().fields[field];
        if (def.type != FieldType::SFNode || !def.readable()) continue;
        const Node* below = scene->find(flatten::read<NodeId>(*node, field));
        if (below && mayChange(*below, Aspect::geometry)) return true;
    }
    return false;
}

// ---- what moves together ------------------------------------------------------------------------------------------

Vec3f Flattener::Impl::pivotOf(const Occurrence& o) {
    if (o.rigid == 0) return Vec3f(0);
    const Occurrence& mover = tree[o.rigid];
    const Node& node = scene->node(mover.node);
    const TypeRole& role = roles.of(node);
    const Vec3f center =
        role.hasTransform && role.center != kNoField ? flatten::read<Vec3f>(node, role.center) : Vec3f(0);
    if (mover.frame == o.frame) return center;
    const WorldFromLocal &own = frames[o.frame], &its = frames[mover.frame];
    if (determinantSign(own) == 0) return Vec3f(0);
    const Vec3d c(center), world = its[0] * c.x + its[1] * c.y + its[2] * c.z + its[3];
    const Vec3d local = glm::inverse(glm::dmat3(own[0], own[1], own[2])) * (world - own[3]);
    return Vec3f(local);
}

bool Flattener::Impl::setMotion(std::uint32_t index) {
    Occurrence& o = tree[index];
    const bool moving = o.isMover || (o.parent != kNone && tree[o.parent].moving);
    const std::uint32_t rigid = o.isMover || o.wasSeen ? index : o.parent != kNone ? tree[o.parent].rigid : 0;
    const bool movingBefore = std::exchange(o.moving, moving);
    return (std::exchange(o.rigid, rigid) != rigid) | (movingBefore != moving);
}

void Flattener::Impl::spreadMotion(std::uint32_t top) {
    walking.assign(1, top);
    while (!walking.empty()) {
        const std::uint32_t index = walking.back();
        walking.pop_back();
        Occurrence& o = tree[index];
        if (!setMotion(index)) continue;
        if (o.role == Role::shape && o.slot != kNone) {
            const Node& node = scene->node(o.node);
            if (bind(instances.records[o.slot], node, roles.of(node), o)) instances.markRebound(o.slot, stamp);
        } else if (o.role == Role::placed && o.slot != kNone) {
            placed.records[o.slot].motion = o.moving ? Motion::moving : Motion::unknown;
            placed.markRebound(o.slot, stamp);
        }
        for (std::uint32_t c = o.firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    }
}

// ---- pruning ------------------------------------------------------------------------------------------------------

void Flattener::Impl::prune(std::uint32_t top) {
    Occurrence& o = tree[top];
    if (o.previous != kNone)
        tree[o.previous].next = o.next;
    else if (o.parent != kNone)
        tree[o.parent].firstChild = o.next;
    if (o.next != kNone) tree[o.next].previous = o.previous;
    pruneContent(top);
    if (o.isLocal && o.slot != kNone) changeLocalLights(top, -1);
    release(top);
}

void Flattener::Impl::pruneContent(std::uint32_t top) {
    walking.clear();
    for (std::uint32_t c = tree[top].firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    for (std::size_t i = 0; i < walking.size(); ++i)
        for (std::uint32_t c = tree[walking[i]].firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    // Lights first: they look for the group they shine in.
    for (const std::uint32_t index : walking)
        if (tree[index].isLocal && tree[index].slot != kNone) changeLocalLights(index, -1);
    for (const std::uint32_t index : walking) release(index);
    tree[top].firstChild = kNone;
}

void Flattener::Impl::release(std::uint32_t index) {
    Occurrence& o = tree[index];
    layerCount -= o.isLayer;
    touchBoxes(index);
    if (o.role == Role::shape) {
        dropInstance(index);
        if (o.ownsFrame) screened.erase(index);
    } else if (o.role == Role::placed) {
        if (o.slot != kNone) placed.remove(o.slot, stamp);
    } else if (o.role == Role::level) {
        levels[o.slot] = levels.back();
        tree[levels.back()].slot = o.slot;
        levels.pop_back();
    } else if (o.slot != kNone) {
        screenGroups.erase(index);
        regions.erase(index);
        billboards[o.slot] = billboards.back();
        tree[billboards.back()].slot = o.slot;
        billboards.pop_back();
    }
    if (o.previousOfNode != kNone)
        tree[o.previousOfNode].nextOfNode = o.nextOfNode;
    else
        state(o.node).firstOccurrence = o.nextOfNode;
    if (o.nextOfNode != kNone) tree[o.nextOfNode].previousOfNode = o.previousOfNode;
    if (o.ownsFrame) freeFrames.push_back(o.frame);
    o = Occurrence{};
    freedOccurrences.push_back(index);
    --live;
}

// ---- children -----------------------------------------------------------------------------------------------------

std::uint32_t Flattener::Impl::findChild(std::uint32_t parent, NodeId child) const {
    // Either list may be long; the shorter one bounds the search.
    std::uint32_t sibling = tree[parent].firstChild;
    const NodeState* known = nodes.find(child.value);
    std::uint32_t twin = known ? known->firstOccurrence : kNone;
    while (sibling != kNone && twin != kNone) {
        if (tree[sibling].node == child) return sibling;
        if (tree[twin].parent == parent) return twin;
        sibling = tree[sibling].next;
        twin = tree[twin].nextOfNode;
    }
    return kNone;
}

void Flattener::Impl::oldOccurrences(NodeId node, std::vector<std::uint32_t>& out) const {
    out.clear();
    const NodeState* known = nodes.find(node.value);
    if (!known) return;
    for (std::uint32_t o = known->firstOccurrence; o != kNone; o = tree[o].nextOfNode)
        if (tree[o].created != stamp) out.push_back(o);
}

void Flattener::Impl::reconcile(std::uint32_t top) {
    reconciling.assign(1, top);
    while (!reconciling.empty()) {
        const std::uint32_t index = reconciling.back();
        reconciling.pop_back();
        if (tree[index].node) reconcileChildren(index);
    }
}

void Flattener::Impl::reconcileChildren(std::uint32_t index) {
    if (tree[index].role == Role::placed) return;  // a Viewport that cuts: its content is not shown
    const Node& node = scene->node(tree[index].node);
    const TypeRole& role = roles.of(node);
    const std::uint32_t parent = tree[index].parent;
    const bool hidden = (parent != kNone && tree[parent].hidden) ||
                        (role.visible != kNoField && !flatten::read<bool>(node, role.visible));
    if (hidden != tree[index].hidden || role.role == Role::layers) {
        tree[index].hidden = hidden;
        pruneContent(index);
        growContent(index);
        return;
    }
    if (role.role == Role::level)
        tree[index].level = flatten::chooseLevel(node, role, frames[tree[index].frame], eyeIn(tree[index].layer));
    chooseChildren(index, node, role);
    std::sort(wanted.begin(), wanted.end());
    // Both sides are sorted: items on one side only are removed or added.
    std::vector<std::pair<NodeId, std::uint32_t>> have;
    for (std::uint32_t c = tree[index].firstChild; c != kNone; c = tree[c].next) have.emplace_back(tree[c].node, c);
    std::sort(have.begin(), have.end());
    std::vector<NodeId> missing;
    const NodeId proxy = role.proxy == kNoField ? NodeId{} : proxyBelow(index);
    std::size_t w = 0;
    for (const auto& [child, occurrence] : have) {
        while (w < wanted.size() && wanted[w] < child) missing.push_back(wanted[w++]);
        // A node that was the proxy and is now among the children gets a new occurrence.
        if (w < wanted.size() && wanted[w] == child && tree[occurrence].isProxy == (child == proxy))
            ++w;
        else
            prune(occurrence);
    }
    missing.insert(missing.end(), wanted.begin() + static_cast<std::ptrdiff_t>(w), wanted.end());
    if (role.role == Role::level) spreadSenses(index);
    for (const NodeId child : missing) grow(index, child);
}

void Flattener::Impl::reportPosition(const Node& node) {
    const auto transform = geoTransform(*scene, node);
    if (transform) return;
    const std::string_view name = scene->name(node.id());
    reportOnce.warning(fmt::format("{}{}{}: {}: it stays where it is", node.type().name, name.empty() ? "" : " ", name,
                                   transform.error().text),
                       diagnostics, scene->locationOf(node.id()));
}

// ---- transforms ---------------------------------------------------------------------------------------------------

void Flattener::Impl::updateFrames(std::uint32_t top) {
    if (tree[top].updated == stamp) return;
    walking.assign(1, top);
    while (!walking.empty()) {
        const std::uint32_t index = walking.back();
        walking.pop_back();
        Occurrence& o = tree[index];
        o.updated = stamp;
        if (o.ownsFrame) {
            const Node& node = scene->node(o.node);
            WorldFromLocal local, world = frames[tree[o.parent].frame];
            regionChanged = false;
            if (localOf(index, node, roles.of(node), world, local)) world = compose(world, local);
            if (index == top && world == frames[o.frame] && !regionChanged) return;
            frames[o.frame] = world;
        } else {
            o.frame = tree[o.parent].frame;
        }
        if (o.role == Role::shape && o.slot != kNone) {
            instances.records[o.slot].worldFromLocal = frames[o.frame];
            instances.markMoved(o.slot, stamp);
        } else if (o.role == Role::placed && o.slot != kNone) {
            placed.records[o.slot].worldFromLocal = placedFrame(index);
            placed.markMoved(o.slot, stamp);
        } else if (o.role == Role::level && viewer) {
            movedLevels.push_back(index);
        }
        for (std::uint32_t c = o.firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    }
    if (!boxes.shown.empty()) touchBoxesBelow(top);  // not in the loop, which most scenes take without
    if (!tree[top].isMover && !std::exchange(tree[top].wasSeen, true)) spreadMotion(top);
}

// ---- scopes of local lights ---------------------------------------------------------------------------------------

std::uint32_t Flattener::Impl::limitOf(std::uint32_t index, const Node& node, const TypeRole& role) const {
    const bool isLight = role.kind == PlacedKind::light;
    const bool isWindow = role.kind == PlacedKind::window;
    if (!isLight && !isWindow && role.kind != PlacedKind::clipPlane && role.kind != PlacedKind::localFog) return kNone;
    std::uint32_t group = tree[index].parent;
    if (!isLight || (role.global != kNoField && !flatten::read<bool>(node, role.global))) {
        while (tree[group].role == Role::first)
            group = tree[group].parent;  // a PROTO's light shines where the PROTO is
        return group;
    }
    // 9.4.2: lights of an Inline shine within it, unless the Inline says otherwise.
    for (; tree[group].parent != kNone; group = tree[group].parent) {
        const Node* around = scene->find(tree[group].node);
        if (!around) return kNone;  // destroyed by the same set: this occurrence is about to go with it
        if (around->is(x3d::Inline::type) && !around->get(x3d::Inline::global)) return group;
    }
    return kNone;
}

void Flattener::Impl::changeLocalLights(std::uint32_t light, int change) {
    const std::uint32_t group = tree[light].level;
    std::uint32_t& count = tree[group].localLights;
    count += static_cast<std::uint32_t>(change);
    if (count == 0 || (count == 1 && change > 0)) scopeDirty.push_back(group);
}

void Flattener::Impl::relight(NodeId inlined) {
    oldOccurrences(inlined, found);
    walking = found;
    while (!walking.empty()) {
        const std::uint32_t index = walking.back();
        walking.pop_back();
        if (tree[index].role == Role::placed) lights.push_back(tree[index].node);
        for (std::uint32_t c = tree[index].firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
    }
}

void Flattener::Impl::runScopes() {
    std::erase_if(scopeDirty, [&](std::uint32_t group) { return group == 0 || !tree[group].node; });
    std::sort(scopeDirty.begin(), scopeDirty.end(),
              [&](std::uint32_t a, std::uint32_t b) { return tree[a].depth < tree[b].depth; });
    for (const std::uint32_t group : scopeDirty) {
        const std::uint32_t around = tree[tree[group].parent].scope;
        const std::uint32_t scope = tree[group].localLights > 0 ? group : around;
        if (tree[group].scope == scope) continue;
        tree[group].scope = scope;
        touchBoxes(group);
        if (scope == group) delta.scopes.push_back({scopeOf(group), scopeOf(around)});
        walking.clear();
        for (std::uint32_t c = tree[group].firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
        while (!walking.empty()) {
            const std::uint32_t index = walking.back();
            walking.pop_back();
            Occurrence& o = tree[index];
            if (o.localLights > 0) {
                delta.scopes.push_back({scopeOf(index), scopeOf(scope)});
                continue;
            }
            o.scope = scope;
            touchBoxes(index);
            if (o.role == Role::shape && o.slot != kNone) {
                instances.records[o.slot].scope = scopeOf(scope);
                instances.markRebound(o.slot, stamp);
            }
            for (std::uint32_t c = o.firstChild; c != kNone; c = tree[c].next) walking.push_back(c);
        }
    }
    scopeDirty.clear();
}

std::vector<NodeId> Flattener::Impl::path(std::uint32_t index) const {
    std::vector<NodeId> nodesUp;
    for (; index != kNone && tree[index].parent != kNone; index = tree[index].parent)
        nodesUp.push_back(tree[index].node);
    std::reverse(nodesUp.begin(), nodesUp.end());
    return nodesUp;
}

}  // namespace rtsg
