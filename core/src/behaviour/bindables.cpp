// Binding stacks (ISO/IEC 19775-1 V4.0, 7.2.2), a set of them for each layer (35.2.1); LayerSet (35.4.2), which says in
// which layer the viewer is; and LOD (23.4.3), which needs the bound viewpoint.
//
// The stacks are hidden MFNode fields of the layers, and of the root for what is in none, top first: so they travel and
// are hashed as everything else.
#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "behaviours.h"
#include "scene/world_transforms.h"
#include "transitions.h"
#include "words.h"

namespace rtsg::behaviours {

namespace {

using Stack = Field<Array<NodeId>>;

enum class BindableKind { viewpoint, background, navigation, fog };
constexpr std::string_view kStackNames[] = {"_viewpointStack", "_backgroundStack", "_navigationStack", "_fogStack"};

const Node& rootOf(const Cascade& cascade) {
    return cascade.scene().node(cascade.scene().root());
}

/// The binding stack of this kind that a layer or the root holds.
Stack stackOf(const Node& holder, BindableKind kind) {
    return {holder.type().findExact(kStackNames[static_cast<int>(kind)])};
}

/// Whether set_bind has emptied the stack: that nothing is bound then is its author's wish.
Field<std::int32_t> emptiedOf(const Node& holder) {
    return {holder.type().findExact("_emptied")};
}
bool isEmptied(const Node& holder, BindableKind kind) {
    return (holder.get(emptiedOf(holder)) >> static_cast<int>(kind) & 1) != 0;
}
void setEmptied(Cascade& cascade, const Node& holder, BindableKind kind, bool emptied) {
    if (isEmptied(holder, kind) == emptied) return;
    cascade.store(holder, emptiedOf(holder), holder.get(emptiedOf(holder)) ^ 1 << static_cast<int>(kind));
}

/// The node that holds the stack for `id`: its layer, on the first path upwards, or else the root.
const Node& holderOf(Cascade& cascade, NodeId id) {
    const Node* layer = layerOf(cascade.scene(), id);
    return layer ? *layer : rootOf(cascade);
}

void storeStack(Cascade& cascade, const Node& holder, BindableKind kind, const Array<NodeId>& stack) {
    const Node& root = rootOf(cascade);
    Array<NodeId> layers = root.get(x3d::RtsgScene::_layers);
    if (holder.id() != root.id() && std::ranges::find(layers, holder.id()) == layers.end()) {
        layers.push_back(holder.id());
        cascade.store(root, x3d::RtsgScene::_layers, layers);
    }
    cascade.store(holder, stackOf(holder, kind), stack);
}

/// A viewpoint brings its NavigationInfo, and takes it away (23.3.1).
void bindNavigation(Cascade& cascade, const Node& node, bool bound) {
    const FieldIndex field = node.type().findExact("navigationInfo");
    if (field == kNoField || node.type().fields[field].type != FieldType::SFNode) return;
    const Node* info = cascade.scene().find(node.get(Field<NodeId>{field}));
    if (info && info->is(x3d::NavigationInfo::type))
        (void)cascade.deliver(info->id(), x3d::NavigationInfo::set_bind.index, Value(bound));
}

/// The top of a stack may be of another type of the same kind (OrthoViewpoint, TextureBackground).
void announceBound(Cascade& cascade, NodeId id, bool bound) {
    const Node& node = cascade.scene().node(id);
    const FieldIndex isBound = node.type().findExact("isBound"), bindTime = node.type().findExact("bindTime");
    const Time now{cascade.now()};
    if (isBound != kNoField) cascade.emitStorage(node, isBound, &bound);
    if (bindTime != kNoField) cascade.emitStorage(node, bindTime, &now);
    // A node that has already sent something else at this timestamp sends this at the next one, from its onTime.
    if (isBound != kNoField && node.get(Field<bool>{isBound}) != bound) cascade.wake(node);
    bindNavigation(cascade, node, bound);
    if (!bound) stopTransition(cascade, node);
}

/// N: node type with set_bind, isBound, bindTime.
template <class N, BindableKind kind>
struct Bindable {
    static void announce(Cascade& cascade, const Node& node, bool bound) {
        cascade.emit(node, N::isBound, bound);
        cascade.emit(node, N::bindTime, Time{cascade.now()});
        bindNavigation(cascade, node, bound);
        if (!bound) stopTransition(cascade, node);
    }
    static constexpr bool kIsView = kind == BindableKind::viewpoint;
    static std::optional<ViewerPose> seenFrom(Cascade& cascade, NodeId top) {
        return kIsView && top ? worldView(cascade.scene(), top) : std::nullopt;
    }
    static void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
        if (field != N::set_bind.index) return;
        const Node& holder = holderOf(cascade, node.id());
        Array<NodeId> stack = holder.get(stackOf(holder, kind));
        const auto found = std::ranges::find(stack, node.id());
        const bool onTop = !stack.empty() && stack[0] == node.id();
        const NodeId oldTop = stack.empty() ? NodeId{} : stack[0];
        if (value.as<bool>()) {
            if (onTop) return;
            if (found != stack.end()) stack.erase(static_cast<std::size_t>(found - stack.begin()));
            stack.insert(0, node.id());
            const auto from = seenFrom(cascade, oldTop);
            // The old one hears of it first (7.2.2 step b).
            if (oldTop) announceBound(cascade, oldTop, false);
            storeStack(cascade, holder, kind, stack);
            setEmptied(cascade, holder, kind, false);
            announce(cascade, node, true);
            if constexpr (kIsView) {
                const bool retains = node.get(N::retainUserOffsets);
                arriveAt(cascade, node, from, retains ? ViewEntry::asLeft : ViewEntry::asAuthored, node.get(N::jump));
            }
        } else {
            if (found == stack.end()) return;
            const auto from = seenFrom(cascade, node.id());
            stack.erase(static_cast<std::size_t>(found - stack.begin()));
            if (onTop) announce(cascade, node, false);
            storeStack(cascade, holder, kind, stack);
            setEmptied(cascade, holder, kind, stack.empty());
            if (!onTop || stack.empty()) return;
            announceBound(cascade, stack[0], true);
            if constexpr (kIsView)
                arriveAt(cascade, cascade.scene().node(stack[0]), from, ViewEntry::asLeft, node.get(N::jump));
        }
    }
    /// The first one found outside of Inlines is bound when nothing is (7.2.2); one that has come to the top because
    /// others were deleted hears it, and so does one whose layer was deleted with its stacks.
    static double onTime(Cascade& cascade, const Node& node) {
        if constexpr (kind == BindableKind::navigation) {
            warnOfWords(cascade, node, "type", node.get(N::type_),
                        {"EXAMINE", "ANY", "WALK", "FLY", "LOOKAT", "NONE", "EXPLORE"});
            warnOfWords(cascade, node, "transitionType", node.get(N::transitionType),
                        {"LINEAR", "TELEPORT", "ANIMATE"});
        }
        const Node& holder = holderOf(cascade, node.id());
        Array<NodeId> stack = holder.get(stackOf(holder, kind));
        if (node.get(N::isBound) && (stack.empty() || stack[0] != node.id())) {
            announce(cascade, node, false);
            return node.get(N::isBound) ? cascade.now() : kNever;
        }
        if (stack.empty()) {
            // A node that was bound before is not bound again by itself.
            if (isEmptied(holder, kind) || node.get(N::bindTime).seconds != 0) return kNever;
            if (isInlined(cascade.scene(), node) || !isInScene(cascade.scene(), node.id())) return kNever;
            stack.push_back(node.id());
            storeStack(cascade, holder, kind, stack);
        }
        if (stack[0] == node.id() && !node.get(N::isBound)) announce(cascade, node, true);
        if (stack[0] == node.id() && !node.get(N::isBound)) return cascade.now();
        if constexpr (kIsView) return goOnWithTransition(cascade, node);
        return kNever;
    }
};

template <class N, BindableKind kind>
BuiltinBehaviour bindable() {
    // Other events, such as a position, are only stored.
    return {N::type,
            {.onEvent = Bindable<N, kind>::onEvent,
             .onTime = Bindable<N, kind>::onTime,
             .local = true,
             .beyond = N::set_bind.index}};
}

/// Takes nodes that are no longer in the layer off the top of a stack, as if they were unbound (7.2.2); the node that
/// comes to the top is bound. Nodes below the top are looked at when they come there.
void unbindWhatHasLeft(Cascade& cascade, const Node& holder, BindableKind kind) {
    const Scene& scene = cascade.scene();
    Array<NodeId> stack = holder.get(stackOf(holder, kind));
    std::size_t gone = 0;
    while (gone < stack.size() && layerOf(scene, stack[gone]) != &holder) ++gone;
    if (gone == 0) return;
    const NodeId oldTop = stack[0];
    for (std::size_t i = 0; i < gone; ++i) stack.erase(0);
    announceBound(cascade, oldTop, false);
    storeStack(cascade, holder, kind, stack);
    if (!stack.empty()) announceBound(cascade, stack[0], true);
}

/// 35.4.2: 0 stands for nodes outside all layers; a number that no layer has is taken as 0.
double layerSetOnTime(Cascade& cascade, const Node& node) {
    if (!isInScene(cascade.scene(), node.id())) return kNever;
    for (const NodeId other : rootOf(cascade).get(x3d::RtsgScene::children))
        if (other < node.id() && cascade.scene().node(other).is(x3d::LayerSet::type)) return kNever;  // that one counts
    const std::int32_t number = node.get(x3d::LayerSet::activeLayer);
    const auto& layers = node.get(x3d::LayerSet::layers);
    NodeId active;
    if (number < 0 || static_cast<std::size_t>(number) > layers.size())
        cascade.warn(node,
                     fmt::format("activeLayer is {}, and there are {} layers: 0 is active", number, layers.size()));
    else if (number >= 1)
        active = layers[static_cast<std::size_t>(number - 1)];
    // The node there may be no layer, or a PROTO instance that stands for one.
    const Node* layer = cascade.scene().effectiveNode(active);
    active = layer && isLayer(*layer) ? layer->id() : NodeId{};
    const Node& root = rootOf(cascade);
    if (root.get(x3d::RtsgScene::_activeLayer) != active) cascade.store(root, x3d::RtsgScene::_activeLayer, active);
    return kNever;
}

}  // namespace

