// LoadSensor: ISO/IEC 19775-1 V4.0, 9.4.3. Whoever loads what urls name (InlineLoader) writes down in _outcomes what
// became of each child (rows of its number and 1 or 0), or 0 alone when one names something else now; both as edits
// between frames, so that replays and replicas need no files, and all hear of them in the same frame.
#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

using x3d::LoadSensor;

using Rows = Array<std::int32_t>;

/// Whether there is something to be loaded, now or once its `load` is TRUE.
bool namesSomething(const Node& node) {
    const FieldIndex url = node.type().findExact("url");
    return node.type().isA("X3DUrlObject") && url != kNoField && node.type().fields[url].type == FieldType::MFString &&
           !node.get(Field<Array<String>>{url}).empty();
}

/// A row for each child: its number, and whether it is watched.
Rows rowsOf(const Scene& scene, const Node& sensor) {
    Rows rows;
    for (const NodeId id : sensor.get(LoadSensor::children)) {
        rows.push_back(static_cast<std::int32_t>(id.value));
        rows.push_back(namesSomething(scene.node(id)) ? 1 : 0);
    }
    return rows;
}

bool isOf(const Rows& rows, const Array<NodeId>& children) {
    if (rows.size() != 2 * children.size()) return false;
    for (std::size_t i = 0; i < children.size(); ++i)
        if (rows[2 * i] != static_cast<std::int32_t>(children[i].value)) return false;
    return true;
}

struct Outcomes {
    std::size_t watched = 0, loaded = 0, failed = 0;
};

Outcomes outcomesOf(const Node& sensor) {
    Outcomes result;
    const Rows &rows = sensor.get(LoadSensor::_watched), &outcomes = sensor.get(LoadSensor::_outcomes);
    for (std::size_t k = 0; k + 1 < rows.size(); k += 2) {
        if (rows[k + 1] == 0) continue;
        ++result.watched;
        for (std::size_t i = 0; i + 1 < outcomes.size(); i += 2)
            if (outcomes[i] == rows[k]) {
                ++(outcomes[i + 1] != 0 ? result.loaded : result.failed);
                break;
            }
    }
    return result;
}

void end(Cascade& cascade, const Node& node, bool loaded) {
    cascade.emit(node, LoadSensor::isLoaded, loaded);
    if (loaded) cascade.emit(node, LoadSensor::loadTime, Time{cascade.now()});
    cascade.emit(node, LoadSensor::isActive, false);
}

/// Looks at the children afresh; whoever loads answers when it sees that.
void begin(Cascade& cascade, const Node& node) {
    cascade.store(node, LoadSensor::_watched, node.get(LoadSensor::enabled) ? rowsOf(cascade.scene(), node) : Rows{});
    cascade.store(node, LoadSensor::_outcomes, Rows{});
    cascade.store(node, LoadSensor::_begun, Time{cascade.now()});
    const bool active = outcomesOf(node).watched > 0;
    if (active != node.get(LoadSensor::isActive)) cascade.emit(node, LoadSensor::isActive, active);
    if (active) cascade.emit(node, LoadSensor::progress, 0.f);
}

double loadSensorOnTime(Cascade& cascade, const Node& node) {
    const bool isSame = node.get(LoadSensor::enabled)
                            ? isOf(node.get(LoadSensor::_watched), node.get(LoadSensor::children))
                            : node.get(LoadSensor::_watched).empty();
    if (!isSame || node.get(LoadSensor::_outcomes).size() == 1) begin(cascade, node);
    if (!node.get(LoadSensor::isActive)) return kNever;
    const Outcomes found = outcomesOf(node);
    const float progress = static_cast<float>(found.loaded) / static_cast<float>(found.watched);
    if (progress != node.get(LoadSensor::progress)) cascade.emit(node, LoadSensor::progress, progress);
    const double timeOut = node.get(LoadSensor::timeOut).seconds;
    const double until = timeOut > 0 ? node.get(LoadSensor::_begun).seconds + timeOut : kNever;
    if (found.failed > 0 || found.loaded >= found.watched)
        end(cascade, node, found.failed == 0);  // one that fails decides it
    else if (cascade.now() >= until)
        end(cascade, node, false);
    else
        return until;
    return kNever;
}

}  // namespace

void appendLoadSensor(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::LoadSensor::type, {.onTime = loadSensorOnTime}});
}

}  // namespace rtsg::behaviours
