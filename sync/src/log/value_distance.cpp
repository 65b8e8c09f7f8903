// Computes how far two values are apart, as one number.
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include <rtsg/sync/field_comparison.h>

#include <rtsg/core/portable_math.h>

namespace rtsg {

namespace {

constexpr double kApart = std::numeric_limits<double>::infinity();

double apart(double a, double b) {
    if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
    const double difference = std::abs(a - b);
    return std::isnan(difference) ? kApart : difference;
}

/// The angle of the rotation from one to the other, 0 to pi. An axis of length 0 means no rotation.
double apart(const Rotation& a, const Rotation& b) {
    if (a == b) return 0;
    const auto quaternion = [](const Rotation& r, double(&q)[4]) {
        const double length = std::sqrt(double(r.x) * r.x + double(r.y) * r.y + double(r.z) * r.z);
        const double s = length > 0 ? portable::sin(double(r.angle) / 2) / length : 0;
        q[0] = length > 0 ? portable::cos(double(r.angle) / 2) : 1;
        q[1] = s * r.x, q[2] = s * r.y, q[3] = s * r.z;
    };
    double p[4], q[4];
    quaternion(a, p);
    quaternion(b, q);
    // Uses the chords p - q and p + q, which are exact for small angles; the arc cosine of the product is not.
    double near = 0, far = 0;
    for (int i = 0; i < 4; ++i) near += (p[i] - q[i]) * (p[i] - q[i]), far += (p[i] + q[i]) * (p[i] + q[i]);
    const double angle = 4 * portable::atan2(std::sqrt(std::min(near, far)), std::sqrt(std::max(near, far)));
    return std::isnan(angle) ? kApart : angle;
}

template <class T>
double apart(const T& a, const T& b) {
    if constexpr (std::is_arithmetic_v<T>) {
        return apart(static_cast<double>(a), static_cast<double>(b));
    } else if constexpr (std::is_same_v<T, String> || std::is_same_v<T, Image> || std::is_same_v<T, NodeId>) {
        return a == b ? 0 : kApart;
    } else if constexpr (std::is_same_v<T, CustomValue>) {
        const std::vector<double> p = customNumbers(a), q = customNumbers(b);
        const auto type = CustomType::of(a);
        if (a == b) return 0;
        if (!type || !type->holds(b) || p.size() != q.size()) return kApart;
        double largest = 0;
        for (std::size_t i = 0; i < p.size(); ++i) largest = std::max(largest, apart(p[i], q[i]));
        return largest;
    } else if constexpr (std::is_same_v<T, Time>) {
        return apart(a.seconds, b.seconds);
    } else if constexpr (requires { a.elements; }) {
        double largest = 0;
        for (std::size_t i = 0; i < a.elements.size(); ++i)
            largest = std::max(largest, apart(double(a.elements[i]), double(b.elements[i])));
        return largest;
    } else if constexpr (
        requires {
            a.r;
            a.g;
        } && !requires { a.x; }) {
        double largest = std::max({apart(a.r, b.r), apart(a.g, b.g), apart(a.b, b.b)});
        if constexpr (requires { a.a; }) largest = std::max(largest, apart(a.a, b.a));
        return largest;
    } else {
        double largest = 0;
        for (int i = 0; i < T::length(); ++i) largest = std::max(largest, apart(double(a[i]), double(b[i])));
        return largest;
    }
}

template <class T>
double apart(const Array<T>& a, const Array<T>& b) {
    if (a.size() != b.size()) return kApart;
    double largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, apart(a[i], b[i]));
    return largest;
}

}  // namespace

double valueDistance(const Value& a, const Value& b) {
    if (a.type() != b.type()) return kApart;
    switch (a.type()) {
#define RTSG_X(suffix, type)                      \
    case FieldType::SF##suffix:                   \
        return apart(a.as<type>(), b.as<type>()); \
    case FieldType::MF##suffix:                   \
        return apart(a.as<Array<type>>(), b.as<Array<type>>());
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return kApart;
}

}  // namespace rtsg
