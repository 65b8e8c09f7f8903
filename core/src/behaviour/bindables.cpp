// Binding stacks (ISO/IEC 19775-1 V4.0, 7.2.2) and LOD (23.4.3), which needs the bound viewpoint.
//
// The stacks are hidden MFNode fields of the root, top first: so they travel and are hashed as everything else.
#include <algorithm>
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

using Stack = Field<Array<NodeId>>;

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
            if (oldTop) announceTo(cascade, oldTop, false);
            cascade.store(root(cascade), stackField, stack);
            announce(cascade, node, true);
        } else {
            if (found == stack.end()) return;
            stack.erase(static_cast<std::size_t>(found - stack.begin()));
            if (onTop) announce(cascade, node, false);
            cascade.store(root(cascade), stackField, stack);
            if (onTop && !stack.empty()) announceTo(cascade, stack[0], true);
        }
    }
    /// The top of a stack may be of another type of the same kind (OrthoViewpoint, TextureBackground).
    static void announceTo(Cascade& cascade, NodeId id, bool bound) {
        const Node& node = cascade.scene().node(id);
        const FieldIndex isBound = node.type().findExact("isBound"), bindTime = node.type().findExact("bindTime");
        const Time now{cascade.now()};
        if (isBound != kNoField) cascade.emitStorage(node, isBound, &bound);
        if (bindTime != kNoField) cascade.emitStorage(node, bindTime, &now);
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

glm::dmat4 localMatrix(const Node& node) {
    if (!node.is(x3d::Transform::type)) return glm::dmat4(1);
    using T = x3d::Transform;
    const auto rotate = [](const Rotation& r) {
        const glm::dvec3 axis(r.x, r.y, r.z);
        return glm::length(axis) > 0 ? glm::rotate(glm::dmat4(1), double(r.angle), axis) : glm::dmat4(1);
    };
    Rotation back = node.get(T::scaleOrientation);
    back.angle = -back.angle;
    const glm::dvec3 center(node.get(T::center));
    const glm::dmat4 one(1);
    return glm::translate(one, glm::dvec3(node.get(T::translation)) + center) * rotate(node.get(T::rotation)) *
           rotate(node.get(T::scaleOrientation)) * glm::scale(one, glm::dvec3(node.get(T::scale))) * rotate(back) *
           glm::translate(one, -center);
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
            const FieldDef& def = scene.node(p.node).type().fields[p.field];
            if (def.hidden && def.aspect != Aspect::structure) continue;  // a stack's reference is no place
            id = p.node;
            break;
        }
    }
    return world;
}

}  // namespace

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
    if (volume == 0 || !std::isfinite(volume)) return cascade.now();  // drawn flat: any level does
    const glm::dvec3 local = glm::inverse(world) * glm::dvec4(viewer, 1);
    const double distance = glm::length(local - glm::dvec3(node.get(N::center)));
    std::size_t level = 0;
    while (level < range.size() && distance >= range[level]) ++level;
    const auto shown = static_cast<std::int32_t>(std::min(level, children.size() - 1));
    if (shown != node.get(N::level_changed)) cascade.emit(node, N::level_changed, shown);
    return cascade.now();
}

}  // namespace rtsg::behaviours
