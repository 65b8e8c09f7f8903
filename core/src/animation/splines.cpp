// Interpolators that are not linear: splines, squad and ease-in-ease-out. ISO/IEC 19775-1 V4.0, 19.2 and 19.4.
//
// A value needs only the velocities at the two keys around it, so a fraction costs the same whatever the number of keys
// (except for normalizeVelocity, which needs the length of the whole path).
#include <cmath>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "key_span.h"

namespace rtsg::behaviours {

namespace {

template <class T>
struct WideOf;
template <>
struct WideOf<float> {
    using Type = double;
};
template <>
struct WideOf<Vec2f> {
    using Type = glm::dvec2;
};
template <>
struct WideOf<Vec3f> {
    using Type = glm::dvec3;
};
double size(double d) {
    return std::abs(d);
}
double size(const auto& d) {
    return glm::length(d);
}

/// A path through its key values with a velocity at each (19.2).
template <class N>
struct Spline {
    using T = std::remove_cvref_t<decltype(std::declval<const Node&>().get(N::value_changed))>;
    using Wide = typename WideOf<T>::Type;

    const Node& node;
    const Array<float>& key = node.get(N::key);
    const Array<T>& value = node.get(N::keyValue);
    const Array<T>& velocity = node.get(N::keyVelocity);
    std::size_t count = std::min(key.size(), value.size());
    std::size_t last = count - 1;
    /// Closed paths return to where they began, and velocities that are given come before that.
    bool closed = node.get(N::closed) && velocity.empty() && count > 2 && value[0] == value[last];

