// Event utilities: ISO/IEC 19775-1 V4.0, clause 30.
#include <algorithm>
#include <cmath>

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
    if (field == N::set_boolean.index && value.as<bool>()) cascade.emit(node, N::triggerValue, node.get(N::integerKey));
}

void timeTrigger(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    using N = x3d::TimeTrigger;
    if (field == N::set_boolean.index) cascade.emit(node, N::triggerTime, Time{cascade.now()});
}

/// 30.2.1: the value of the newest key passed; next and previous go round.
template <class N>
void sequencer(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    const auto& key = node.get(N::key);
    const auto& values = node.get(N::keyValue);
    const auto count = static_cast<std::int32_t>(std::min(key.size(), values.size()));
    if (count == 0) return;
    std::int32_t index = node.get(N::_index);
    if (field == N::set_fraction.index) {
        const float fraction = value.as<float>();
        if (std::isnan(fraction)) return;
        const float* after = std::upper_bound(key.begin(), key.begin() + count, fraction);
        index = std::max<std::int32_t>(0, static_cast<std::int32_t>(after - key.begin()) - 1);
    } else if (field == N::next.index && value.as<bool>()) {
        index = (index + 1) % count;
    } else if (field == N::previous.index && value.as<bool>()) {
        index = (index + count - 1) % count;
    } else {
        return;
    }
    index = std::clamp(index, 0, count - 1);
    cascade.store(node, N::_index, index);
    cascade.emit(node, N::value_changed, values[static_cast<std::size_t>(index)]);
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
