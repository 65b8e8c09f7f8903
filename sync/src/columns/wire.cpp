// Writes values and descriptions of types as bytes, and reads them from untrusted bytes.
#include "wire.h"

#include <limits>

#include <fmt/format.h>

namespace rtsg::wire {

namespace {

/// String, Image and MF types of plain numbers have the same form on the wire: a count, then the elements.
void putFlat(ByteBuffer& out, const detail::ArrayHeader* header, std::size_t elementSize) {
    const std::uint64_t size = header ? header->size : 0;
    out.putVarint(size);
    if (size) out.append(header + 1, size * elementSize);
}

template <class T>
Array<T> readFlat(Reader& in) {
    const std::size_t size = in.count(sizeof(T));
    if (size == 0 || !in.charge(kArrayCost + size * sizeof(T))) return {};
    Array<T> result = Array<T>::ofSize(size);
    std::memcpy(static_cast<void*>(result.mutableData()), in.at, size * sizeof(T));
    in.at += size * sizeof(T);
    return result;
}
template <>
Array<bool> readFlat<bool>(Reader& in) {
    const std::size_t size = in.count(1);
    if (size == 0 || !in.charge(kArrayCost + size)) return {};
    Array<bool> result = Array<bool>::ofSize(size);
    bool* target = result.mutableData();
    for (std::size_t i = 0; i < size; ++i) {
        const auto byte = std::to_integer<unsigned>(*in.at);
        if (byte > 1) {
            in.refuse("boolean is neither 0 nor 1");
            return {};
        }
        target[i] = byte != 0;
        ++in.at;
    }
    return result;
}
/// Reads a count of elements of MFString or MFImage, which are pointers in memory. 0 after a problem.
std::size_t countOfShared(Reader& in) {
    const std::size_t size = in.count(1);
    return size > 0 && in.charge(kArrayCost + size * sizeof(void*)) ? size : 0;
}
template <>
Array<String> readFlat<String>(Reader& in) {
    Array<String> result = Array<String>::ofSize(countOfShared(in));
    String* target = result.mutableData();
    for (std::size_t i = 0; i < result.size() && !in.problem; ++i) target[i] = readString(in);
    return result;
}
/// A custom value carries its own description, so an invalid one must be refused; it would be kept and passed on.
CustomValue readCustom(Reader& in) {
    const std::string_view box = in.text();
    if (in.problem || !in.charge(kArrayCost + box.size())) return {};
    if (!CustomType::ofBox(box)) {
        in.refuse("a value of a field type from outside that does not say what it is");
        return {};
    }
    CustomValue value;
    value.box.append({box.data(), box.size()});
    return value;
}
template <>
Array<CustomValue> readFlat<CustomValue>(Reader& in) {
    Array<CustomValue> result = Array<CustomValue>::ofSize(countOfShared(in));
    CustomValue* target = result.mutableData();
    for (std::size_t i = 0; i < result.size() && !in.problem; ++i) target[i] = readCustom(in);
    return result;
}
template <>
Array<Image> readFlat<Image>(Reader& in) {
    Array<Image> result = Array<Image>::ofSize(countOfShared(in));
    Image* target = result.mutableData();
    for (std::size_t i = 0; i < result.size() && !in.problem; ++i) target[i].words = readFlat<std::int32_t>(in);
    return result;
}

template <class T>
Value readOne(Reader& in) {
    if constexpr (std::is_same_v<T, bool>) {
        const auto byte = in.number<std::uint8_t>();
        if (byte > 1) in.refuse("boolean is neither 0 nor 1");
        return byte == 1;
    } else if constexpr (std::is_same_v<T, String>) {
        return readString(in);
    } else if constexpr (std::is_same_v<T, Image>) {
        return Image{readFlat<std::int32_t>(in)};
    } else if constexpr (std::is_same_v<T, CustomValue>) {
        return readCustom(in);
    } else {
        return in.number<T>();
    }
}

std::string readText(Reader& in) {
    const std::string_view text = in.text();
    return in.charge(text.size()) ? std::string(text) : std::string();
}

std::vector<std::string> readTexts(Reader& in) {
    const std::size_t count = in.count(1);
    if (!in.charge(count * kTextCost)) return {};
    std::vector<std::string> result(count);
    for (std::string& text : result) text = readText(in);
    return result;
}

constexpr std::size_t kSmallestField = 5;  // bytes of a description: two lengths, type, access and flags
// Flags of a field's description: which parts are there, and properties.
constexpr unsigned kExclusiveMin = 1, kHidden = 2, kMin = 4, kMax = 8, kAllowed = 16, kAccepts = 32, kDefault = 64,
                   kExclusiveMax = 128;

void putField(ByteBuffer& out, const FieldDef& field) {
    // A default of another type counts as none, as in finish().
    const bool hasDefault =
        field.holds(field.defaultValue) && !(field.defaultValue == zeroOf(field.type, field.custom.get()));
    const bool hasMin = field.min != -std::numeric_limits<double>::infinity();
    const bool hasMax = field.max != std::numeric_limits<double>::infinity();
    putText(out, field.name);
    out.put(static_cast<std::uint8_t>(field.type));
    out.put(static_cast<std::uint8_t>(static_cast<unsigned>(field.access) | static_cast<unsigned>(field.aspect) << 2));
    out.put(static_cast<std::uint8_t>(
        (field.exclusiveMin ? kExclusiveMin : 0) | (field.exclusiveMax ? kExclusiveMax : 0) |
        (field.hidden ? kHidden : 0) | (hasMin ? kMin : 0) | (hasMax ? kMax : 0) |
        (field.allowed.empty() ? 0 : kAllowed) | (field.accepts.empty() ? 0 : kAccepts) | (hasDefault ? kDefault : 0)));
    if (hasMin) out.put(field.min);
    if (hasMax) out.put(field.max);
    if (!field.allowed.empty()) putTexts(out, field.allowed);
    if (!field.accepts.empty()) putTexts(out, field.accepts);
    if (hasDefault) putValue(out, field.defaultValue);
    if (!field.custom || sf(field.type) != FieldType::SFCustom) return;
    out.put(static_cast<std::uint8_t>(field.custom->layout().of));
    out.put(field.custom->layout().count);
    putText(out, field.custom->name());
}

std::shared_ptr<const CustomType> readCustomType(Reader& in) {
    CustomLayout layout;
    layout.of = static_cast<CustomLayout::Of>(in.number<std::uint8_t>());
    layout.count = in.number<std::uint16_t>();
    const auto type = CustomType::make("SF" + readText(in), layout);
    if (type) return *type;
    in.refuse("a field type from outside without a name or a layout");
    return nullptr;
}

FieldDef readField(Reader& in) {
    FieldDef field;
    if (!in.charge(kFieldCost)) return field;
    field.name = readText(in);
    field.type = readFieldType(in);
    const auto use = in.number<std::uint8_t>();
    const unsigned flags = in.number<std::uint8_t>();
    field.access = static_cast<Access>(use & 3u);
    // An aspect of a later version is ignored; it is no error.
    field.aspect = use >> 2 <= static_cast<int>(Aspect::time) ? static_cast<Aspect>(use >> 2) : Aspect::none;
    field.exclusiveMin = flags & kExclusiveMin;
    field.exclusiveMax = flags & kExclusiveMax;
    field.hidden = flags & kHidden;
    if (flags & kMin) field.min = in.number<double>();
    if (flags & kMax) field.max = in.number<double>();
    if (flags & kAllowed) field.allowed = readTexts(in);
    if (flags & kAccepts) field.accepts = readTexts(in);
    if (flags & kDefault) field.defaultValue = readValue(in, field.type);
    if (sf(field.type) == FieldType::SFCustom) field.custom = readCustomType(in);
    if (field.custom && !isMF(field.type) && !(flags & kDefault))
        in.charge(kArrayCost + field.custom->head().size() + field.custom->layout().size());
    if (in.problem) return field;
    if (!(flags & kDefault)) field.defaultValue = zeroOf(field.type, field.custom.get());
    if (!field.holds(field.defaultValue)) in.refuse("a default of another type than the field's");
    return field;
}

}  // namespace

void putText(ByteBuffer& out, std::string_view text) {
    out.putVarint(text.size());
    out.append(text.data(), text.size());
}

void putTexts(ByteBuffer& out, const std::vector<std::string>& texts) {
    out.putVarint(texts.size());
    for (const std::string& text : texts) putText(out, text);
}

void putValue(ByteBuffer& out, const Value& value) {
    const FieldType type = value.type();
    const FieldTypeInfo& i = info(type);
    if (fixedSize(type)) {
        out.append(value.storage(), i.elementSize);
        return;
    }
    const detail::ArrayHeader* header = headerOf(value.storage());
    if (type == FieldType::SFString || type == FieldType::SFCustom) {
        putFlat(out, header, 1);
    } else if (type == FieldType::SFImage) {
        putFlat(out, header, sizeof(std::int32_t));
    } else if (info(sf(type)).shared) {
        const std::uint64_t size = header ? header->size : 0;
        out.putVarint(size);
        const auto* elements = size ? reinterpret_cast<const std::byte*>(header + 1) : nullptr;
        for (std::uint64_t k = 0; k < size; ++k)
            putFlat(out, headerOf(elements + k * sizeof(void*)), type == FieldType::MFImage ? sizeof(std::int32_t) : 1);
    } else {
        putFlat(out, header, i.elementSize);
    }
}

void putType(ByteBuffer& out, const NodeType& type) {
    ByteBuffer body, field;
    putText(body, type.name);
    putText(body, type.component);
    body.putVarint(static_cast<std::uint64_t>(type.level < 0 ? 0 : type.level));
    body.put(static_cast<std::uint8_t>(type.kind));
    putText(body, type.containerField);
    putTexts(body, type.implements);
    putText(body, type.declaration);
    body.putVarint(type.fields.size());
    for (const FieldDef& f : type.fields) {
        field.clear();
        putField(field, f);
        body.putVarint(field.size());
        body.append(field.bytes());
    }
    out.putVarint(body.size());
    out.append(body.bytes());
}

String readString(Reader& in) {
    const std::string_view text = in.text();
    return text.empty() || !in.charge(kArrayCost + text.size()) ? String() : String(text);
}

FieldType readFieldType(Reader& in) {
    const auto type = in.number<std::uint8_t>();
    if (type < kFieldTypeCount) return static_cast<FieldType>(type);
    in.refuse("unknown field type");
    return FieldType::SFBool;
}

Value readValue(Reader& in, FieldType type) {
    switch (type) {
#define RTSG_X(suffix, T)       \
    case FieldType::SF##suffix: \
        return readOne<T>(in);  \
    case FieldType::MF##suffix: \
        return readFlat<T>(in);
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return {};
}

std::unique_ptr<NodeType> readType(Reader& outer) {
    Reader in = outer.part(outer.count(1));
    in.charge(kTypeCost);
    auto type = std::make_unique<NodeType>();
    type->name = readText(in);
    type->component = readText(in);
    type->level = static_cast<int>(in.bounded(1000));
    const auto kind = in.number<std::uint8_t>();
    if (kind > static_cast<unsigned>(NodeType::Kind::script)) in.refuse("unknown kind of type");
    type->kind = static_cast<NodeType::Kind>(kind);
    type->containerField = readText(in);
    type->implements = readTexts(in);
    type->declaration = readText(in);
    const std::size_t fields = in.count(kSmallestField);
    type->fields.reserve(fields);
    for (std::size_t i = 0; i < fields && !in.problem; ++i) {
        Reader one = in.part(in.count(1));
        type->fields.push_back(readField(one));  // parts that a later version appends to a field are skipped
        if (one.problem) {
            in.problem = one.problem;
            in.problemAt = one.problemAt;
        }
    }
    if (!in.problem && type->name.empty()) in.refuse("type without a name");
    if (!in.problem && !type->finish()) in.refuse("type with fields of the same name, or with too many");
    if (!in.problem) return type;
    if (!outer.problem) {
        outer.problem = in.problem;
        outer.problemAt = in.problemAt;
    }
    outer.at = outer.end;
    return nullptr;
}

Diagnostic describe(const Reader& in, std::string_view what) {
    return {Severity::error, {}, {}, fmt::format("at byte {}: {}: {}", in.problemAt, what, in.problem)};
}

}  // namespace rtsg::wire
