// Fields of nodes as sound reads them: whatever an event may have put there. Threading: pure functions.
#pragma once

#include <cmath>
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

/// Of a field that not every type has, or not as this.
template <class T>
T fieldOr(const Node& node, std::string_view name, T otherwise) {
    const FieldIndex field = node.type().findExact(name);
    if (field == kNoField || node.type().fields[field].type != FieldTypeOf<T>::value) return otherwise;
    return node.get(Field<T>{field});
}

/// A field's number; `otherwise` for what is none (events may carry anything).
inline double number(float value, double otherwise) {
    return std::isfinite(value) ? static_cast<double>(value) : otherwise;
}
inline double number(double value, double otherwise) {
    return std::isfinite(value) ? value : otherwise;
}

}  // namespace rtsg
