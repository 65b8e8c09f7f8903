// Node tables in their static form become NodeTypes: built-in ones once, on first use, and those of users.
#include <rtsg/core/spec_table.h>

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <type_traits>
#include <unordered_map>

#include <rtsg/core/never_destroyed.h>

namespace rtsg {

namespace {

/// Splits off what precedes the next separator.
std::string_view take(std::string_view& text, char separator) {
    const std::string_view part = text.substr(0, text.find(separator));
    text.remove_prefix(std::min(text.size(), part.size() + 1));
    return part;
}

std::vector<std::string> list(std::string_view text, char separator) {
    std::vector<std::string> result;
    while (!text.empty()) result.emplace_back(take(text, separator));
    return result;
}

template <class S>
S number(std::string_view& text) {
    const std::string_view word = take(text, ' ');
    S value{};
    std::from_chars(word.data(), word.data() + word.size(), value);  // spec_compiler has checked it
    return value;
}

template <class T>
T element(std::string_view& text) {
    if constexpr (std::is_same_v<T, bool>) {
        return take(text, ' ') == "TRUE";
    } else if constexpr (std::is_arithmetic_v<T>) {
        return number<T>(text);
    } else if constexpr (std::is_same_v<T, Time>) {
        return {number<double>(text)};
    } else if constexpr (std::is_same_v<T, String>) {
        return take(text, '\n');
    } else if constexpr (std::is_same_v<T, NodeId> || std::is_same_v<T, CustomValue>) {
        return {};
    } else if constexpr (std::is_same_v<T, Image>) {
        Image image;
        while (!text.empty()) image.words.push_back(number<std::int32_t>(text));
        return image;
    } else {
        constexpr bool isDouble = std::is_same_v<T, Vec2d> || std::is_same_v<T, Vec3d> || std::is_same_v<T, Vec4d> ||
                                  std::is_same_v<T, Matrix3d> || std::is_same_v<T, Matrix4d>;
        using Scalar = std::conditional_t<isDouble, double, float>;
        Scalar numbers[sizeof(T) / sizeof(Scalar)];
        for (Scalar& n : numbers) n = number<Scalar>(text);
        T value;
        static_assert(std::is_trivially_copyable_v<T>);
        std::memcpy(static_cast<void*>(&value), numbers, sizeof(T));
        return value;
    }
}

Value defaultOf(FieldType type, std::string_view text) {
    if (text.empty()) return Value::zero(type);
    switch (type) {
#define RTSG_X(suffix, T)                                         \
    case FieldType::SF##suffix:                                   \
        return Value(element<T>(text));                           \
    case FieldType::MF##suffix: {                                 \
        Array<T> values;                                          \
        while (!text.empty()) values.push_back(element<T>(text)); \
        return Value(std::move(values));                          \
    }
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return {};
}

/// spec_compiler has counted the numbers, and seen to it that they are of their kind.
Value defaultOf(FieldType type, std::string_view text, const CustomType& custom) {
    if (text.empty()) return zeroOf(type, &custom);
    std::vector<double> numbers;
    while (!text.empty()) numbers.push_back(number<double>(text));
    if (!isMF(type)) return Value(custom.value(numbers).value_or(custom.zero()));
    Array<CustomValue> values;
    const std::size_t count = custom.layout().count;
    for (std::size_t i = 0; i + count <= numbers.size() && count > 0; i += count)
        values.push_back(custom.value(std::span(numbers).subspan(i, count)).value_or(custom.zero()));
    return Value(std::move(values));
}

FieldDef makeField(const SpecField& row) {
    FieldDef field;
    field.name = row.name;
    field.type = row.type;
    field.access = row.access;
    field.aspect = row.aspect;
    if (row.custom.empty()) {
        field.defaultValue = defaultOf(row.type, row.defaultText);
    } else {
        const auto custom = fieldTypeOf(row.custom);
        if (!custom) throw std::logic_error("node table: " + custom.error().text);
        field.custom = *custom;
        field.defaultValue = defaultOf(row.type, row.defaultText, **custom);
    }
    field.min = row.min;
    field.max = row.max;
    field.exclusiveMin = row.exclusiveMin;
    field.exclusiveMax = row.exclusiveMax;
    field.allowed = list(row.allowed, '\n');
    field.accepts = list(row.accepts, '|');
    field.hidden = row.hidden;
    field.unit = row.unit;
    field.since = row.since;
    return field;
}

}  // namespace

Result<std::shared_ptr<const CustomType>> fieldTypeOf(std::string_view custom) {
    using Of = CustomLayout::Of;
    constexpr std::pair<std::string_view, Of> kKinds[] = {
        {"float64", Of::float64}, {"float32", Of::float32}, {"int32", Of::int32}, {"bytes", Of::bytes}};
    const std::string name = "SF" + std::string(take(custom, ' '));
    const std::string_view kind = take(custom, ' ');
    CustomLayout layout;
    for (const auto& [word, of] : kKinds)
        if (word == kind) layout.of = of;
    layout.count = number<std::uint16_t>(custom);
    return registerFieldType(name, layout);
}

std::vector<std::unique_ptr<NodeType>> makeNodeTypes(const SpecTable& table, NodeType::Kind kind) {
    std::vector<std::unique_ptr<NodeType>> result;
    result.reserve(table.nodes.size());
    for (const SpecNode& node : table.nodes) {
        auto type = std::make_unique<NodeType>();
        type->name = node.name;
        type->component = node.component;
        type->level = node.level;
        type->kind = kind;
        type->internal = node.internal;
        type->since = node.since;
        type->acts = node.tags.acts;
        type->writesInputs = node.tags.writesInputs;
        type->role = node.tags.role;
        type->containerField = node.containerField;
        type->implements = list(node.implements, '|');
        type->fields.reserve(node.fieldCount);
        for (const std::uint16_t row : table.fieldLists.subspan(node.firstField, node.fieldCount))
            type->fields.push_back(makeField(table.fields[row]));
        for (FieldDef& field : type->fields) field.since = std::max(field.since, type->since);
        if (!type->finish()) throw std::logic_error("node table: two fields of one name in " + type->name);
        for (const std::string& name : list(node.tags.below, '|')) type->below.push_back(type->findExact(name));
        result.push_back(std::move(type));
    }
    return result;
}

std::span<const std::unique_ptr<NodeType>> builtinTypes() {
    static const auto& types =
        neverDestroyed([] { return makeNodeTypes(builtinSpecTable(), NodeType::Kind::builtin); });
    return types;
}

const NodeType* findBuiltinType(std::string_view name) {
    static const auto& byName = neverDestroyed([] {
        std::unordered_map<std::string_view, const NodeType*> result;
        for (const auto& type : builtinTypes()) result.emplace(type->name, type.get());
        return result;
    });
    const auto found = byName.find(name);
    return found == byName.end() ? nullptr : found->second;
}

std::span<const std::string_view> builtinGroupTypes() {
    return builtinSpecTable().groups;
}

const SpecAbstract* findAbstract(std::string_view name) {
    const std::span<const SpecAbstract> all = builtinSpecTable().abstracts;
    const auto found = std::ranges::lower_bound(all, name, {}, &SpecAbstract::name);
    return found != all.end() && found->name == name ? &*found : nullptr;
}

bool isAbstractType(std::string_view name) {
    return findAbstract(name) != nullptr;
}

}  // namespace rtsg
