// Seeded random values, types and change sets for the tests of this folder. They are well formed on the wire, not
// meaningful to a scene: the codec has to carry anything.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/core/node_type.h>

namespace rtsg::test {

class RandomSets {
  public:
    explicit RandomSets(std::uint64_t seed) : random_(seed) {}

    std::uint32_t below(std::uint32_t limit) { return static_cast<std::uint32_t>(random_() % limit); }
    bool coin() { return random_() & 1; }
    template <class T>
    T anyBits() {
        const std::uint64_t bits = random_();
        T result;
        std::memcpy(&result, &bits, sizeof(T));
        return result;
    }
    float real() { return below(20) == 0 ? anyBits<float>() : static_cast<float>(below(2000)) * 0.125f - 100.f; }
    double realDouble() { return below(20) == 0 ? anyBits<double>() : below(1u << 30) * 0.375 - 1e8; }
    NodeId node() { return NodeId{below(4) ? 1 + below(1000) : anyBits<std::uint32_t>()}; }
    std::string text() {
        std::string result(below(10) ? below(12) : 200 + below(300), ' ');
        for (char& c : result) c = static_cast<char>(random_());
        return result;
    }

    template <class T>
    T element() {
        if constexpr (std::is_same_v<T, bool>)
            return coin();
        else if constexpr (std::is_same_v<T, std::int32_t>)
            return anyBits<std::int32_t>();
        else if constexpr (std::is_same_v<T, float>)
            return real();
        else if constexpr (std::is_same_v<T, double>)
            return realDouble();
        else if constexpr (std::is_same_v<T, Time>)
            return Time{realDouble()};
        else if constexpr (std::is_same_v<T, String>)
            return String(text());
        else if constexpr (std::is_same_v<T, NodeId>)
            return node();
        else if constexpr (std::is_same_v<T, Image>) {
            Image image;
            for (std::uint32_t n = below(20); n > 0; --n) image.words.push_back(anyBits<std::int32_t>());
            return image;
        } else if constexpr (std::is_same_v<T, CustomValue>) {
            return ofType(*customType());
        } else {
            T result;
            auto* bytes = reinterpret_cast<unsigned char*>(&result);
            for (std::size_t i = 0; i < sizeof(T); i += 4) {
                const float number = real();
                std::memcpy(bytes + i, &number, 4);
            }
            return result;
        }
    }

    Value value(FieldType type) {
        switch (type) {
#define RTSG_X(suffix, T)                                                                          \
    case FieldType::SF##suffix:                                                                    \
        return Value(element<T>());                                                                \
    case FieldType::MF##suffix: {                                                                  \
        Array<T> array;                                                                            \
        for (std::uint32_t n = below(4) ? below(6) : 0; n > 0; --n) array.push_back(element<T>()); \
        return Value(array);                                                                       \
    }
            RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
        }
        return {};
    }
    /// One of a few types from outside, of each kind of numbers.
    std::shared_ptr<const CustomType> customType() {
        using Of = CustomLayout::Of;
        constexpr std::pair<const char*, CustomLayout> kTypes[] = {{"SFQuantity", {Of::float64, 2}},
                                                                   {"SFMoney", {Of::int32, 1}},
                                                                   {"SFTag", {Of::bytes, 0}},
                                                                   {"SFKey", {Of::bytes, 16}},
                                                                   {"SFBasis", {Of::float32, 3}}};
        const auto& [name, layout] = kTypes[below(std::size(kTypes))];
        return CustomType::make(name, layout).value();
    }
    CustomValue ofType(const CustomType& type) {
        std::string bits;
        for (std::size_t n = type.layout().size() ? type.layout().size() : below(40); n > 0; --n)
            bits += static_cast<char>(below(256));
        return type.value(std::as_bytes(std::span(bits))).value();
    }
    FieldType fieldType() { return static_cast<FieldType>(below(kFieldTypeCount)); }

    std::unique_ptr<NodeType> type(const std::string& name) {
        auto result = std::make_unique<NodeType>();
        result->name = name;
        result->component = "Component" + std::to_string(below(5));
        result->level = static_cast<int>(below(5));
        result->kind = static_cast<NodeType::Kind>(below(5));
        result->containerField = coin() ? "children" : "geometry";
        result->implements = {"X3DNode", "X3DChildNode"};
        result->declaration = coin() ? text() : "";
        const std::uint32_t fields = below(8);
        for (std::uint32_t i = 0; i < fields; ++i) {
            FieldDef field;
            field.name = "field" + std::to_string(i);
            field.type = fieldType();
            field.access = static_cast<Access>(below(4));
            field.aspect = static_cast<Aspect>(below(9));
            if (sf(field.type) == FieldType::SFCustom) {
                field.custom = customType();
                field.defaultValue = coin()             ? Value()
                                     : isMF(field.type) ? Value(Array<CustomValue>{ofType(*field.custom)})
                                                        : Value(ofType(*field.custom));
            } else {
                field.defaultValue = value(field.type);
            }
            if (coin()) field.min = real();
            field.exclusiveMin = coin();
            field.hidden = coin();
            if (coin()) field.allowed = {"ONE", "TWO"};
            if (coin()) field.accepts = {"X3DGeometryNode"};
            result->fields.push_back(std::move(field));
        }
        if (!result->finish()) std::abort();
        return result;
    }

    /// Every kind of change, in the order a sealed set has.
    ChangeSet set(std::uint32_t size) {
        ChangeSet result;
        result.from = below(4) ? random_() >> 8 : 0;
        result.to = result.from + 1 + below(100);
        result.time = realDouble();
        result.hash = {random_(), random_()};
        const auto add = [&](ChangeKind kind) -> Change& {
            Change change;
            change.node = node();
            change.kind = kind;
            change.external = coin();
            result.changes.push_back(change);
            return result.changes.back();
        };
        for (std::uint32_t n = below(3); n > 0; --n) {
            Change& change = add(ChangeKind::defineType);
            change.node = {};
            change.index = 300 + static_cast<std::uint32_t>(result.types.size());
            result.types.push_back({TypeIndex{static_cast<std::uint16_t>(change.index)}, type("Defined" + text())});
        }
        for (std::uint32_t n = below(size); n > 0; --n) {
            Change& change = add(ChangeKind::createNode);
            change.index = below(300);
            change.other = coin() ? node() : NodeId{};
        }
        for (std::uint32_t n = below(size * 3); n > 0; --n) {
            Change& change = add(static_cast<ChangeKind>(2 + below(3)));
            change.field = static_cast<FieldIndex>(below(20) ? below(12) : below(0x10000));
            if (change.kind == ChangeKind::setField) {
                change.value = value(fieldType());
            } else {
                change.other = node();
                change.index = below(1000);
            }
        }
        for (std::uint32_t n = below(size); n > 0; --n) add(ChangeKind::setName).value = String(text());
        for (std::uint32_t n = below(size); n > 0; --n) {
            Change& change = add(coin() ? ChangeKind::addRoute : ChangeKind::removeRoute);
            change.field = static_cast<FieldIndex>(below(40));
            change.other = node();
            change.index = below(40);
            change.isConnection = coin();
        }
        for (std::uint32_t n = below(size); n > 0; --n) add(ChangeKind::destroyNode);
        for (std::uint32_t n = below(size); n > 0; --n) {
            Change& change = add(ChangeKind::event);
            change.field = static_cast<FieldIndex>(below(40));
            change.value = value(fieldType());
        }
        return result;
    }

  private:
    std::mt19937_64 random_;
};

}  // namespace rtsg::test