double rootOnTime(Cascade& cascade, const Node& root) {
    using R = x3d::RtsgScene;
    const Scene& scene = cascade.scene();
    if (const NodeId active = root.get(R::_activeLayer); active && !isInScene(scene, active))
        cascade.store(root, R::_activeLayer, NodeId{});
    std::vector<NodeId> holders{root.id()};
    for (const NodeId layer : root.get(R::_layers)) holders.push_back(layer);
    for (const NodeId holder : holders)
        for (const BindableKind kind :
             {BindableKind::viewpoint, BindableKind::background, BindableKind::navigation, BindableKind::fog})
            unbindWhatHasLeft(cascade, scene.node(holder), kind);
    return kNever;
}

void appendBindables(std::vector<BuiltinBehaviour>& table) {
    table.push_back(bindable<x3d::Viewpoint, BindableKind::viewpoint>());
    table.push_back(bindable<x3d::OrthoViewpoint, BindableKind::viewpoint>());
    table.push_back(bindable<x3d::GeoViewpoint, BindableKind::viewpoint>());
    table.push_back(bindable<x3d::Background, BindableKind::background>());
    table.push_back(bindable<x3d::TextureBackground, BindableKind::background>());
    table.push_back(bindable<x3d::NavigationInfo, BindableKind::navigation>());
    table.push_back(bindable<x3d::Fog, BindableKind::fog>());
    table.push_back({x3d::LayerSet::type, {.onTime = layerSetOnTime}});
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