    Wide at(std::size_t i) const { return Wide(value[i]); }
    double length() const {
        double sum = 0;
        for (std::size_t i = 0; i < last; ++i) sum += size(at(i + 1) - at(i));
        return sum;
    }
    Wide tangent(std::size_t i) const {
        const bool isEnd = i == 0 || i == last;
        Wide given;
        if (velocity.size() >= count)
            given = Wide(velocity[i]);
        else if (velocity.size() == 2 && isEnd)
            given = Wide(velocity[i == 0 ? 0 : 1]);
        else if (isEnd)
            return closed ? (at(1) - at(last - 1)) * .5 : Wide(0);
        else
            return (at(i + 1) - at(i - 1)) * .5;
        const double speed = node.get(N::normalizeVelocity) ? size(given) : 0;
        return speed > 0 ? given * (length() / speed) : given;
    }
    /// The factor by which unequal distances of keys change the tangent, on the side where the path arrives at the key
    /// or on the side where it leaves.
    double factor(std::size_t i, bool leaving) const {
        const bool isEnd = i == 0 || i == last;
        if (isEnd && !closed) return 1;
        const double before = isEnd ? double(key[last]) - key[last - 1] : double(key[i]) - key[i - 1];
        const double after = isEnd ? double(key[1]) - key[0] : double(key[i + 1]) - key[i];
        const double both = before + after;
        return both > 0 ? 2 * (leaving ? before : after) / both : 1;
    }
    T interpolate(const Span& s) const {
        if (s.from == s.to || s.weight == 0) return value[s.from];
        const double w = s.weight, w2 = w * w, w3 = w2 * w;
        const Wide leaving = tangent(s.from) * factor(s.from, true), arriving = tangent(s.to) * factor(s.to, false);
        return T(at(s.from) * (2 * w3 - 3 * w2 + 1) + at(s.to) * (3 * w2 - 2 * w3) + leaving * (w3 - 2 * w2 + w) +
                 arriving * (w3 - w2));
    }
};

template <class N>
void spline(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    if (field != N::set_fraction.index) return;
    const std::optional<Span> s = spanAt<N>(cascade, node, field, event);
    const std::size_t values = node.get(N::keyValue).size(), velocities = node.get(N::keyVelocity).size();
    if (velocities != 0 && velocities != 2 && velocities != values)
        cascade.warn(node, std::to_string(velocities) + " key velocities for " + std::to_string(values) +
                               " key values; there may be none, two or as many");
    if (s) cascade.emit(node, N::value_changed, Spline<N>{node}.interpolate(*s));
}

// ---- squad -----------------------------------------------------------------------------------------------------

using Quaternion = glm::dquat;

Quaternion toward(const Quaternion& q, const Quaternion& other) {
    return glm::dot(q, other) < 0 ? -other : other;
}
/// Half the rotation vector.
glm::dvec3 logarithm(const Quaternion& q) {
    const glm::dvec3 v(q.x, q.y, q.z);
    const double s = glm::length(v);
    return s > 0 ? v * (portable::atan2(s, q.w) / s) : glm::dvec3(0);
}
Quaternion exponential(const glm::dvec3& v) {
    const double angle = glm::length(v);
    if (!(angle > 0)) return {1, 0, 0, 0};
    const glm::dvec3 u = v * (portable::sin(angle) / angle);
    return {portable::cos(angle), u.x, u.y, u.z};
}
/// Interpolates along the arc between the two as they are, which may be the longer one. Between opposite ones, which
/// have no single arc, it takes the chord.
Quaternion slerp(const Quaternion& a, const Quaternion& b, double w) {
    const double cosine = std::clamp(glm::dot(a, b), -1.0, 1.0), angle = portable::acos(cosine),
                 sine = portable::sin(angle);
    if (!(sine > 1e-9)) return w < .5 ? a : b;
    return a * (portable::sin((1 - w) * angle) / sine) + b * (portable::sin(w * angle) / sine);
}

void squad(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    using N = x3d::SquadOrientationInterpolator;
    const std::optional<Span> found = spanAt<N>(cascade, node, field, event);
    if (!found) return;
    const Span s = *found;
    const auto& value = node.get(N::keyValue);
    const std::size_t count = std::min(node.get(N::key).size(), value.size());
    if (s.from == s.to || s.weight == 0) return cascade.emit(node, N::value_changed, value[s.from]);
    // Four neighbours, each on the side of the one before it: the shorter way from key to key.
    const Quaternion a = toQuaternion(value[s.from]), b = toward(a, toQuaternion(value[s.to]));
    const auto inner = [](const Quaternion& before, const Quaternion& q, const Quaternion& after) {
        const Quaternion back = glm::conjugate(q);
        return q * exponential((logarithm(back * before) + logarithm(back * after)) * -.25);
    };
    const Quaternion sa = s.from == 0 ? a : inner(toward(a, toQuaternion(value[s.from - 1])), a, b);
    const Quaternion sb = s.to + 1 == count ? b : inner(a, b, toward(b, toQuaternion(value[s.to + 1])));
    const double w = s.weight;
    cascade.emit(node, N::value_changed, toRotation(slerp(slerp(a, b, w), slerp(sa, sb, w), 2 * w * (1 - w))));
}

/// 19.4.4: parabolas where it begins and ends, a line between.
void easeInEaseOut(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
    using N = x3d::EaseInEaseOut;
    if (field != N::set_fraction.index) return;
    const float fraction = event.as<float>();
    const auto& key = node.get(N::key);
    const auto& ease = node.get(N::easeInEaseOut);
    if (key.size() != ease.size())
        cascade.warn(node, std::to_string(ease.size()) + " pairs of ease for " + std::to_string(key.size()) + " keys");
    if (key.empty() || std::isnan(fraction)) return;
    const Span s = locate(key, key.size(), fraction);
    double w = s.weight;
    if (s.from == s.to) w = s.from == 0 ? 0 : 1;
    double out = s.from < ease.size() ? ease[s.from].y : 0, in = s.to < ease.size() ? ease[s.to].x : 0;
    const double sum = out + in;
    double modified = w;
    if (sum >= 0 && out >= 0 && in >= 0) {
        if (sum > 1) {
            out /= sum;
            in /= sum;
        }
        const double t = 1 / (2 - out - in);
        if (w < out)
            modified = t / out * w * w;
        else if (w <= 1 - in)
            modified = t * (2 * w - out);
        else
            modified = 1 - t * (1 - w) * (1 - w) / in;
    }
    cascade.emit(node, N::modifiedFraction_changed, static_cast<float>(modified));
}

}  // namespace

void appendSplines(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent) {
        table.push_back({type, {.onEvent = onEvent, .local = true}});
    };
    add(x3d::SplinePositionInterpolator::type, spline<x3d::SplinePositionInterpolator>);
    add(x3d::SplinePositionInterpolator2D::type, spline<x3d::SplinePositionInterpolator2D>);
    add(x3d::SplineScalarInterpolator::type, spline<x3d::SplineScalarInterpolator>);
    add(x3d::SquadOrientationInterpolator::type, squad);
    add(x3d::EaseInEaseOut::type, easeInEaseOut);
}

}  // namespace rtsg::behaviours
