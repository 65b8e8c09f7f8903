// A viewer's moves as numbers, and back.
#include "viewer_move.h"

#include <cmath>

namespace rtsg {

namespace {

/// Kind, viewpoint, position, quaternion, centre.
constexpr std::size_t kMove = 2 + 3 + 4 + 3;

bool isComplete(double number, double maximum) {
    return number >= 0 && number <= maximum && number == std::floor(number);
}

NavigationState stateFrom(const double* v) {
    NavigationState state;
    state.viewpoint = NodeId{static_cast<std::uint32_t>(v[0])};
    state.held = static_cast<std::uint32_t>(v[1]);
    state.dragging = v[2] != 0;
    state.dragged = v[3] != 0;
    state.walking = v[4] != 0;
    state.at = {v[5], v[6]};
    state.fallSpeed = v[7];
    return state;
}
bool isState(const double* v) {
    for (std::size_t i = 0; i < NavigationState::kNumbers; ++i)
        if (!std::isfinite(v[i])) return false;
    return isComplete(v[0], UINT32_MAX) && isComplete(v[1], NavigationState::kAllKeys);
}
void append(Array<double>& value, const NavigationState& state) {
    for (const double number : {double(state.viewpoint.value), double(state.held), double(state.dragging),
                                double(state.dragged), double(state.walking), state.at.x, state.at.y, state.fallSpeed})
        value.push_back(number);
}

}  // namespace

Array<double> NavigationState::toValue() const {
    Array<double> value;
    if (*this != NavigationState{}) append(value, *this);
    return value;
}

NavigationState NavigationState::fromValue(const Array<double>& v) {
    return v.size() == kNumbers && isState(v.data()) ? stateFrom(v.data()) : NavigationState{};
}

Array<double> ViewerMove::toValue() const {
    Array<double> value{double(static_cast<int>(kind)), double(viewpoint.value)};
    const glm::dquat& q = offset.orientation;
    for (const double number :
         {offset.position.x, offset.position.y, offset.position.z, q.x, q.y, q.z, q.w, center.x, center.y, center.z})
        value.push_back(number);
    if (state) append(value, *state);
    if (offset.zoom != 1) value.push_back(offset.zoom);
    return value;
}

Result<ViewerMove> ViewerMove::fromValue(const Array<double>& v) {
    constexpr std::size_t kWithState = kMove + NavigationState::kNumbers;
    const bool hasState = v.size() >= kWithState, zooms = v.size() == kMove + 1 || v.size() == kWithState + 1;
    if (v.size() != kMove && v.size() != kWithState && !zooms) return fail("a viewer's move is of a wrong length");
    for (const double number : v)
        if (!std::isfinite(number)) return fail("a viewer's move is not finite");
    if (!isComplete(v[0], 3)) return fail("a viewer's move is of an unknown kind");
    if (!isComplete(v[1], UINT32_MAX)) return fail("a viewer's move names no viewpoint");
    ViewerMove move;
    move.kind = static_cast<Kind>(v[0]);
    move.viewpoint = NodeId{static_cast<std::uint32_t>(v[1])};
    move.offset.position = {v[2], v[3], v[4]};
    const glm::dquat q(v[8], v[5], v[6], v[7]);
    constexpr double kUnit = 1e-6;
    if (std::abs(glm::length(q) - 1) > kUnit) return fail("a viewer's move turns by what is no rotation");
    move.offset.orientation = q;
    move.center = {v[9], v[10], v[11]};
    if (zooms && !(v[v.size() - 1] > 0)) return fail("a viewer's move zooms by what is no factor");
    if (zooms) move.offset.zoom = v[v.size() - 1];
    if (!hasState) return move;
    if (!isState(v.data() + kMove)) return fail("a viewer's move goes on from no state");
    move.state = stateFrom(v.data() + kMove);
    return move;
}

}  // namespace rtsg
