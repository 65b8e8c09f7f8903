// The linear interpolators: ISO/IEC 19775-1 V4.0, 19.2.2, 19.3.1 and 19.4. One template for all of them.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>

#include <rtsg/core/color_blend.h>
#include <rtsg/core/geospatial.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "key_span.h"

namespace rtsg::behaviours {

namespace {

/// Numbers further apart than the largest float are blended in double precision.
[[gnu::cold, gnu::noinline]] void blendAgain(const float* a, const float* b, float w, float* out, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        if (!std::isfinite(out[i])) out[i] = static_cast<float>(double(a[i]) + (double(b[i]) - double(a[i])) * w);
}

/// Tests few numbers at once: a number that is not finite does not give 0 when it is multiplied by 0.
template <std::size_t count>
bool areFinite(const float* values) {
    float none = 0;
    for (std::size_t i = 0; i < count; ++i) none += values[i] * 0.0f;
    return none == 0;
}

/// Tests long lists, many numbers at a time.
bool areFinite(const float* values, std::size_t count) {
    constexpr std::uint32_t kExponent = 0x7f800000;
    unsigned bad = 0;
    for (std::size_t i = 0; i < count; ++i)
        bad |= (std::bit_cast<std::uint32_t>(values[i]) & kExponent) == kExponent ? 1u : 0u;
    return bad == 0;
}

template <class T>
const float* numbersOf(const T& value) {
    return reinterpret_cast<const float*>(&value);
}

template <class T>
T blend(const T& a, const T& b, float w) {
    constexpr std::size_t kCount = sizeof(T) / sizeof(float);
    T result = a + (b - a) * w;
    if (!areFinite<kCount>(numbersOf(result))) [[unlikely]]
        blendAgain(numbersOf(a), numbersOf(b), w, const_cast<float*>(numbersOf(result)), kCount);
    return result;
}

/// Shortest arc (19.4.6). At exactly half a turn, which the standard leaves open, the second quaternion is taken as
/// written: finite, and the same everywhere.
Rotation blend(const Rotation& a, const Rotation& b, float w) {
    struct Quaternion {
        double x, y, z, w;
    };
    const auto toQuaternion = [](const Rotation& r) -> Quaternion {
        const double length = std::sqrt(double(r.x) * r.x + double(r.y) * r.y + double(r.z) * r.z);
        if (!(length > 0)) return {0, 0, 0, 1};
        const portable::SineCosine half = portable::sineCosine(r.angle * .5);
        const double s = half.sine / length;
        return {r.x * s, r.y * s, r.z * s, half.cosine};
    };
    // At the keys the authored values come out as they are.
    if (w == 0) return a;
    if (w == 1) return b;
    const Quaternion p = toQuaternion(a);
    Quaternion q = toQuaternion(b);
    double cosine = p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w;
    if (cosine < 0) {
        q = {-q.x, -q.y, -q.z, -q.w};
        cosine = -cosine;
    }
    double wp = 1 - double(w), wq = w;
    if (cosine < 1 - 1e-9) {
        const double angle = portable::acos(cosine), sine = portable::sin(angle);
        wp = portable::sin((1 - double(w)) * angle) / sine;
        wq = portable::sin(double(w) * angle) / sine;
    }
    const double x = wp * p.x + wq * q.x, y = wp * p.y + wq * q.y, z = wp * p.z + wq * q.z;
    const double c = wp * p.w + wq * q.w;
    const double s = std::sqrt(x * x + y * y + z * z);
    if (!(s > 0)) return {a.x, a.y, a.z, 0};
    return {static_cast<float>(x / s), static_cast<float>(y / s), static_cast<float>(z / s),
            static_cast<float>(2 * portable::atan2(s, c))};
}

/// 19.4.5: along the great circle between the two directions.
Vec3f mixNormal(const Vec3f& a, const Vec3f& b, float w) {
    const float la = glm::length(a), lb = glm::length(b);
    if (!(la > 0) || !(lb > 0)) return blend(a, b, w);
    const Vec3f p = a / la, q = b / lb;
    const float cosine = std::clamp(glm::dot(p, q), -1.0f, 1.0f);
    const double angle = portable::acos(cosine), sine = portable::sin(angle);
    if (!(sine > 1e-6)) return w < .5f ? p : q;  // equal, or opposite: no circle is singled out
    const double wp = portable::sin((1 - double(w)) * angle) / sine, wq = portable::sin(double(w) * angle) / sine;
    return p * static_cast<float>(wp) + q * static_cast<float>(wq);
}

template <class N>
void interpolateOne(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    const std::optional<Span> s = spanAt<N>(cascade, node, field, value);
    if (!s) return;
    const auto& values = node.get(N::keyValue);
    cascade.emit(node, N::value_changed, blend(values[s->from], values[s->to], s->weight));
}

/// 25.3.7: in the numbers of the geographic system; and where that is in the scene.
void interpolateGeo(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    using N = x3d::GeoPositionInterpolator;
    const std::optional<Span> s = spanAt<N>(cascade, node, field, value);
    if (!s) return;
    const auto& values = node.get(N::keyValue);
    const Vec3d coordinates = values[s->from] + (values[s->to] - values[s->from]) * double(s->weight);
    cascade.emit(node, N::geovalue_changed, coordinates);
    const auto reference = GeoReference::of(cascade.scene(), node);
    if (!reference) return cascade.warn(node, reference.error().text);
    cascade.emit(node, N::value_changed, Vec3f(reference->toScene(coordinates)));
}

/// Interpolates several values for each key, as coordinates and normals have them.
template <class N, auto Mix>
void interpolateMany(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field != N::set_fraction.index) return;
    noteInput<N>(cascade, node);
    const float fraction = value.as<float>();
    const auto& key = node.get(N::key);
    const auto& values = node.get(N::keyValue);
    if (key.empty() || std::isnan(fraction)) return;
    const std::size_t each = values.size() / key.size();
    if (each * key.size() != values.size())
        cascade.warn(node, std::to_string(values.size()) + " key values are no multiple of " +
                               std::to_string(key.size()) + " keys; the rest is left out");
    if (each == 0) return;
    const Span s = locate(key, key.size(), fraction);
    using Element = std::remove_cvref_t<decltype(values[0])>;
    auto result = Array<Element>::ofSize(each);
    Element* out = result.mutableData();
    const Element *from = values.data() + s.from * each, *to = values.data() + s.to * each;
    for (std::size_t i = 0; i < each; ++i) out[i] = Mix(from[i], to[i], s.weight);
    if constexpr (!std::is_same_v<N, x3d::NormalInterpolator>)
        if (const std::size_t count = each * sizeof(Element) / sizeof(float); !areFinite(numbersOf(*out), count))
            [[unlikely]]
            blendAgain(numbersOf(*from), numbersOf(*to), s.weight, const_cast<float*>(numbersOf(*out)), count);
    cascade.emit(node, N::value_changed, result);
}

constexpr auto kMix2 = [](const Vec2f& a, const Vec2f& b, float w) { return a + (b - a) * w; };
constexpr auto kMix3 = [](const Vec3f& a, const Vec3f& b, float w) { return a + (b - a) * w; };
constexpr auto kMixNormal = [](const Vec3f& a, const Vec3f& b, float w) { return mixNormal(a, b, w); };

}  // namespace

