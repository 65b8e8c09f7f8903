// KeySensor and StringSensor: ISO/IEC 19775-1 V4.0, clause 21. One of all such sensors has the keys at a time: the one
// that was enabled last, which the root knows (`_keyFocus`).
#include <algorithm>

#include <rtsg/core/device_input.h>
#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "text/utf8.h"

namespace rtsg::behaviours {

namespace {

using R = x3d::RtsgScene;

const Node& rootOf(Cascade& cascade) {
    return cascade.scene().node(cascade.scene().root());
}

/// False if the node is no such sensor.
bool isEnabledKeySensor(const Node& node) {
    if (node.is(x3d::KeySensor::type)) return node.get(x3d::KeySensor::enabled);
    return node.is(x3d::StringSensor::type) && node.get(x3d::StringSensor::enabled);
}

void disable(Cascade& cascade, const Node& sensor) {
    const FieldIndex enabled = sensor.type().findExact("enabled");
    if (enabled != kNoField) (void)cascade.deliver(sensor.id(), enabled, Value(false));
}

/// 21.2: the keys are for this one now; the sensor that had them gets an `enabled` event with the value FALSE.
void take(Cascade& cascade, const Node& node) {
    const Node& root = rootOf(cascade);
    const Node* before = cascade.scene().find(root.get(R::_keyFocus));
    if (before == &node) return;
    cascade.store(root, R::_keyFocus, node.id());
    if (before) disable(cascade, *before);
}

/// In a scene's first frame the sensors of the document are still to be started: one that an event enables comes after
/// them.
void silenceOthers(Cascade& cascade, const Node& node) {
    std::vector<NodeId> others;
    cascade.scene().forEachNode([&](const Node& other) {
        if (&other != &node && isEnabledKeySensor(other)) others.push_back(other.id());
    });
    for (const NodeId other : others) disable(cascade, cascade.scene().node(other));
}

/// One that is disabled: nobody has the keys.
template <class N>
void release(Cascade& cascade, const Node& node) {
    const Node& root = rootOf(cascade);
    if (root.get(R::_keyFocus) == node.id()) cascade.store(root, R::_keyFocus, NodeId{});
    if (node.get(N::isActive)) cascade.emit(node, N::isActive, false);
}

template <class N>
void keySensorOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field != N::enabled.index) return;
    if (!value.as<bool>()) return release<N>(cascade, node);
    take(cascade, node);
    if (cascade.previous() == cascade.now()) silenceOthers(cascade, node);
}

/// One that comes into being enabled, or is edited.
template <class N>
double keySensorOnTime(Cascade& cascade, const Node& node) {
    if (node.get(N::enabled))
        take(cascade, node);
    else
        release<N>(cascade, node);
    return kNever;
}

std::string utf8(char32_t c) {
    const auto byte = [](char32_t bits) { return static_cast<char>(static_cast<unsigned char>(bits)); };
    if (c < 0x80) return {byte(c)};
    if (c < 0x800) return {byte(0xC0 | c >> 6), byte(0x80 | (c & 0x3F))};
    if (c < 0x10000) return {byte(0xE0 | c >> 12), byte(0x80 | (c >> 6 & 0x3F)), byte(0x80 | (c & 0x3F))};
    return {byte(0xF0 | c >> 18), byte(0x80 | (c >> 12 & 0x3F)), byte(0x80 | (c >> 6 & 0x3F)), byte(0x80 | (c & 0x3F))};
}

/// 21.4.1. If several keys are held, isActive becomes TRUE when the first goes down, and FALSE when the first comes up.
void press(Cascade& cascade, const Node& node, const KeyInput& key) {
    using N = x3d::KeySensor;
    if (node.get(N::isActive) != key.down) cascade.emit(node, N::isActive, key.down);
    const auto code = static_cast<std::int32_t>(key.action);
    switch (key.action) {
        case ActionKey::none:
            return cascade.emit(node, key.down ? N::keyPress : N::keyRelease, String(utf8(key.character)));
        case ActionKey::shift:
            return cascade.emit(node, N::shiftKey, key.down);
        case ActionKey::control:
            return cascade.emit(node, N::controlKey, key.down);
        case ActionKey::alt:
            return cascade.emit(node, N::altKey, key.down);
        default:
            return cascade.emit(node, key.down ? N::actionKeyPress : N::actionKeyRelease, code);
    }
}

bool isContinuation(char c) {
    return (static_cast<unsigned char>(c) & 0xC0u) == 0x80;
}

/// 21.4.2. The clause has two ways to end a text; here the end of a line does. `typed` is UTF-8.
void type(Cascade& cascade, const Node& node, std::string_view typed) {
    using N = x3d::StringSensor;
    constexpr std::size_t kLongest = std::size_t{64} << 10;
    std::string text = node.get(N::enteredText).str();
    const std::string before = text;
    bool isFinal = false, full = false;
    for (const char c : typed) {
        if (c == '\n' || c == '\r') {
            isFinal = true;
            break;
        }
        if (c == '\b' || c == 127) {
            if (!node.get(N::deletionAllowed)) continue;
            while (!text.empty() && isContinuation(text.back())) text.pop_back();
            if (!text.empty()) text.pop_back();
        } else if (static_cast<unsigned char>(c) >= ' ' || c == '\t') {
            full = full || text.size() + 4 > kLongest;
            if (!full) text += c;
        }
    }
    if (full) cascade.warn(node, "holds 64 KiB, and takes no more until its text is ended");
    // Active from the first character to the end. A text that is typed and ended at one timestamp was never active.
    const bool active = !isFinal && (node.get(N::isActive) || text != before);
    if (node.get(N::isActive) != active) cascade.emit(node, N::isActive, active);
    if (!isFinal) {
        if (text != before) cascade.emit(node, N::enteredText, String(text));
        return;
    }
    cascade.emit(node, N::finalText, String(text));
    cascade.store(node, N::enteredText, String());
}

}  // namespace

void keysOnEvent(Cascade& cascade, const Node& root, FieldIndex field, EventValue value) {
    const Node* node = cascade.scene().find(root.get(R::_keyFocus));
    if (node && !isEnabledKeySensor(*node)) node = nullptr;  // by an edit, of which it does not know yet
    const bool isText = field == R::text.index;
    if (isText) {
        std::size_t replaced = 0;
        if (node && node->is(x3d::StringSensor::type))
            type(cascade, *node, detail::replaceInvalidUtf8(value.as<String>().view(), replaced));
        return;
    }
    const auto key = KeyInput::fromValue(value.as<Array<std::int32_t>>());
    if (!key) return cascade.warn(root, key.error().text);
    if (!node) return;
    if (node->is(x3d::KeySensor::type)) press(cascade, *node, *key);
    if (node->is(x3d::StringSensor::type) && key->down && key->action == ActionKey::none)
        type(cascade, *node, utf8(key->character));
}

void appendKeys(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent, auto onTime) {
        table.push_back({type, {.onEvent = onEvent, .onTime = onTime}});
    };
    add(x3d::KeySensor::type, keySensorOnEvent<x3d::KeySensor>, keySensorOnTime<x3d::KeySensor>);
    add(x3d::StringSensor::type, keySensorOnEvent<x3d::StringSensor>, keySensorOnTime<x3d::StringSensor>);
}

}  // namespace rtsg::behaviours
