// Paths, matrices and the viewer's pose, each computed once until something on the way moves.
#include "world_transforms.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "view_pose.h"

namespace rtsg {

namespace {

/// The fields by which a type moves its children: those of Transform and similar types (CADPart, EspduTransform,
/// HAnimJoint, HAnimSite, types of users). `rotation` is kNoField for all others.
struct TransformFields {
    FieldIndex translation = kNoField, rotation = kNoField, scale = kNoField, scaleOrientation = kNoField,
               center = kNoField;
    bool geographic = false;
};

TransformFields findTransformFields(const NodeType& type) {
    const auto find = [&](std::string_view name, FieldType wanted) {
        const FieldIndex index = type.findExact(name);
        const bool fits = index != kNoField && type.fields[index].type == wanted && type.fields[index].readable();
        return fits ? index : kNoField;
    };
    TransformFields fields;
    fields.geographic = isGeoTransform(type);
    if (fields.geographic) return fields;
    if (type.below.empty() || !type.isA("X3DChildNode")) return fields;
    fields.translation = find("translation", FieldType::SFVec3f);
    if (fields.translation == kNoField) return fields;
    fields.rotation = find("rotation", FieldType::SFRotation);
    fields.scale = find("scale", FieldType::SFVec3f);
    fields.scaleOrientation = find("scaleOrientation", FieldType::SFRotation);
    fields.center = find("center", FieldType::SFVec3f);
    return fields;
}

TransformFields transformFields(const Node& node) {
    static const auto& builtin = neverDestroyed([] {
        std::vector<TransformFields> all;
        for (const auto& type : builtinTypes()) all.push_back(findTransformFields(*type));
        return all;
    });
    const std::size_t index = node.typeIndex().value;
    return index < builtin.size() ? builtin[index] : findTransformFields(node.type());
}

/// Whether a Switch or an LOD shows this child; all others show all.
bool shows(const Node& parent, FieldIndex field, NodeId child) {
    const NodeType& type = parent.type();
    const bool chooses = type.role == "choice";
    if ((!chooses && type.role != "level") || type.fields[field].type != FieldType::MFNode) return true;
    const FieldIndex which = type.findExact(chooses ? "whichChoice" : "level_changed");
    if (which == kNoField || type.fields[which].type != FieldType::SFInt32) return true;
    const auto& children = parent.get(Field<Array<NodeId>>{field});
    const std::int32_t index = parent.get(Field<std::int32_t>{which});
    return index >= 0 && static_cast<std::size_t>(index) < children.size() &&
           children[static_cast<std::size_t>(index)] == child;
}

}  // namespace

glm::dquat rotationPart(const glm::dmat4& matrix) {
    glm::dvec3 x(matrix[0]), y(matrix[1]);
    const double length = glm::length(x);
    if (!(length > 0)) return {1, 0, 0, 0};
    x /= length;
    y -= x * glm::dot(x, y);
    const double height = glm::length(y);
    if (!(height > 0)) return {1, 0, 0, 0};
    y /= height;
    return glm::normalize(glm::quat_cast(glm::dmat3(x, y, glm::cross(x, y))));
}

glm::dmat4 parentFromLocal(const Scene& scene, const Node& node) {
    const TransformFields fields = transformFields(node);
    if (fields.geographic) return geoTransform(scene, node).value_or(glm::dmat4(1));
    if (fields.rotation == kNoField) return glm::dmat4(1);
    const auto get = [&](auto otherwise, FieldIndex field) {
        return field == kNoField ? otherwise : node.get(Field<decltype(otherwise)>{field});
    };
    const auto rotate = [](const Rotation& r) {
        const glm::dvec3 axis(r.x, r.y, r.z);
        return glm::length(axis) > 0 ? glm::dmat4(rotationMatrixOf(axis, double(r.angle))) : glm::dmat4(1);
    };
    const Rotation orientation = get(Rotation{0, 0, 1, 0}, fields.scaleOrientation);
    Rotation back = orientation;
    back.angle = -back.angle;
    const glm::dvec3 center(get(Vec3f(0), fields.center)), scale(get(Vec3f(1), fields.scale));
    const glm::dvec3 translation(node.get(Field<Vec3f>{fields.translation}));
    const glm::dmat4 one(1);
    return glm::translate(one, translation + center) * rotate(node.get(Field<Rotation>{fields.rotation})) *
           rotate(orientation) * glm::scale(one, scale) * rotate(back) * glm::translate(one, -center);
}

bool onlyReports(const NodeType& type, FieldIndex field) {
    return type.fields[field].access == Access::outputOnly && !type.fields[field].hidden &&
           std::ranges::find(type.below, field) == type.below.end();
}

bool isTransform(const NodeType& type, FieldIndex field) {
    const FieldDef& def = type.fields[field];
    if (type.kind == NodeType::Kind::script || type.isA("X3DScriptNode")) return false;
    if (type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto) return def.hidden;
    if (def.type == FieldType::SFNode && def.name == "targetObject") return false;  // 22.4.2: says which, not where
    return (!def.hidden || def.aspect == Aspect::structure) && !onlyReports(type, field);
}

bool isLayer(const Node& node) {
    return node.type().kind == NodeType::Kind::builtin && node.type().isA("X3DLayerNode");
}

bool isInScene(const Scene& scene, NodeId id) {
    return layerOf(scene, id) != nullptr;
}

bool isInlined(const Scene& scene, const Node& node) {
    for (const Node* owner = scene.find(node.scope()); owner; owner = scene.find(owner->scope()))
        if (owner->is(x3d::Inline::type)) return true;
    return false;
}

const Node* layerOf(const Scene& scene, NodeId id) {
    struct Step {
        NodeId node;
        const Node* layer;  // that was passed on the way here
    };
    std::vector<Step> pending{{id, nullptr}};
    std::unordered_set<std::uint32_t> seen;
    while (!pending.empty()) {
        Step step = pending.back();
        pending.pop_back();
        const Node* node = scene.find(step.node);
        if (!node) continue;
        if (step.node == scene.root()) return step.layer ? step.layer : node;
        if (!seen.insert(step.node.value).second) continue;
        if (!step.layer && isLayer(*node)) step.layer = node;
        const std::vector<ParentRef> parents = scene.parents(step.node);
        for (std::size_t i = parents.size(); i-- > 0;)  // so that the first is looked at first
            if (isTransform(scene.node(parents[i].node).type(), parents[i].field))
                pending.push_back({parents[i].node, step.layer});
    }
    return nullptr;
}

namespace {

/// The node whose binding stacks count: the active layer, or the root.
const Node& activeHolder(const Scene& scene) {
    const Node& root = scene.node(scene.root());
    const Node* layer = scene.find(root.get(x3d::RtsgScene::_activeLayer));
    return layer ? *layer : root;
}

}  // namespace

const Node* topOfStack(const Scene& scene, std::string_view stack) {
    const Node& holder = activeHolder(scene);
    const FieldIndex field = holder.type().findExact(stack);
    if (field == kNoField || holder.type().fields[field].type != FieldType::MFNode) return nullptr;
    const auto& nodes = holder.get(Field<Array<NodeId>>{field});
    return nodes.empty() ? nullptr : scene.find(nodes[0]);
}

/// Goes on to the root, and notes the other ways that branch off.
void WorldTransforms::climb(Ancestry& ancestry, std::vector<NodeId>& path, std::vector<Ancestry>& ancestries) const {
    constexpr std::size_t kDeepest = 1 << 20, kMaxPaths = 1024;
    while (ancestry.at && ancestry.at != scene_.root() && path.size() < kDeepest) {
        const Node* node = scene_.find(ancestry.at);
        if (!node) break;
        ancestry.standing.worldFromLocal = parentFromLocal(scene_, *node) * ancestry.standing.worldFromLocal;
        path.push_back(ancestry.at);
        if (transformFields(*node).geographic)
            if (const Node* origin = geoOriginOf(scene_, *node)) path.push_back(origin->id());
        const bool shown = ancestry.standing.shown;
        ParentRef first;
        for (const ParentRef& parent : scene_.parents(ancestry.at)) {
            const Node& above = scene_.node(parent.node);
            if (!isTransform(above.type(), parent.field)) continue;
            const bool isShown = shown && shows(above, parent.field, ancestry.at);
            if (!first.node)
                first = parent, ancestry.standing.shown = isShown;
            else if (ancestries.size() < kMaxPaths)
                ancestries.push_back({parent.node, {ancestry.standing.worldFromLocal, isShown}});
        }
        if (!first.node) ancestry.standing.shown = false;
        ancestry.at = first.node;
    }
}

void WorldTransforms::compute(NodeId id, Entry& entry) {
    std::vector<NodeId> path;
    std::vector<Ancestry> ancestries;
    Ancestry first{id, {}};
    climb(first, path, ancestries);
    entry.worldFromLocal = first.standing.worldFromLocal;
    entry.shown = first.standing.shown;
    entry.known = true;
    entry.others.clear();
    if (!ancestries.empty()) {
        for (std::size_t i = 0; i < ancestries.size(); ++i) {
            Ancestry ancestry = ancestries[i];
            climb(ancestry, path, ancestries);
            if (ancestry.at == scene_.root()) entry.others.push_back(ancestry.standing);
        }
        std::ranges::sort(path);
        path.erase(std::unique(path.begin(), path.end()), path.end());
    }
    if (path == entry.path && entry.version > 0) return;
    entry.path = std::move(path);
    ++entry.version;
    for (const NodeId at : entry.path) {
        watch(at);
        Passers& passers = passers_[at.value];
        if (passers.list.size() > 2 * passers.cleaned + 16) {
            std::erase_if(passers.list, [&](const Passer& p) {
                const auto found = transforms_.find(p.entry.value);
                return found == transforms_.end() || found->second.version != p.version;
            });
            passers.cleaned = passers.list.size();
        }
        passers.list.push_back({id, entry.version});
    }
}

void WorldTransforms::watch(NodeId node) {
    if (node.value >= isWatched_.size()) isWatched_.resize(node.value + node.value / 2 + 64);
    isWatched_[node.value] = true;
}

const WorldTransforms::Entry& WorldTransforms::ask(NodeId node, NodeId asker) {
    Entry& entry = transforms_[node.value];
    if (!entry.known) compute(node, entry);
    if (std::ranges::find(entry.askers, asker) == entry.askers.end()) entry.askers.push_back(asker);
    return entry;
}

void WorldTransforms::computeViewer() {
    viewerLayer_ = activeHolder(scene_).id();
    watch(scene_.root());
    watch(viewerLayer_);
    viewerKnown_ = true;
    viewer_ = {};  // 23.4.6: the viewer's place if no viewpoint is given
    const Node* view = topOfStack(scene_, "_viewpointStack");
    if (!view) return;
    // The root is the asker, and is told nothing; the nodes that follow the viewer are told.
    const glm::dmat4& world = worldFromLocal(view->id(), scene_.root());
    viewer_.viewpoint = view->id();
    viewer_.orientation = rotationPart(world);
    const auto fields = viewFields(*view);
    if (!fields) return;
    const ViewerPose pose = *viewOf(*view);
    viewer_.position = world * glm::dvec4(pose.position, 1);
    viewer_.centerOfRotation = world * glm::dvec4(centerOfRotation(scene_, *view, *fields), 1);
    viewer_.orientation *= pose.orientation;
}

const Viewer& WorldTransforms::viewer(NodeId asker) {
    if (!viewerKnown_) computeViewer();
    if (asker.value >= asksViewer_.size()) asksViewer_.resize(asker.value + asker.value / 2 + 64);
    if (!asksViewer_[asker.value]) viewerAskers_.push_back(asker);
    asksViewer_[asker.value] = true;
    return viewer_;
}

void WorldTransforms::takeConcerned(std::vector<NodeId>& out) {
    std::ranges::sort(moved_);
    moved_.erase(std::unique(moved_.begin(), moved_.end()), moved_.end());
    bool viewerMoved = false;
    for (const NodeId node : moved_) {
        viewerMoved |= node == scene_.root() || node == viewerLayer_;
        const auto passers = passers_.find(node.value);
        if (passers == passers_.end()) continue;
        for (const Passer& p : passers->second.list) {
            const auto found = transforms_.find(p.entry.value);
            if (found == transforms_.end() || found->second.version != p.version || !found->second.known) continue;
            Entry& entry = found->second;
            entry.known = false;
            for (const NodeId asker : entry.askers)
                if (asker == scene_.root())
                    viewerMoved = true;
                else
                    out.push_back(asker);
            entry.askers.clear();
        }
        if (!scene_.find(node)) {
            // It is gone, and its number never comes again.
            passers_.erase(passers);
            transforms_.erase(node.value);
            isWatched_[node.value] = false;
        }
    }
    moved_.clear();
    if (!viewerMoved) return;
    viewerKnown_ = false;
    out.insert(out.end(), viewerAskers_.begin(), viewerAskers_.end());
    for (const NodeId asker : viewerAskers_) asksViewer_[asker.value] = false;
    viewerAskers_.clear();
}

void WorldTransforms::clear() {
    transforms_.clear();
    passers_.clear();
    isWatched_.clear();
    moved_.clear();
    viewerKnown_ = false;
    viewerAskers_.clear();
    asksViewer_.clear();
}

}  // namespace rtsg
