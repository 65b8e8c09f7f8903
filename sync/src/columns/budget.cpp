// Counts the memory of decoded values and types, and lengthens records that are too short for it.
#include "budget.h"

#include "blocks.h"

namespace rtsg::wire {

namespace {

std::uint64_t costOfTexts(const std::vector<std::string>& texts) {
    std::uint64_t cost = 0;
    for (const std::string& text : texts) cost += kTextCost + text.size();
    return cost;
}

std::uint64_t costOf(const detail::ArrayHeader* header) {
    return header && header->size ? kArrayCost + header->size * header->elementSize : 0;
}

}  // namespace

std::uint64_t costOf(const Value& value) {
    const FieldType type = value.type();
    if (!isMF(type) && !info(type).shared) return 0;
    const detail::ArrayHeader* header = headerOf(value.storage());
    std::uint64_t cost = costOf(header);
    if (!header || !isMF(type) || !info(sf(type)).shared) return cost;
    const auto* elements = reinterpret_cast<const std::byte*>(header + 1);
    for (std::uint64_t i = 0; i < header->size; ++i) cost += costOf(headerOf(elements + i * header->elementSize));
    return cost;
}

std::uint64_t costOf(const NodeType& type) {
    std::uint64_t cost = kTypeCost + type.name.size() + type.component.size() + type.containerField.size() +
                         type.declaration.size() + costOfTexts(type.implements);
    for (const FieldDef& field : type.fields)
        cost += kFieldCost + field.name.size() + costOf(field.defaultValue) + costOfTexts(field.allowed) +
                costOfTexts(field.accepts);
    return cost;
}

void fillUp(ByteBuffer& record, std::uint64_t cost) {
    const std::uint64_t size = record.size();
    if (cost <= Budget(size).left) return;
    const std::uint64_t length = (cost - Budget(size).left) / Budget::kFactor + 1;
    record.put(static_cast<std::uint8_t>(kFiller));
    record.putVarint(0);
    record.putVarint(length);
    std::memset(record.room(length), 0, length);
    record.advance(length);
}

}  // namespace rtsg::wire
