// Takes a change set in: sorts out which nodes matter, brings their occurrences up to date and reports instances.
#include <rtsg/renderers/flattener.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <string>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include "flattener_impl.h"

namespace rtsg {

// ---- following the changes ----------------------------------------------------------------------------------------

void Flattener::Impl::begin(const Scene& now, std::uint64_t sequence) {
    scene = &now;
    ++stamp;
    if (std::exchange(startedOver, false)) {
        // No frame will need the memory that a whole scene needed.
        delta = InstanceDelta{};
        instances.createdNow = {};
        placed.createdNow = {};
    }
    delta.clear();
    delta.sequence = sequence;
    freeOccurrences.insert(freeOccurrences.end(), freedOccurrences.begin(), freedOccurrences.end());
    freedOccurrences.clear();
    nodes.tidy();
}

void Flattener::Impl::startOver() {
    startedOver = true;
    if (!tree.empty() && tree[0].node) {
        pruneContent(0);
        state(tree[0].node).firstOccurrence = kNone;
        --live;
    }
    for (const auto& [node, mesh] : meshes) {
        state(NodeId{node}).meshStale = true;
        tessellator.forget(NodeId{node});
    }
    roles.clear();
    overflow = false;
    const Node& root = scene->node(scene->root());
    if (tree.empty()) {
        newOccurrence(root, roles.of(root), kNone);
    } else {
        tree[0] = Occurrence{};
        tree[0].node = root.id();
        tree[0].role = roles.of(root).role;
        tree[0].created = stamp;
        state(root.id()).firstOccurrence = 0;
        ++live;
    }
    growContent(0);
    skins.startOver(*scene);
    followSkins();
}

void Flattener::Impl::follow(const ChangeSet& changes) {
    for (const Change& change : changes.changes) sortOut(change);
    runChildOps();
    runMobility();
    followLayouts();
    runTransforms();
    for (const Content& content : contents) walkUp(content.node, content.structural);
    contents.clear();
    followSkins();
    runShapes();
    runLights();
    runViewer();
}

void Flattener::Impl::followSkins() {
    std::vector<NodeId> moved;
    Diagnostics problems;
    skins.update(*scene, roles, moved, problems);
    if (!problems.all().empty()) reportOnce.append(problems, diagnostics);
    for (const NodeId coordinate : moved) walkUp(coordinate, false, false);
}

void Flattener::Impl::sortOut(const Change& change) {
    if (change.kind != ChangeKind::setField && change.kind != ChangeKind::insertChild &&
        change.kind != ChangeKind::removeChild)
        return;
    const Node* node = scene->find(change.node);
    if (!node) return;  // gone by now; what held it has changed as well
    const TypeRole& role = roles.of(*node);
    const Aspect aspect = node->type().fields[change.field].aspect;
    if (role.ofHumanoid && aspect != Aspect::none) skins.mark(*scene, node->id());
    if (aspect != Aspect::transform && role.bboxDisplay != kNoField &&
        (change.field == role.bboxDisplay || change.field == role.bboxSize || change.field == role.bboxCenter)) {
        noteBoxes(node->id());
        return;
    }
    switch (role.role) {
        case Role::none:
            if (aspect != Aspect::none && aspect != Aspect::time)
                contents.push_back({node->id(), aspect == Aspect::structure || becomesClear(*node, change.field)});
            if (node->is(x3d::GeoOrigin::type))
                for (const ParentRef& parent : scene->parents(node->id()))
                    if (parent.node != scene->root()) transformed.push_back(parent.node);  // of that nothing is moved
            if (!regions.empty() && node->is(x3d::Layout::type)) layoutsChanged.push_back(node->id());
            return;
        case Role::placed:
            if (role.geographic && aspect == Aspect::view) transformed.push_back(node->id());
            if (aspect == Aspect::none || aspect == Aspect::time) return;
            if (state(node->id()).firstOccurrence != kNone)
                report(node->id(), delta.placedChanged);
            else
                contents.push_back({node->id(), false});  // another holds it: a viewpoint its NavigationInfo
            if (change.field == role.global) lights.push_back(node->id());
            return;
        case Role::shape:
            if (role.ownsGeometry() && aspect != Aspect::none) contents.push_back({node->id(), false});
            // Their clock goes on in every frame; nothing else does that they have to do with.
            if (aspect != Aspect::none && !(role.isParticles && aspect == Aspect::geometry))
                shapes.push_back(node->id());
            return;
        default:
            break;
    }
    if (node->is(x3d::Inline::type) && change.field == x3d::Inline::global.index) inlinesChanged.push_back(node->id());
    if (node->is(x3d::Viewport::type) && state(node->id()).firstOccurrence != kNone)
        report(node->id(), delta.placedChanged);
    if (role.isChildField(change.field)) {
        if (role.role == Role::all && role.proxy == kNoField && change.kind != ChangeKind::setField)
            childOps.push_back({node->id(), change.other, change.kind == ChangeKind::insertChild ? 1 : -1});
        else
            reconciled.push_back(node->id());
        // A PROTO instance may also stand for a geometry, an appearance or a part of one.
        if (role.role == Role::first) {
            contents.push_back({node->id(), true});
            if (!regions.empty()) layoutsChanged.push_back(node->id());
        }
    } else if (change.field == role.visible || change.field == role.proxy || change.field == role.choice ||
               change.field == role.order ||
               (role.role == Role::level && (change.field == role.range || change.field == role.center))) {
        reconciled.push_back(node->id());
    } else if ((role.hasTransform && aspect == Aspect::transform) ||
               (role.axis != kNoField && change.field == role.axis)) {
        transformed.push_back(node->id());
    } else if (role.layout != kNoField && change.field == role.layout) {
        layoutsChanged.push_back(node->id());
    }
}

/// Whether a material that showed nothing does now, or the other way round, or may.
bool Flattener::Impl::becomesClear(const Node& node, FieldIndex field) {
    if (node.is(x3d::Appearance::type))
        return field == x3d::Appearance::alphaMode.index || field == x3d::Appearance::alphaCutoff.index;
    if (node.is(x3d::FillProperties::type))
        return field == x3d::FillProperties::filled.index || field == x3d::FillProperties::hatched.index;
    const bool isTransparency = (node.is(x3d::Material::type) && field == x3d::Material::transparency.index) ||
                                (node.is(x3d::UnlitMaterial::type) && field == x3d::UnlitMaterial::transparency.index);
    if (!isTransparency) return false;
    const bool was = clearMaterials.contains(node.id().value), is = flatten::isClear(node);
    if (!is) clearMaterials.erase(node.id().value);
    return was != is;
}

void Flattener::Impl::reconcileOnce(NodeId group) {
    if (std::exchange(state(group).queued, stamp) == stamp) return;
    std::vector<std::uint32_t> here;
    oldOccurrences(group, here);
    for (const std::uint32_t occurrence : here)
        if (tree[occurrence].node == group) reconcile(occurrence);
}

void Flattener::Impl::runChildOps() {
    // The order of insertions and removals does not matter here, only how often each child is there in the end.
    std::sort(childOps.begin(), childOps.end());
    std::size_t count = 0;
    for (std::size_t i = 0; i < childOps.size();) {
        ChildOp sum = childOps[i];
        for (++i; i < childOps.size() && childOps[i].group == sum.group && childOps[i].child == sum.child; ++i)
            sum.count += childOps[i].count;
        if (sum.count != 0) childOps[count++] = sum;
    }
    childOps.resize(count);
    // A list that was also replaced as a whole is compared as a whole.
    for (const NodeId group : reconciled) state(group).visited = ++walk;
    const std::uint32_t lastWalk = walk, firstWalk = walk - static_cast<std::uint32_t>(reconciled.size());
    const auto wholly = [&](NodeId group) {
        const std::uint32_t v = state(group).visited;
        return v > firstWalk && v <= lastWalk;
    };
    for (const ChildOp& op : childOps) {
        if (op.count > 0 || wholly(op.group)) continue;
        oldOccurrences(op.group, found);
        for (const std::uint32_t occurrence : found)
            for (int n = op.count; n < 0; ++n)
                if (const std::uint32_t child = findChild(occurrence, op.child); child != kNone) prune(child);
    }
    for (const NodeId group : reconciled) reconcileOnce(group);
    reconciled.clear();
    for (const ChildOp& op : childOps) {
        if (op.count < 0 || wholly(op.group)) continue;
        oldOccurrences(op.group, found);
        for (const std::uint32_t occurrence : found)
            for (int n = op.count; n > 0; --n) grow(occurrence, op.child);
    }
    childOps.clear();
}

void Flattener::Impl::runMobility() {
    for (const NodeId id : mobility.changedNodes()) {
        const Node* node = scene->find(id);
        if (!node) continue;
        const TypeRole& role = roles.of(*node);
        if (role.role == Role::none || role.role == Role::first) shapesAbove(id);
        if (role.role == Role::none || role.role == Role::shape || role.role == Role::placed) continue;
        const bool mover = isMover(*node, role);
        oldOccurrences(id, found);
        for (const std::uint32_t index : found)
            if (std::exchange(tree[index].isMover, mover) != mover) spreadMotion(index);
    }
    if (mobility.changedScopes().empty()) return;
    // A whole name space has come into or left a script's hands: everything is looked at anew.
    for (std::uint32_t index = 0; index < tree.size(); ++index) {
        Occurrence& o = tree[index];
        if (!o.node || o.created == stamp) continue;
        const Node& node = scene->node(o.node);
        if (o.role == Role::shape) {
            if (o.slot != kNone && bind(instances.records[o.slot], node, roles.of(node), o))
                instances.markRebound(o.slot, stamp);
        } else if (o.role != Role::placed) {
            const bool mover = isMover(node, roles.of(node));
            if (std::exchange(o.isMover, mover) != mover) spreadMotion(index);
        }
    }
}

void Flattener::Impl::shapesAbove(NodeId changed) {
    ++walk;
    climbing.assign(1, changed);
    while (!climbing.empty()) {
        const NodeId id = climbing.back();
        climbing.pop_back();
        if (std::exchange(state(id).visited, walk) == walk) continue;
        for (const ParentRef& parent : scene->parents(id)) {
            const Role role = roles.of(scene->node(parent.node)).role;
            if (role == Role::none || role == Role::first)
                climbing.push_back(parent.node);
            else if (role == Role::shape && std::exchange(state(parent.node).visited, walk) != walk)
                shapes.push_back(parent.node);
        }
    }
}

void Flattener::Impl::runTransforms() {
    if (transformed.empty()) return;
    found.clear();
    for (const NodeId node : transformed)
        for (std::uint32_t o = state(node).firstOccurrence; o != kNone; o = tree[o].nextOfNode)
            if (tree[o].created != stamp) found.push_back(o);
    transformed.clear();
    // Upper ones first, so that lower ones are up to date when their turn comes.
    const auto above = [&](std::uint32_t a, std::uint32_t b) { return tree[a].depth < tree[b].depth; };
    if (!std::is_sorted(found.begin(), found.end(), above)) std::sort(found.begin(), found.end(), above);
    for (const std::uint32_t occurrence : found) updateFrames(occurrence);
}

void Flattener::Impl::runShapes() {
    for (const NodeId id : shapes) {
        const Node& node = scene->node(id);
        const TypeRole& role = roles.of(node);
        oldOccurrences(id, found);
        for (const std::uint32_t index : found) {
            Occurrence& o = tree[index];
            touchBoxes(index);
            const bool hidden =
                tree[o.parent].hidden || (role.visible != kNoField && !flatten::read<bool>(node, role.visible));
            if (std::exchange(o.hidden, hidden) != hidden) {
                if (hidden)
                    dropInstance(index);
                else
                    makeInstance(index, node, role);
            } else if (o.slot != kNone && bind(instances.records[o.slot], node, role, o)) {
                instances.markRebound(o.slot, stamp);
            }
            if (!screenTexts.empty() || !anchors.empty() || o.ownsFrame) followScreened(index);
        }
    }
    shapes.clear();
}

void Flattener::Impl::runLights() {
    for (const NodeId id : inlinesChanged) relight(id);
    inlinesChanged.clear();
    for (const NodeId id : lights) {
        const Node& node = scene->node(id);
        const TypeRole& role = roles.of(node);
        oldOccurrences(id, found);
        for (const std::uint32_t index : found) {
            Occurrence& o = tree[index];
            if (o.slot == kNone) continue;
            const std::uint32_t limit = limitOf(index, node, role), before = o.isLocal ? o.level : kNone;
            if (limit == before) continue;
            if (o.isLocal) changeLocalLights(index, -1);
            o.isLocal = limit != kNone;
            if (o.isLocal) o.level = limit, changeLocalLights(index, 1);
            placed.records[o.slot].scope = o.isLocal ? scopeOf(limit) : ScopeId{};
            placed.markRebound(o.slot, stamp);
        }
    }
    lights.clear();
}

void Flattener::Impl::runViewer() {
    if (std::exchange(viewerMoved, false)) {
        for (const std::uint32_t index : levels)
            if (std::exchange(tree[index].isMover, viewer.has_value()) != viewer.has_value()) spreadMotion(index);
        movedLevels = levels;
        detailsDue = true;
        rotateBillboards();
    }
    runLevels();
}

void Flattener::Impl::rotateBillboards() {
    // Outer ones first, so that inner ones are up to date when their turn comes.
    found = billboards;
    found.insert(found.end(), screened.begin(), screened.end());
    std::sort(found.begin(), found.end(), [&](std::uint32_t a, std::uint32_t b) {
        return std::pair(tree[a].depth, a) < std::pair(tree[b].depth, b);
    });
    for (const std::uint32_t index : found) {
        const bool mover = viewer.has_value();
        if (std::exchange(tree[index].isMover, mover) != mover) spreadMotion(index);
        if (tree[index].created != stamp) updateFrames(index);
    }
}

void Flattener::Impl::runLevels() {
    for (const std::uint32_t index : movedLevels) {
        if (tree[index].role != Role::level) continue;  // pruned with the one around it
        const Node& node = scene->node(tree[index].node);
        const std::uint32_t level =
            flatten::chooseLevel(node, roles.of(node), frames[tree[index].frame], eyeIn(tree[index].layer));
        if (level != tree[index].level) reconcile(index);
    }
    movedLevels.clear();
}

void Flattener::Impl::report(NodeId node, std::vector<NodeId>& list) {
    if (std::exchange(state(node).reported, stamp) != stamp) list.push_back(node);
}

namespace {

bool isColored(const Node& geometry) {
    const FieldIndex color = geometry.type().findExact("color");
    return color != kNoField && geometry.type().fields[color].type == FieldType::SFNode;
}

}  // namespace

void Flattener::Impl::walkUp(NodeId changed, bool structural, bool marksSkins) {
    ++walk;
    climbing.assign(1, changed);
    const Node* start = scene->find(changed);
    const bool restyles = start && flatten::isOfStrokeStyle(*start);
    while (!climbing.empty()) {
        const NodeId id = climbing.back();
        climbing.pop_back();
        NodeState& s = state(id);
        if (std::exchange(s.visited, walk) == walk) continue;
        if (s.geometryUses > 0 || s.meshSent) {
            s.meshStale = true;
            touchGeometry(id);
        }
        if (s.appearanceUses > 0) report(id, delta.appearanceChanged);
        if (s.acousticsUses > 0) report(id, delta.acousticsChanged);
        const Node* node = scene->find(id);
        if (!node) continue;
        // Only another node in a PROTO's or an appearance's place can change the nodes that a shape refers to. Other
        // colours, which may have an alpha, can change whether it is visible.
        const bool rebinds = restyles || (structural && (roles.of(*node).role == Role::first ||
                                                         node->is(x3d::Appearance::type) || isColored(*node)));
        for (const ParentRef& parent : scene->parents(id)) {
            const Node& above = scene->node(parent.node);
            if (marksSkins && roles.of(above).ofHumanoid) skins.mark(*scene, parent.node);
            switch (roles.of(above).role) {
                case Role::none:
                case Role::first:
                    climbing.push_back(parent.node);
                    break;
                case Role::placed:
                    if (state(parent.node).firstOccurrence != kNone) report(parent.node, delta.placedChanged);
                    break;
                case Role::shape:
                    if (rebinds) shapes.push_back(parent.node);
                    if (const TypeRole& shape = roles.of(above);
                        shape.ownsGeometry() && parent.field != shape.appearance)
                        climbing.push_back(parent.node);
                    break;
                default:
                    break;
            }
        }
    }
}

std::shared_ptr<const Mesh> Flattener::Impl::ownMesh(const std::string& type, MeshSource& source, NodeId geometry) {
    if (!source) return nullptr;
    std::string why;
    try {
        return source(*scene, geometry);
    } catch (const std::exception& e) {
        why = e.what();
    } catch (...) {
        why = "it says not why";
    }
    diagnostics.error({}, fmt::format("{}: its mesh source failed, and is asked no more: {}", type, why));
    source = {};
    return nullptr;
}

std::shared_ptr<const Mesh> Flattener::Impl::makeMesh(NodeId geometry) {
    if (!ownMeshes.empty())
        if (const Node* node = scene->find(geometry))
            if (const auto own = ownMeshes.find(node->type().name); own != ownMeshes.end())
                return ownMesh(own->first, own->second, geometry);
    if (options.meshes) return options.meshes(*scene, geometry);
    std::shared_ptr<const Mesh> mesh = particleMesh(geometry);
    if (!mesh) {
        const auto detail = details.find(geometry.value);
        mesh = tessellator.mesh(*scene, geometry, &skins.points(),
                                detail == details.end() ? std::nullopt : detail->second.level);
    }
    if (!tessellator.diagnostics().all().empty()) reportOnce.append(tessellator.takeDiagnostics(), diagnostics);
    return mesh;
}

void Flattener::Impl::finish() {
    runScopes();
    followBoxes();
    followSprites();
    if (options.error.any()) followDetails();
    for (const NodeId geometry : geometries) {
        NodeState& s = state(geometry);
        s.touched = false;
        if (s.geometryUses == 0) {
            if (std::exchange(s.meshSent, false)) {
                delta.geometriesRemoved.push_back(geometry);
                meshes.erase(geometry.value);
                screenTexts.erase(geometry.value);
                anchors.erase(geometry.value);
                sprites.erase(geometry.value);
                details.erase(geometry.value);
                tessellator.forget(geometry);
            }
        } else if (!s.meshSent || s.meshStale) {
            std::shared_ptr<const Mesh> mesh = makeMesh(geometry);
            if (options.error.any()) mesh = atItsLevel(geometry, std::move(mesh));
            std::shared_ptr<const Mesh>& known = meshes[geometry.value];
            // The content of a volume may change without its box, which is its mesh.
            const Node* node = mesh && known == mesh ? scene->find(geometry) : nullptr;
            if (!s.meshSent || !node || !roles.of(*node).isVolume) {
                known = mesh;
                noteScreenText(geometry, mesh && mesh->inPixels);
                noteAnchor(geometry, mesh ? mesh->anchor : Vec3d(0));
                delta.geometries.push_back({geometry, std::move(mesh)});
                s.meshSent = true;
            }
        }
        s.meshStale = false;
    }
    geometries.clear();
    if (!rescreened.empty()) runScreened();
    updateBoxes();
    instances.report(delta.removed, delta.added, delta.moved, delta.rebound);
    placed.report(delta.placedRemoved, delta.placedAdded, delta.placedMoved, delta.placedRebound);
    scene = nullptr;
}

// ---- the outside --------------------------------------------------------------------------------------------------

namespace {
std::atomic<std::uint64_t> flattenersCreated = 0;
}

Flattener::Flattener() : Flattener(Options{}) {}
Flattener::Flattener(Options options) : impl_(std::make_unique<Impl>()) {
    impl_->options = std::move(options);
    flattenersCreated.fetch_add(1, std::memory_order_relaxed);
}
std::uint64_t Flattener::created() {
    return flattenersCreated.load(std::memory_order_relaxed);
}
Flattener::~Flattener() = default;
Flattener::Flattener(Flattener&&) noexcept = default;
Flattener& Flattener::operator=(Flattener&&) noexcept = default;

const InstanceDelta& Flattener::apply(const Scene& scene, const ChangeSet& changes) {
    impl_->begin(scene, changes.to);
    (void)impl_->mobility.apply(scene, changes);  // does not fail
    if (changes.isSnapshot() || impl_->tree.empty())
        impl_->startOver();
    else
        impl_->follow(changes);
    impl_->finish();
    return impl_->delta;
}

namespace {

/// Diagnostics about a type's geometry are void if another source makes its meshes.
void forgetGeometryOf(std::string_view type, Diagnostics& diagnostics) {
    const auto isOfType = [&](const Diagnostic& one) {
        return one.code == DiagnosticCode("geometry") && one.text.starts_with(type) && one.text.size() > type.size() &&
               (one.text[type.size()] == ':' || one.text[type.size()] == ' ');
    };
    if (std::ranges::none_of(diagnostics.all(), isOfType)) return;
    Diagnostics rest(diagnostics.file());
    for (const Diagnostic& one : diagnostics.all())
        if (!isOfType(one)) rest.add(one);
    diagnostics = std::move(rest);
}

}  // namespace

void Flattener::setMeshSource(const Scene& scene, std::string_view type, MeshSource source) {
    forgetGeometryOf(type, impl_->diagnostics);
    impl_->ownMeshes.insert_or_assign(std::string(type), std::move(source));
    impl_->scene = &scene;
    for (const auto& [id, mesh] : impl_->meshes) {
        const Node* node = scene.find(NodeId{id});
        if (!node || node->type().name != type) continue;
        impl_->state(NodeId{id}).meshStale = true;
        impl_->touchGeometry(NodeId{id});
    }
    impl_->scene = nullptr;
}

void Flattener::setViewer(std::optional<EyePosition> eye, std::vector<LayerSight> sights) {
    const std::optional<EyePosition> before = std::exchange(impl_->viewer, eye);
    // Only Billboards know of a head that leans.
    const bool isThere = before && eye && before->position == eye->position && impl_->billboards.empty();
    if ((isThere || before == eye) && sights == impl_->sights) return;
    impl_->sights = std::move(sights);
    impl_->viewerMoved = true;
}

const InstanceDelta& Flattener::updateViewer(const Scene& scene) {
    impl_->begin(scene, impl_->delta.sequence);
    impl_->runViewer();
    impl_->finish();
    return impl_->delta;
}

const std::vector<Instance>& Flattener::instances() const {
    return impl_->instances.records;
}
const std::vector<Placed>& Flattener::placed() const {
    return impl_->placed.records;
}
std::size_t Flattener::instanceCount() const {
    return impl_->instances.live;
}
bool Flattener::usesPixels() const {
    return !impl_->regions.empty() || !impl_->screenGroups.empty() || !impl_->screened.empty() ||
           impl_->layerCount > 0 || (impl_->options.error.pixels > 0 && !impl_->details.empty());
}
const std::vector<LayerSight>& Flattener::sights() const {
    return impl_->sights;
}
const Diagnostics& Flattener::diagnostics() const {
    return impl_->diagnostics;
}

std::vector<NodeId> Flattener::path(InstanceId id) const {
    const auto& table = impl_->instances;
    if (id.slot >= table.records.size() || table.records[id.slot].id != id) return {};
    return impl_->path(table.states[id.slot].occurrence);
}

std::vector<NodeId> Flattener::placedPath(InstanceId id) const {
    const auto& table = impl_->placed;
    if (id.slot >= table.records.size() || table.records[id.slot].id != id) return {};
    return impl_->path(table.states[id.slot].occurrence);
}

ScopeId Flattener::scopeParent(ScopeId scope) const {
    if (scope.value == 0 || scope.value >= impl_->tree.size() || !impl_->tree[scope.value].node) return {};
    return ScopeId{impl_->tree[impl_->tree[scope.value].parent].scope};
}

InstanceDelta Flattener::snapshot() const {
    InstanceDelta all;
    all.sequence = impl_->delta.sequence;
    for (std::uint32_t i = 1; i < impl_->tree.size(); ++i)
        if (impl_->tree[i].node && impl_->tree[i].localLights > 0)
            all.scopes.push_back({ScopeId{i}, scopeParent(ScopeId{i})});
    for (const auto& [node, mesh] : impl_->meshes) all.geometries.push_back({NodeId{node}, mesh});
    for (const Instance& instance : impl_->instances.records)
        if (instance.id) all.added.push_back(instance);
    for (const Placed& item : impl_->placed.records)
        if (item.id) all.placedAdded.push_back(item);
    return all;
}

}  // namespace rtsg
