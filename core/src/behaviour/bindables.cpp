// Binding stacks (ISO/IEC 19775-1 V4.0, 7.2.2) and LOD (23.4.3), which needs the bound viewpoint.
//
// The stacks are hidden MFNode fields of the root, top first: so they travel and are hashed as everything else.
#include <algorithm>
#include <cmath>
#include <unordered_set>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

using Stack = Field<Array<NodeId>>;

/// The top of a stack may be of another type of the same kind (OrthoViewpoint, TextureBackground).
void announceBound(Cascade& cascade, NodeId id, bool bound) {
    const Node& node = cascade.scene().node(id);
    const FieldIndex isBound = node.type().findExact("isBound"), bindTime = node.type().findExact("bindTime");
    const Time now{cascade.now()};
    if (isBound != kNoField) cascade.emitStorage(node, isBound, &bound);
    if (bindTime != kNoField) cascade.emitStorage(node, bindTime, &now);
}

/// N: node type with set_bind, isBound, bindTime. The stack's handle is a type parameter's static member.
template <class N, const Stack& stackField>
struct Bindable {
    static const Node& root(Cascade& cascade) { return cascade.scene().node(cascade.scene().root()); }
    static void announce(Cascade& cascade, const Node& node, bool bound) {
        cascade.emit(node, N::isBound, bound);
        cascade.emit(node, N::bindTime, Time{cascade.now()});
    }
    static void onEvent(Cascade& cascade, const Node& node, FieldIndex field, const void* value) {
        if (field != N::set_bind.index) return;
        Array<NodeId> stack = root(cascade).get(stackField);
        const auto found = std::ranges::find(stack, node.id());
        const bool onTop = !stack.empty() && stack[0] == node.id();
        const NodeId oldTop = stack.empty() ? NodeId{} : stack[0];
        if (eventValue<bool>(value)) {
            if (onTop) return;
            if (found != stack.end()) stack.erase(static_cast<std::size_t>(found - stack.begin()));
            stack.insert(0, node.id());
            // The old one hears of it first (7.2.2 step b).
            if (oldTop) announceBound(cascade, oldTop, false);
            cascade.store(root(cascade), stackField, stack);
            announce(cascade, node, true);
        } else {
            if (found == stack.end()) return;
            stack.erase(static_cast<std::size_t>(found - stack.begin()));
            if (onTop) announce(cascade, node, false);
            cascade.store(root(cascade), stackField, stack);
            if (onTop && !stack.empty()) announceBound(cascade, stack[0], true);
        }
    }
    /// The first one found is bound when nothing is; one that has come to the top because others were deleted hears it.
    static double onTime(Cascade& cascade, const Node& node) {
        Array<NodeId> stack = root(cascade).get(stackField);
        if (stack.empty()) {
            stack.push_back(node.id());
            cascade.store(root(cascade), stackField, stack);
        }
        if (stack[0] == node.id() && !node.get(N::isBound)) announce(cascade, node, true);
        return kNever;
    }
};

template <class N, const Stack& stack>
BuiltinBehaviour bindable() {
    return {N::type, {.onEvent = Bindable<N, stack>::onEvent, .onTime = Bindable<N, stack>::onTime}};
}

/// The fields by which a type moves what is below it: Transform, and whoever has the like (CADPart, EspduTransform,
/// HAnimJoint, HAnimSite, types of users). kNoField in `rotation` for all others.
struct PlaceFields {
    FieldIndex translation = kNoField, rotation = kNoField, scale = kNoField, scaleOrientation = kNoField,
               center = kNoField;
};

PlaceFields findPlaceFields(const NodeType& type) {
    const auto find = [&](std::string_view name, FieldType wanted) {
        const FieldIndex index = type.findExact(name);
        const bool fits = index != kNoField && type.fields[index].type == wanted && type.fields[index].readable();
        return fits ? index : kNoField;
    };
    PlaceFields fields;
    if (type.below.empty() || !type.isA("X3DChildNode")) return fields;
    fields.translation = find("translation", FieldType::SFVec3f);
    if (fields.translation == kNoField) return fields;
    fields.rotation = find("rotation", FieldType::SFRotation);
    fields.scale = find("scale", FieldType::SFVec3f);
    fields.scaleOrientation = find("scaleOrientation", FieldType::SFRotation);
    fields.center = find("center", FieldType::SFVec3f);
    return fields;
}

PlaceFields placeFields(const Node& node) {
    static const std::vector<PlaceFields> builtin = [] {
        std::vector<PlaceFields> all;
        for (const auto& type : builtinTypes()) all.push_back(findPlaceFields(*type));
        return all;
    }();
    const std::size_t index = node.typeIndex().value;
    return index < builtin.size() ? builtin[index] : findPlaceFields(node.type());
}

