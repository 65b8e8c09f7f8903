// Gives an interpolator's output its value before the first input: ISO/IEC 19775-1 V4.0, 19.2.2. It is kept up to date
// where keys and their values are written, so that readers, and holders of a copy of the state, need to know nothing
// about it.
#include "writing.h"

namespace rtsg {

namespace {

/// Whether the output holds one T, or several; if so, calls `show` with its new content.
template <class T, class Show>
bool showAs(const Node& node, const TypeEntry& entry, const Show& show) {
    const FieldSlot& out = node.type().slot(entry.interpolated);
    const bool isOne = out.type == FieldTypeOf<T>::value;
    if (!isOne && out.type != FieldTypeOf<Array<T>>::value) return false;
    const auto& values = node.get(Field<Array<T>>{entry.keyValue});
    if (isOne) {
        const T first = values.empty() ? *reinterpret_cast<const T*>(node.type().defaults() + out.offset) : values[0];
        show(&first);
        return true;
    }
    const std::size_t keys = node.get(Field<Array<float>>{entry.key}).size();
    Array<T> first;
    for (std::size_t i = 0; keys > 0 && i < values.size() / keys; ++i) first.push_back(values[i]);
    show(&first);
    return true;
}

}  // namespace

void Scene::State::showFirst(Lane& lane, Node& node, FieldIndex field) {
    const TypeEntry& entry = types[node.typeIndex_.value];
    if (field != entry.keyValue && field != entry.key) return;
    if (node.get(Field<bool>{entry.begun})) return;
    const FieldSlot& out = node.type_->slot(entry.interpolated);
    const auto show = [&](const void* first) {
        if (!equalStorage(out.type, node.block() + out.offset, static_cast<const std::byte*>(first)))
            write(lane, node, entry.interpolated, first);
    };
    (void)(showAs<float>(node, entry, show) || showAs<Vec2f>(node, entry, show) || showAs<Vec3f>(node, entry, show) ||
           showAs<Vec3d>(node, entry, show) || showAs<Color>(node, entry, show) || showAs<Rotation>(node, entry, show));
}

}  // namespace rtsg
