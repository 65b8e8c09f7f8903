// NodeType: the places of fields in a node's block, their names, and their ranges.
#include <rtsg/core/node_type.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include <rtsg/core/spec_table.h>

namespace rtsg {

namespace {

template <class S>
bool allInRange(const FieldDef& field, const void* data, std::size_t count) {
    // Only bounds that are multiples of pi are no integers.
    const auto slack = [](double bound) { return bound == std::trunc(bound) ? 0.0 : std::abs(bound) * 1e-3; };
    const double min = field.min - slack(field.min), max = field.max + slack(field.max);
    const S* numbers = static_cast<const S*>(data);
    return std::all_of(numbers, numbers + count, [&](S number) {
        const double n = static_cast<double>(number);
        return n >= min && n <= max && !(field.exclusiveMin && n == field.min) &&
               !(field.exclusiveMax && n == field.max);
    });
}

}  // namespace

bool FieldDef::inRange(const Value& value) const {
    const FieldTypeInfo& i = info(type);
    if (!bounded() || i.components == 0 || sf(type) == FieldType::SFBool || value.type() != type) return true;
    const void* data = value.storage();
    std::size_t count = i.components;
    if (isMF(type)) {
        detail::ArrayHeader* header = nullptr;
        std::memcpy(&header, data, sizeof(header));
        count *= header ? header->size : 0;
        data = header + 1;
    }
    if (sf(type) == FieldType::SFInt32) return allInRange<std::int32_t>(*this, data, count);
    if (i.elementSize == i.components * sizeof(double)) return allInRange<double>(*this, data, count);
    return allInRange<float>(*this, data, count);
}

/// Takes the tags of the nearest abstract type in the tables that has any. Without one, the type counts as able to act
/// and write, and holds children if it is bounded.
void NodeType::takeTags() {
    const SpecTags* actor = nullptr;
    const SpecTags* tags = nullptr;
    for (const std::string& base : implements) {
        const SpecAbstract* abstract = findAbstract(base);
        if (!abstract) continue;
        if (!actor && abstract->tags.acts != Acts::unstated) actor = &abstract->tags;
        if (!tags && !abstract->tags.role.empty()) tags = &abstract->tags;
    }
    const bool hasOutput = std::ranges::any_of(
        fields, [](const FieldDef& field) { return field.access == Access::outputOnly || field.hidden; });
    acts = actor ? actor->acts : hasOutput ? Acts::always : Acts::never;
    writesInputs = true;
    std::string_view names = tags ? tags->below : std::string_view();
    if (tags) {
        role = tags->role;
    } else if (isA("X3DBoundedObject") && isA("X3DChildNode")) {
        role = "group";
        names = "children";
    }
    while (!names.empty()) {
        const FieldIndex field = findExact(names.substr(0, names.find('|')));
        if (field != kNoField && sf(fields[field].type) == FieldType::SFNode && fields[field].readable())
            below.push_back(field);
        names.remove_prefix(std::min(names.size(), names.find('|')));
        if (!names.empty()) names.remove_prefix(1);
    }
}

namespace {

/// Written fields of a node are looked through, so more would take time that grows with the square of their number.
constexpr std::size_t kMaxFields = 4096;

}  // namespace

bool NodeType::finish() {
    if (fields.size() > kMaxFields) return false;
    for (const FieldDef& field : fields)
        if (sf(field.type) == FieldType::SFCustom && !field.custom) return false;
    byName_.clear();
    for (std::size_t i = 0; i < fields.size(); ++i) byName_.emplace_back(fields[i].name, static_cast<FieldIndex>(i));
    const auto key = [&](const auto& entry) { return std::pair(entry.first, fields[entry.second].hidden); };
    std::ranges::sort(byName_, {}, key);
    for (std::size_t i = 1; i < byName_.size(); ++i)
        if (key(byName_[i - 1]) == key(byName_[i])) return false;

    // First what moves, most often first, so that it shares a cache line with the node itself. Then the widest
    // alignment first: no padding between fields, so that a million Transforms stay small.
    std::vector<FieldIndex> order(fields.size());
    std::iota(order.begin(), order.end(), FieldIndex{0});
    constexpr std::array kOften = {std::string_view("translation"), std::string_view("rotation"),
                                   std::string_view("scale")};
    std::ranges::sort(order, {}, [&](FieldIndex i) {
        const FieldDef& field = fields[i];
        return std::tuple(field.aspect != Aspect::transform || info(field.type).alignment > 4,
                          std::ranges::find(kOften, field.name) - kOften.begin(), -info(field.type).alignment, i);
    });
    std::size_t size = 0;
    for (const FieldIndex i : order) {
        FieldDef& field = fields[i];
        if (!field.holds(field.defaultValue)) field.defaultValue = zeroOf(field.type, field.custom.get());
        field.offset = FieldDef::kNoOffset;
        if (field.access == Access::inputOnly) continue;
        const std::size_t alignment = info(field.type).alignment;
        size = (size + alignment - 1) / alignment * alignment;
        field.offset = static_cast<std::uint32_t>(size);
        size += info(field.type).size;
    }
    blockSize_ = (size + 7) / 8 * 8;
    defaults_.assign(blockSize_, std::byte{0});
    slots_.clear();
    for (const FieldDef& field : fields) {
        const FieldTypeInfo& i = info(field.type);
        const bool given =
            field.hidden || field.access == Access::initializeOnly || field.access == Access::inputOutput;
        // A PROTO instance's fields go on to its body.
        const bool ownOnly = kind != Kind::proto && kind != Kind::externProto;
        slots_.push_back({field.offset, field.type, i.size, field.aspect,
                          given && ownOnly && !i.shared && i.size <= 16 && field.type != FieldType::SFNode &&
                              field.offset != FieldDef::kNoOffset});
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
        const FieldDef& field = fields[i];
        const auto index = static_cast<FieldIndex>(i);
        if (sf(field.type) == FieldType::SFNode) nodeFields_.push_back(index);
        if (field.offset == FieldDef::kNoOffset) continue;
        copyStorage(field.type, defaults_.data() + field.offset, field.defaultValue.storage());
        if (info(field.type).shared) sharedFields_.push_back(index);
    }
    if (kind == Kind::user && acts == Acts::unstated) takeTags();
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
    if (exact != kNoField && !fields[exact].hidden) return exact;
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
    const bool implied = index != kNoField && !fields[index].hidden && fields[index].access == Access::inputOutput;
    return implied ? index : kNoField;
}

FieldIndex NodeType::body() const {
    for (std::size_t i = fields.size(); i-- > 0 && fields[i].hidden;)
        if (fields[i].type == FieldType::MFNode && fields[i].name == "body") return static_cast<FieldIndex>(i);
    return kNoField;
}

bool NodeType::isA(std::string_view typeOrAbstract) const {
    return name == typeOrAbstract || std::ranges::find(implements, typeOrAbstract) != implements.end();
}

}  // namespace rtsg