/// 10.4.4: T C R SR S -SR -C.
glm::dmat4 localMatrix(const Node& node) {
    const PlaceFields fields = placeFields(node);
    if (fields.rotation == kNoField) return glm::dmat4(1);
    const auto get = [&](auto otherwise, FieldIndex field) {
        return field == kNoField ? otherwise : node.get(Field<decltype(otherwise)>{field});
    };
    const auto rotate = [](const Rotation& r) {
        const glm::dvec3 axis(r.x, r.y, r.z);
        return glm::length(axis) > 0 ? glm::rotate(glm::dmat4(1), double(r.angle), axis) : glm::dmat4(1);
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

/// Whether nodes in this field are below the node: not those that a stack points at, that a Script refers to, or that
/// are handed to a PROTO instance, whose body then holds them by IS.
bool isPlace(const NodeType& type, FieldIndex field) {
    const FieldDef& def = type.fields[field];
    if (type.kind == NodeType::Kind::script || type.isA("X3DScriptNode")) return false;
    if (type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto) return def.hidden;
    return !def.hidden || def.aspect == Aspect::structure;
}

/// Along the first path from the root.
glm::dmat4 worldFromLocal(const Scene& scene, NodeId id) {
    glm::dmat4 world(1);
    constexpr int kDeepest = 1 << 20;
    for (int depth = 0; id && depth < kDeepest; ++depth) {
        const Node* node = scene.find(id);
        if (!node) break;
        world = localMatrix(*node) * world;
        const auto parents = scene.parents(id);
        id = NodeId{};
        for (const ParentRef& p : parents) {
            if (!isPlace(scene.node(p.node).type(), p.field)) continue;
            id = p.node;
            break;
        }
    }
    return world;
}

/// Whether some path leads up from the node to the root.
bool isInScene(const Scene& scene, NodeId id) {
    std::vector<NodeId> pending{id};
    std::unordered_set<std::uint32_t> seen;
    while (!pending.empty()) {
        const NodeId node = pending.back();
        pending.pop_back();
        if (node == scene.root()) return true;
        if (!seen.insert(node.value).second) continue;
        for (const ParentRef& p : scene.parents(node))
            if (isPlace(scene.node(p.node).type(), p.field)) pending.push_back(p.node);
    }
    return false;
}

/// Takes what is no longer in the scene off the top of a stack, as if it were unbound (7.2.2); who comes to the top is
/// bound. Of those below the top each is looked at when it comes there.
void unbindWhatHasLeft(Cascade& cascade, Field<Array<NodeId>> stackField) {
    const Scene& scene = cascade.scene();
    Array<NodeId> stack = scene.node(scene.root()).get(stackField);
    std::size_t gone = 0;
    while (gone < stack.size() && !isInScene(scene, stack[gone])) ++gone;
    if (gone == 0) return;
    const NodeId oldTop = stack[0];
    for (std::size_t i = 0; i < gone; ++i) stack.erase(0);
    announceBound(cascade, oldTop, false);
    cascade.store(scene.node(scene.root()), stackField, stack);
    if (!stack.empty()) announceBound(cascade, stack[0], true);
}

}  // namespace

double rootOnTime(Cascade& cascade, const Node&) {
    using R = x3d::RtsgScene;
    for (const auto& stack : {R::_viewpointStack, R::_backgroundStack, R::_navigationStack, R::_fogStack})
        unbindWhatHasLeft(cascade, stack);
    return kNever;
}

void appendBindables(std::vector<BuiltinBehaviour>& table) {
    using R = x3d::RtsgScene;
    table.push_back(bindable<x3d::Viewpoint, R::_viewpointStack>());
    table.push_back(bindable<x3d::OrthoViewpoint, R::_viewpointStack>());
    table.push_back(bindable<x3d::Background, R::_backgroundStack>());
    table.push_back(bindable<x3d::TextureBackground, R::_backgroundStack>());
    table.push_back(bindable<x3d::NavigationInfo, R::_navigationStack>());
    table.push_back(bindable<x3d::Fog, R::_fogStack>());
}

double lodOnTime(Cascade& cascade, const Node& node) {
    using N = x3d::LOD;
    const auto& range = node.get(N::range);
    const auto& children = node.get(N::children);
    if (children.empty()) return kNever;
    const Scene& scene = cascade.scene();
    const auto& stack = scene.node(scene.root()).get(x3d::RtsgScene::_viewpointStack);
    glm::dvec3 viewer(0, 0, 10);  // 23.4.6: where a viewer stands who is given no viewpoint
    if (!stack.empty()) {
        const Node& view = scene.node(stack[0]);
        glm::dvec3 position(0);
        if (view.is(x3d::Viewpoint::type)) position = view.get(x3d::Viewpoint::position);
        if (view.is(x3d::OrthoViewpoint::type)) position = view.get(x3d::OrthoViewpoint::position);
        viewer = worldFromLocal(scene, view.id()) * glm::dvec4(position, 1);
    }
    const glm::dmat4 world = worldFromLocal(scene, node.id());
    const double volume = glm::determinant(world);
    if (volume == 0 || !std::isfinite(volume)) return kUntilMoved;  // drawn flat: any level does
    const glm::dvec3 local = glm::inverse(world) * glm::dvec4(viewer, 1);
    const double distance = glm::length(local - glm::dvec3(node.get(N::center)));
    std::size_t level = 0;
    while (level < range.size() && distance >= range[level]) ++level;
    const auto shown = static_cast<std::int32_t>(std::min(level, children.size() - 1));
    if (shown != node.get(N::level_changed)) cascade.emit(node, N::level_changed, shown);
    return kUntilMoved;
}

}  // namespace rtsg::behaviours
