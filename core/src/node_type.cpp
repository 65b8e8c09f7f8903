#include <rtsg/core/node_type.h>

#include <algorithm>
#include <numeric>

namespace rtsg {

bool NodeType::finish() {
    if (fields.size() >= kNoField) return false;
    byName_.clear();
    for (std::size_t i = 0; i < fields.size(); ++i) byName_.emplace_back(fields[i].name, static_cast<FieldIndex>(i));
    std::ranges::sort(byName_);
    for (std::size_t i = 1; i < byName_.size(); ++i)
        if (byName_[i - 1].first == byName_[i].first) return false;

    // Widest alignment first: no padding between fields, so that a million Transforms stay small.
    std::vector<FieldIndex> order(fields.size());
    std::iota(order.begin(), order.end(), FieldIndex{0});
    std::ranges::stable_sort(order, std::greater(), [&](FieldIndex i) { return info(fields[i].type).alignment; });
    std::size_t size = 0;
    for (const FieldIndex i : order) {
        FieldDef& field = fields[i];
        if (field.defaultValue.type() != field.type) field.defaultValue = Value::zero(field.type);
        field.offset = FieldDef::kNoOffset;
        if (field.access == Access::inputOnly) continue;
        const std::size_t alignment = info(field.type).alignment;
        size = (size + alignment - 1) / alignment * alignment;
        field.offset = static_cast<std::uint32_t>(size);
        size += info(field.type).size;
    }
    blockSize_ = (size + 7) / 8 * 8;
    defaults_.assign(blockSize_, std::byte{0});
    for (std::size_t i = 0; i < fields.size(); ++i) {
        const FieldDef& field = fields[i];
        const auto index = static_cast<FieldIndex>(i);
        if (sf(field.type) == FieldType::SFNode) nodeFields_.push_back(index);
        if (field.offset == FieldDef::kNoOffset) continue;
        copyStorage(field.type, defaults_.data() + field.offset, field.defaultValue.storage());
        if (info(field.type).shared) sharedFields_.push_back(index);
    }
    return true;
}

NodeType::~NodeType() {
    for (const FieldIndex i : sharedFields_) destroyStorage(fields[i].type, defaults_.data() + fields[i].offset);
}

FieldIndex NodeType::findExact(std::string_view wanted) const {
    const auto found = std::ranges::lower_bound(byName_, wanted, {}, &std::pair<std::string_view, FieldIndex>::first);
    return found != byName_.end() && found->first == wanted ? found->second : kNoField;
}

FieldIndex NodeType::find(std::string_view wanted) const {
    const FieldIndex exact = findExact(wanted);
    if (exact != kNoField) return exact;
    constexpr std::string_view before = "set_", after = "_changed";
    std::string_view bare;
    if (wanted.starts_with(before))
        bare = wanted.substr(before.size());
    else if (wanted.ends_with(after))
        bare = wanted.substr(0, wanted.size() - after.size());
    else
        return kNoField;
    // Only an inputOutput field has the two implied names (4.4.2.2).
    const FieldIndex index = findExact(bare);
    return index != kNoField && fields[index].access == Access::inputOutput ? index : kNoField;
}

bool NodeType::isA(std::string_view typeOrAbstract) const {
    return name == typeOrAbstract || std::ranges::find(implements, typeOrAbstract) != implements.end();
}

}  // namespace rtsg
