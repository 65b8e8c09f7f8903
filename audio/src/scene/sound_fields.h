// Reads fields of nodes for sound, with any values that events may have set. Threading: pure functions.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/core/scene.h>

namespace rtsg {

/// Its DEF name, or its type and number.
inline std::string nameOf(const Scene& scene, const Node& node) {
    const std::string_view name = scene.name(node.id());
    return name.empty() ? fmt::format("{}#{}", node.type().name, node.id().value) : std::string(name);
}

/// The value of a field that not every type has, or not with this type.
template <class T>
T fieldOr(const Node& node, std::string_view name, T otherwise) {
    const FieldIndex field = node.type().findExact(name);
    if (field == kNoField || node.type().fields[field].type != FieldTypeOf<T>::value) return otherwise;
    return node.get(Field<T>{field});
}

/// A field's number; `otherwise` if it is not finite (events may carry anything).
inline double number(float value, double otherwise) {
    return std::isfinite(value) ? static_cast<double>(value) : otherwise;
}
inline double number(double value, double otherwise) {
    return std::isfinite(value) ? value : otherwise;
}
inline double number(Time value, double otherwise) {
    return number(value.seconds, otherwise);
}

/// The numbers of a node's fields, made finite. Diagnostics about a field do not name its value, which may change in
/// every frame.
class FieldNumbers {
  public:
    FieldNumbers(const Scene& scene, const Node& node, std::function<void(std::string)> report)
        : scene_(scene), node_(node), report_(std::move(report)) {}

    /// `otherwise` for a number that is not finite, which is reported.
    template <class T>
    double any(Field<T> field, double otherwise) const {
        const double value = number(node_.get(field), std::nan(""));
        if (!std::isnan(value)) return value;
        report(field.index, "no finite number", otherwise);
        return otherwise;
    }
    /// The nearest number of the field's range, too.
    template <class T>
    double within(Field<T> field, double otherwise) const {
        const FieldDef& def = node_.type().fields[field.index];
        const double value = any(field, otherwise), nearest = std::clamp(value, def.min, def.max);
        if (value != nearest && !def.inRange(Value(node_.get(field))))
            report(field.index, value < nearest ? "too small" : "too large", nearest);
        return nearest;
    }
    /// The number in a field that not every type has.
    double any(std::string_view name, double otherwise, double absent) const {
        const FieldIndex field = node_.type().findExact(name);
        if (field == kNoField) return absent;
        const FieldType type = node_.type().fields[field].type;
        if (type == FieldType::SFFloat) return any(Field<float>{field}, otherwise);
        return type == FieldType::SFTime ? any(Field<Time>{field}, otherwise) : absent;
    }
    glm::dvec3 vector(Field<Vec3f> field, const glm::dvec3& otherwise, std::string_view outcome) const {
        const glm::dvec3 value = node_.get(field);
        if (std::isfinite(value.x + value.y + value.z)) return value;
        report_(fmt::format("{}: its {} is no finite vector: {}", nameOf(scene_, node_),
                            node_.type().fields[field.index].name, outcome));
        return otherwise;
    }

  private:
    void report(FieldIndex field, std::string_view what, double counts) const {
        report_(fmt::format("{}: its {} is {}: {:g} counts", nameOf(scene_, node_), node_.type().fields[field].name,
                            what, counts));
    }

    const Scene& scene_;
    const Node& node_;
    std::function<void(std::string)> report_;
};

}  // namespace rtsg
