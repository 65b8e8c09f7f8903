// Binding stacks (ISO/IEC 19775-1 V4.0, 7.2.2) and LOD (23.4.3), which needs the bound viewpoint.
//
// The stacks are hidden MFNode fields of the root, top first: so they travel and are hashed as everything else.
#include <algorithm>
#include <cmath>

#include <rtsg/core/x3d.h>

#include "behaviours.h"
#include "scene/places.h"

namespace rtsg::behaviours {

namespace {

using Stack = Field<Array<NodeId>>;

/// A viewpoint brings its NavigationInfo, and takes it away (23.3.1).
void bindNavigation(Cascade& cascade, const Node& node, bool bound) {
    const FieldIndex field = node.type().findExact("navigationInfo");
    if (field == kNoField || node.type().fields[field].type != FieldType::SFNode) return;
    const Node* info = cascade.scene().find(node.get(Field<NodeId>{field}));
    if (info && info->is(x3d::NavigationInfo::type))
        (void)cascade.deliver(info->id(), x3d::NavigationInfo::set_bind.index, Value(bound));
}

/// The viewer is where the viewpoint is at once: the transition is complete when it begins.
void completeTransition(Cascade& cascade) {
    const Scene& scene = cascade.scene();
    const auto& stack = scene.node(scene.root()).get(x3d::RtsgScene::_navigationStack);
    if (!stack.empty() && scene.node(stack[0]).is(x3d::NavigationInfo::type))
        cascade.emit(scene.node(stack[0]), x3d::NavigationInfo::transitionComplete, true);
}

/// The top of a stack may be of another type of the same kind (OrthoViewpoint, TextureBackground).
void announceBound(Cascade& cascade, NodeId id, bool bound) {
    const Node& node = cascade.scene().node(id);
    const FieldIndex isBound = node.type().findExact("isBound"), bindTime = node.type().findExact("bindTime");
    const Time now{cascade.now()};
    if (isBound != kNoField) cascade.emitStorage(node, isBound, &bound);
    if (bindTime != kNoField) cascade.emitStorage(node, bindTime, &now);
    bindNavigation(cascade, node, bound);
}

/// N: node type with set_bind, isBound, bindTime. The stack's handle is a type parameter's static member.
template <class N, const Stack& stackField>
struct Bindable {
    static const Node& root(Cascade& cascade) { return cascade.scene().node(cascade.scene().root()); }
    static void announce(Cascade& cascade, const Node& node, bool bound) {
        cascade.emit(node, N::isBound, bound);
        cascade.emit(node, N::bindTime, Time{cascade.now()});
        bindNavigation(cascade, node, bound);
    }
    static constexpr bool kIsView = N::type == x3d::Viewpoint::type || N::type == x3d::OrthoViewpoint::type;
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
            if (kIsView && oldTop) completeTransition(cascade);
        } else {
            if (found == stack.end()) return;
            stack.erase(static_cast<std::size_t>(found - stack.begin()));
            if (onTop) announce(cascade, node, false);
            cascade.store(root(cascade), stackField, stack);
            if (onTop && !stack.empty()) {
                announceBound(cascade, stack[0], true);
                if (kIsView) completeTransition(cascade);
            }
        }
    }
    /// The first one found is bound when nothing is; one that has come to the top because others were deleted hears it.
    static double onTime(Cascade& cascade, const Node& node) {
        Array<NodeId> stack = root(cascade).get(stackField);
        if (stack.empty()) {
            // One that was bound before has been unbound: that nothing is bound then is its author's wish.
            if (node.get(N::bindTime).seconds != 0) return kNever;
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
    const glm::dvec3 viewer = cascade.viewer(node).position;
    const glm::dmat4& world = cascade.worldFromLocal(node, node);
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
