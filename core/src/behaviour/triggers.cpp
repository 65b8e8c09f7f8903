// Event utilities: ISO/IEC 19775-1 V4.0, clause 30.
#include <algorithm>
#include <cmath>
#include <string>

#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

void booleanFilter(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    using N = x3d::BooleanFilter;
    if (field != N::set_boolean.index) return;
    const bool input = value.as<bool>();
    if (input)
        cascade.emit(node, N::inputTrue, true);
    else
        cascade.emit(node, N::inputFalse, false);
    cascade.emit(node, N::inputNegate, !input);
}

void booleanToggle(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    using N = x3d::BooleanToggle;
    if (field == N::set_boolean.index && value.as<bool>()) cascade.emit(node, N::toggle, !node.get(N::toggle));
}

void booleanTrigger(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    using N = x3d::BooleanTrigger;
    if (field == N::set_triggerTime.index) cascade.emit(node, N::triggerTrue, true);
}

void integerTrigger(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    using N = x3d::IntegerTrigger;
    // 30.4.6: a new integerKey is told as well.
    const bool triggers = field == N::set_boolean.index && value.as<bool>();
    if (triggers || field == N::integerKey.index) cascade.emit(node, N::triggerValue, node.get(N::integerKey));
}

void timeTrigger(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    using N = x3d::TimeTrigger;
    if (field == N::set_boolean.index) cascade.emit(node, N::triggerTime, Time{cascade.now()});
}

/// The content of `_index`: the place in the sequence times two, plus 1 if the interval of the last fraction is still
/// the one whose value has been sent.
struct Position {
    std::int32_t index = 0;
    bool isReported = false;
    static Position of(std::int32_t stored) { return {stored / 2, stored % 2 != 0}; }
    std::int32_t stored() const { return index * 2 + (isReported ? 1 : 0); }
};

/// 30.2.4, 30.3.1: sends the value of the newest key passed, once for each interval between keys; of equal keys, the
/// first one's. next and previous go round. After these, or new keys, the next fraction sends its value again.
template <class N>
void sequencer(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    const auto& key = node.get(N::key);
    const auto& values = node.get(N::keyValue);
    const auto count = static_cast<std::int32_t>(std::min(key.size(), values.size()));
    const Position before = Position::of(node.get(N::_index));
    if (field == N::key.index || field == N::keyValue.index)
        return cascade.store(node, N::_index, Position{before.index, false}.stored());
    if (key.size() != values.size())
        cascade.warn(node, std::to_string(values.size()) + " key values for " + std::to_string(key.size()) + " keys");
    if (count == 0) return;
    Position now{std::clamp(before.index, 0, count - 1), false};
    if (field == N::set_fraction.index) {
        const float fraction = value.as<float>();
        if (std::isnan(fraction)) return;
        const float* const first = key.begin();
        const float* const after = std::upper_bound(first, first + count, fraction);
        const float* const passed = after == first ? first : after - 1;
        now = {static_cast<std::int32_t>(std::lower_bound(first, passed, *passed) - first), true};
        if (before.isReported && before.index == now.index) return;
    } else if (field == N::next.index && value.as<bool>()) {
        now.index = (now.index + 1) % count;
    } else if (field == N::previous.index && value.as<bool>()) {
        now.index = (now.index + count - 1) % count;
    } else {
        return;
    }
    cascade.store(node, N::_index, now.stored());
    cascade.emit(node, N::value_changed, values[static_cast<std::size_t>(now.index)]);
}

}  // namespace

void appendTriggers(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent) {
        table.push_back({type, {.onEvent = onEvent, .local = true}});
    };
    add(x3d::BooleanFilter::type, booleanFilter);
    add(x3d::BooleanToggle::type, booleanToggle);
    add(x3d::BooleanTrigger::type, booleanTrigger);
    add(x3d::IntegerTrigger::type, integerTrigger);
    add(x3d::TimeTrigger::type, timeTrigger);
    add(x3d::BooleanSequencer::type, sequencer<x3d::BooleanSequencer>);
    add(x3d::IntegerSequencer::type, sequencer<x3d::IntegerSequencer>);
}

}  // namespace rtsg::behaviours
