// Holds frames back until they are due, and interpolates between the replica and the next one.
#include "playout.h"

#include <algorithm>
#include <cmath>

#include <rtsg/core/portable_math.h>

namespace rtsg {

namespace {

std::uint64_t keyOf(NodeId node, FieldIndex field) {
    return std::uint64_t{node.value} << 16 | field;
}

struct Quaternion {
    double w, x, y, z;
};

Quaternion quaternionOf(const Rotation& r) {
    const double length = std::sqrt(double(r.x) * r.x + double(r.y) * r.y + double(r.z) * r.z);
    if (!(length > 0)) return {1, 0, 0, 0};
    const double s = portable::sin(double(r.angle) / 2) / length;
    return {portable::cos(double(r.angle) / 2), s * r.x, s * r.y, s * r.z};
}

Rotation slerp(const Rotation& from, const Rotation& to, double t) {
    const Quaternion a = quaternionOf(from);
    Quaternion b = quaternionOf(to);
    double dot = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
    if (dot < 0) {
        b = {-b.w, -b.x, -b.y, -b.z};
        dot = -dot;
    }
    const double angle = portable::acos(std::min(1.0, dot)), sine = portable::sin(angle);
    const double u = sine > 1e-9 ? portable::sin((1 - t) * angle) / sine : 1 - t;
    const double v = sine > 1e-9 ? portable::sin(t * angle) / sine : t;
    const Quaternion q{u * a.w + v * b.w, u * a.x + v * b.x, u * a.y + v * b.y, u * a.z + v * b.z};
    const double axis = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    if (!(axis > 0)) return {to.x, to.y, to.z, 0};
    return {float(q.x / axis), float(q.y / axis), float(q.z / axis), float(2 * portable::atan2(axis, q.w))};
}

template <class T>
T between(const T& a, const T& b, double t) {
    return T(a + (b - a) * typename T::value_type(t));
}

float mixed(float a, float b, double t) {
    return static_cast<float>(a + (b - a) * t);
}

}  // namespace

Value interpolate(const Value& a, const Value& b, double t) {
    if (a.type() != b.type() || t >= 1) return b;
    if (t <= 0) return a;
    switch (a.type()) {
        case FieldType::SFFloat:
            return mixed(a.as<float>(), b.as<float>(), t);
        case FieldType::SFDouble:
            return a.as<double>() + (b.as<double>() - a.as<double>()) * t;
        case FieldType::SFVec2f:
            return between(a.as<Vec2f>(), b.as<Vec2f>(), t);
        case FieldType::SFVec3f:
            return between(a.as<Vec3f>(), b.as<Vec3f>(), t);
        case FieldType::SFVec4f:
            return between(a.as<Vec4f>(), b.as<Vec4f>(), t);
        case FieldType::SFVec2d:
            return between(a.as<Vec2d>(), b.as<Vec2d>(), t);
        case FieldType::SFVec3d:
            return between(a.as<Vec3d>(), b.as<Vec3d>(), t);
        case FieldType::SFVec4d:
            return between(a.as<Vec4d>(), b.as<Vec4d>(), t);
        case FieldType::SFColor: {
            const Color &x = a.as<Color>(), &y = b.as<Color>();
            return Color{mixed(x.r, y.r, t), mixed(x.g, y.g, t), mixed(x.b, y.b, t)};
        }
        case FieldType::SFCustom:
            return customBetween(a.as<CustomValue>(), b.as<CustomValue>(), t);
        case FieldType::SFRotation:
            return slerp(a.as<Rotation>(), b.as<Rotation>(), t);
        default:
            return a;
    }
}

void MirrorPlayout::push(Item item) {
    bytes_ += item.bytes.size();
    items_.push_back(std::move(item));
}

MirrorPlayout::Item MirrorPlayout::pop() {
    Item item = std::move(items_.front());
    items_.pop_front();
    bytes_ -= item.bytes.size();
    peeked_ = false;
    return item;
}

void MirrorPlayout::clear() {
    items_.clear();
    bytes_ = 0;
    peeked_ = false;
}

const Value* MirrorPlayout::next(ChangeDecoder& decoder, NodeId node, FieldIndex field) const {
    if (items_.empty() || !items_.front().isRecord) return nullptr;
    // A predicted record can only be decoded once, in its turn. So the value stays until then.
    const std::span<const std::byte> first = items_.front().bytes;
    if (const auto header = parseRecordHeader(first); !header || header->flags & kRemember) return nullptr;
    if (!peeked_) {
        peeked_ = true;
        index_.clear();
        if (decoder.decode(items_.front().bytes, peek_))
            for (std::size_t i = 0; i < peek_.changes.size(); ++i)
                if (peek_.changes[i].kind == ChangeKind::setField)
                    index_[keyOf(peek_.changes[i].node, peek_.changes[i].field)] = i;
    }
    const auto found = index_.find(keyOf(node, field));
    return found == index_.end() ? nullptr : &peek_.changes[found->second].value;
}

}  // namespace rtsg
