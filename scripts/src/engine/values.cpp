// Converts field values between the scene's representation and plain JavaScript.
#include "values.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <rtsg/core/field_text.h>

#include "text/utf8.h"

namespace rtsg::script {

namespace {

JSObject* newNumbers(JSContext* cx, std::size_t count, double*& data) {
    JSObject* array = JS_NewFloat64Array(cx, count);
    if (!array) return nullptr;
    JS::AutoCheckCannotGC noCollection;
    bool shared = false;
    data = JS_GetFloat64ArrayData(array, &shared, noCollection);
    return array;
}

/// ECMAScript's ToInt32, as scripts that compute with bits expect.
std::int32_t toInt32(double number) {
    return JS::ToInt32(number);
}

/// Elements made of `Component`s, whatever their own type.
template <class Component>
void widen(const void* from, std::size_t count, double* to) {
    const auto* source = static_cast<const Component*>(from);
    for (std::size_t i = 0; i < count; ++i) to[i] = static_cast<double>(source[i]);
}
template <class Component>
void narrow(const double* from, std::size_t count, void* to) {
    auto* target = static_cast<Component*>(to);
    for (std::size_t i = 0; i < count; ++i) {
        if constexpr (std::is_same_v<Component, std::int32_t>)
            target[i] = toInt32(from[i]);
        else if constexpr (std::is_same_v<Component, std::uint32_t>)
            target[i] = static_cast<std::uint32_t>(from[i]);  // node ids, made by us
        else if constexpr (std::is_same_v<Component, bool>)
            target[i] = from[i] != 0 && !std::isnan(from[i]);
        else
            target[i] = static_cast<Component>(from[i]);
    }
}

enum class Component { boolean, int32, id, single, twice };

template <class T>
constexpr Component componentOf() {
    if constexpr (std::is_same_v<T, bool>)
        return Component::boolean;
    else if constexpr (std::is_same_v<T, std::int32_t>)
        return Component::int32;
    else if constexpr (std::is_same_v<T, NodeId>)
        return Component::id;
    else if constexpr (std::is_same_v<T, double> || std::is_same_v<T, Time> || std::is_same_v<T, Vec2d> ||
                       std::is_same_v<T, Vec3d> || std::is_same_v<T, Vec4d> || std::is_same_v<T, Matrix3d> ||
                       std::is_same_v<T, Matrix4d>)
        return Component::twice;
    else
        return Component::single;
}

template <class T>
constexpr std::size_t width() {
    constexpr Component c = componentOf<T>();
    if constexpr (c == Component::boolean || c == Component::int32 || c == Component::id)
        return 1;
    else
        return sizeof(T) / (c == Component::twice ? sizeof(double) : sizeof(float));
}

template <class T>
void widenElements(const T* elements, std::size_t count, double* to) {
    constexpr Component c = componentOf<T>();
    const std::size_t numbers = count * width<T>();
    if constexpr (c == Component::boolean)
        widen<bool>(elements, numbers, to);
    else if constexpr (c == Component::int32)
        widen<std::int32_t>(elements, numbers, to);
    else if constexpr (c == Component::id)
        widen<std::uint32_t>(elements, numbers, to);
    else if constexpr (c == Component::twice)
        widen<double>(elements, numbers, to);
    else
        widen<float>(elements, numbers, to);
}
template <class T>
void narrowElements(const double* from, std::size_t count, T* elements) {
    constexpr Component c = componentOf<T>();
    const std::size_t numbers = count * width<T>();
    if constexpr (c == Component::boolean)
        narrow<bool>(from, numbers, elements);
    else if constexpr (c == Component::int32)
        narrow<std::int32_t>(from, numbers, elements);
    else if constexpr (c == Component::id)
        narrow<std::uint32_t>(from, numbers, elements);
    else if constexpr (c == Component::twice)
        narrow<double>(from, numbers, elements);
    else
        narrow<float>(from, numbers, elements);
}

bool stringTo(JSContext* cx, std::string_view text, JS::MutableHandleValue out) {
    JSString* created = JS_NewStringCopyUTF8N(cx, JS::UTF8Chars(text.data(), text.size()));
    if (!created) return false;
    out.setString(created);
    return true;
}

/// The numbers of a Float64Array; false if it is none.
bool numbersOf(JS::HandleValue value, std::vector<double>& out) {
    if (!value.isObject() || !JS_IsFloat64Array(&value.toObject())) return false;
    JS::AutoCheckCannotGC noCollection;
    bool shared = false;
    const double* data = JS_GetFloat64ArrayData(&value.toObject(), &shared, noCollection);
    out.assign(data, data + JS_GetTypedArrayLength(&value.toObject()));
    return true;
}

Image imageFrom(std::span<const double> words) {
    Image image;
    image.words = Array<std::int32_t>::ofSize(words.size());
    narrow<std::int32_t>(words.data(), words.size(), image.words.mutableData());
    return image;
}

/// A number, an array of them, or a text.
bool customTo(JSContext* cx, const CustomValue& value, JS::MutableHandleValue out) {
    const auto type = CustomType::of(value);
    if (!type || scriptsSeeText(*type)) return stringTo(cx, customText(value).value_or(customDefaultText(value)), out);
    const std::vector<double> numbers = customNumbers(value);
    if (numbers.size() == 1) {
        out.setNumber(numbers[0]);
        return true;
    }
    double* data = nullptr;
    JSObject* array = newNumbers(cx, numbers.size(), data);
    if (!array) return false;
    std::ranges::copy(numbers, data);
    out.setObject(*array);
    return true;
}

bool customFrom(JSContext* cx, JS::HandleValue value, const CustomType& type, CustomValue& out) {
    std::vector<double> numbers;
    Result<CustomValue> created;
    if (value.isString()) {
        std::string text;
        if (!stringFrom(cx, value, text)) return false;
        auto parsed = parseFieldText(FieldType::SFCustom, text, TextSyntax::xml, &type);
        if (!parsed) return false;
        out = parsed->as<CustomValue>();
        return true;
    }
    if (value.isNumber())
        numbers.push_back(value.toNumber());
    else if (!numbersOf(value, numbers))
        return false;
    created = type.value(numbers);
    if (created) created = normalisedCustom(type, std::move(*created));
    if (created) out = std::move(*created);
    return created.has_value();
}

template <class T>
bool elementTo(JSContext* cx, const T& element, JS::MutableHandleValue out) {
    if constexpr (std::is_same_v<T, CustomValue>) {
        return customTo(cx, element, out);
    } else if constexpr (std::is_same_v<T, String>) {
        return stringTo(cx, element.view(), out);
    } else if constexpr (std::is_same_v<T, Image>) {
        double* data = nullptr;
        JSObject* array = newNumbers(cx, element.words.size(), data);
        if (!array) return false;
        widen<std::int32_t>(element.words.data(), element.words.size(), data);
        out.setObject(*array);
        return true;
    } else if constexpr (width<T>() == 1) {
        double number = 0;
        widenElements(&element, 1, &number);
        out.setNumber(number);
        return true;
    } else {
        double* data = nullptr;
        JSObject* array = newNumbers(cx, width<T>(), data);
        if (!array) return false;
        widenElements(&element, 1, data);
        out.setObject(*array);
        return true;
    }
}

template <class T>
bool arrayTo(JSContext* cx, const Array<T>& elements, JS::MutableHandleValue out) {
    if constexpr (std::is_same_v<T, String> || std::is_same_v<T, CustomValue>) {
        JS::RootedObject array(cx, JS::NewArrayObject(cx, elements.size()));
        if (!array) return false;
        JS::RootedValue one(cx);
        for (std::size_t i = 0; i < elements.size(); ++i)
            if (!elementTo(cx, elements[i], &one) || !JS_SetElement(cx, array, static_cast<std::uint32_t>(i), one))
                return false;
        out.setObject(*array);
    } else if constexpr (std::is_same_v<T, Image>) {
        std::size_t words = 0;
        for (const Image& image : elements) words += image.words.size();
        double* data = nullptr;
        JSObject* array = newNumbers(cx, words, data);
        if (!array) return false;
        for (const Image& image : elements) {
            widen<std::int32_t>(image.words.data(), image.words.size(), data);
            data += image.words.size();
        }
        out.setObject(*array);
    } else {
        double* data = nullptr;
        JSObject* array = newNumbers(cx, elements.size() * width<T>(), data);
        if (!array) return false;
        widenElements(elements.data(), elements.size(), data);
        out.setObject(*array);
    }
    return true;
}

template <class T>
bool elementFrom(JSContext* cx, JS::HandleValue value, Value& out) {
    if constexpr (std::is_same_v<T, String>) {
        std::string text;
        if (!stringFrom(cx, value, text)) return false;
        out = Value(String(text));
        return true;
    } else {
        if constexpr (std::is_same_v<T, Image>) {
            std::vector<double> numbers;
            if (!numbersOf(value, numbers)) return false;
            out = Value(imageFrom(numbers));
        } else {
            T element{};
            if constexpr (width<T>() == 1) {
                if (!value.isNumber() && !value.isBoolean()) return false;
                const double number = value.isBoolean() ? static_cast<double>(value.toBoolean()) : value.toNumber();
                narrowElements(&number, 1, &element);
            } else {
                if (!value.isObject() || !JS_IsFloat64Array(&value.toObject()) ||
                    JS_GetTypedArrayLength(&value.toObject()) != width<T>())
                    return false;
                JS::AutoCheckCannotGC noCollection;
                bool shared = false;
                narrowElements(JS_GetFloat64ArrayData(&value.toObject(), &shared, noCollection), 1, &element);
            }
            out = Value(element);
        }
        return true;
    }
}

template <class T>
bool arrayFrom(JSContext* cx, JS::HandleValue value, Value& out) {
    if constexpr (std::is_same_v<T, String>) {
        if (!value.isObject()) return false;
        JS::RootedObject array(cx, &value.toObject());
        std::uint32_t length = 0;
        if (!JS::GetArrayLength(cx, array, &length)) return false;
        Array<String> strings;
        strings.reserve(length);
        JS::RootedValue one(cx);
        std::string text;
        for (std::uint32_t i = 0; i < length; ++i) {
            if (!JS_GetElement(cx, array, i, &one) || !stringFrom(cx, one, text)) return false;
            strings.push_back(String(text));
        }
        out = Value(std::move(strings));
    } else {
        std::vector<double> numbers;
        if (!numbersOf(value, numbers)) return false;
        if constexpr (std::is_same_v<T, Image>) {
            Array<Image> images;
            for (std::span<const double> rest = numbers; rest.size() >= 3;) {
                const double words = 3 + rest[0] * rest[1];
                if (!(words >= 3 && words <= static_cast<double>(rest.size()))) return false;
                images.push_back(imageFrom(rest.first(static_cast<std::size_t>(words))));
                rest = rest.subspan(static_cast<std::size_t>(words));
            }
            out = Value(std::move(images));
        } else {
            Array<T> elements = Array<T>::ofSize(numbers.size() / width<T>());
            if (!elements.empty()) narrowElements(numbers.data(), elements.size(), elements.mutableData());
            out = Value(std::move(elements));
        }
    }
    return true;
}

bool customFrom(JSContext* cx, FieldType type, JS::HandleValue value, const CustomType* custom, Value& out) {
    if (!custom) return false;
    CustomValue element;
    if (!isMF(type)) {
        if (!customFrom(cx, value, *custom, element)) return false;
        out = Value(std::move(element));
        return true;
    }
    if (!value.isObject()) return false;
    JS::RootedObject array(cx, &value.toObject());
    std::uint32_t length = 0;
    if (!JS::GetArrayLength(cx, array, &length)) return false;
    Array<CustomValue> elements;
    JS::RootedValue one(cx);
    for (std::uint32_t i = 0; i < length; ++i) {
        if (!JS_GetElement(cx, array, i, &one) || !customFrom(cx, one, *custom, element)) return false;
        elements.push_back(element);
    }
    out = Value(std::move(elements));
    return true;
}

}  // namespace

bool stringFrom(JSContext* cx, JS::HandleValue value, std::string& out) {
    JS::RootedString text(cx, JS::ToString(cx, value));
    if (!text) return false;
    JSLinearString* characters = JS_EnsureLinearString(cx, text);
    if (!characters) return false;
    out.resize(JS::GetDeflatedUTF8StringLength(characters));
    JS::DeflateStringToUTF8Buffer(characters, out);
    std::size_t zeros = 0;  // which no text of a scene has, as none that was read has one
    if (out.find('\0') != out.npos) out = detail::replaceInvalidUtf8(out, zeros);
    return true;
}

bool toScript(JSContext* cx, FieldType type, const void* storage, JS::MutableHandleValue out) {
    switch (type) {
#define RTSG_X(suffix, T)                                           \
    case FieldType::SF##suffix:                                     \
        return elementTo(cx, *static_cast<const T*>(storage), out); \
    case FieldType::MF##suffix:                                     \
        return arrayTo(cx, *static_cast<const Array<T>*>(storage), out);
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return false;
}

bool fromScript(JSContext* cx, FieldType type, JS::HandleValue value, Value& out, const CustomType* custom) {
    if (sf(type) == FieldType::SFCustom) return customFrom(cx, type, value, custom, out);
    switch (type) {
#define RTSG_X(suffix, T)                                                                     \
    case FieldType::SF##suffix:                                                               \
        if constexpr (!std::is_same_v<T, CustomValue>) return elementFrom<T>(cx, value, out); \
        break;                                                                                \
    case FieldType::MF##suffix:                                                               \
        if constexpr (!std::is_same_v<T, CustomValue>) return arrayFrom<T>(cx, value, out);   \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return false;
}

}  // namespace rtsg::script