void appendInterpolators(std::vector<BuiltinBehaviour>& table) {
    const auto add = [&](TypeIndex type, auto onEvent) {
        table.push_back({type, {.onEvent = onEvent, .local = true}});
    };
    add(x3d::ScalarInterpolator::type, interpolateOne<x3d::ScalarInterpolator>);
    add(x3d::PositionInterpolator::type, interpolateOne<x3d::PositionInterpolator>);
    add(x3d::PositionInterpolator2D::type, interpolateOne<x3d::PositionInterpolator2D>);
    add(x3d::OrientationInterpolator::type, interpolateOne<x3d::OrientationInterpolator>);
    add(x3d::ColorInterpolator::type, interpolateOne<x3d::ColorInterpolator>);
    add(x3d::CoordinateInterpolator::type, interpolateMany<x3d::CoordinateInterpolator, kMix3>);
    add(x3d::CoordinateInterpolator2D::type, interpolateMany<x3d::CoordinateInterpolator2D, kMix2>);
    table.push_back({x3d::GeoPositionInterpolator::type, {.onEvent = interpolateGeo}});  // looks at its GeoOrigin
    add(x3d::NormalInterpolator::type, interpolateMany<x3d::NormalInterpolator, kMixNormal>);
}

}  // namespace rtsg::behaviours
