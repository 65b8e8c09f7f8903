// Prints field values in the three text encodings; parsing is in field_text_parser.cpp.
#include <rtsg/core/field_text.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <type_traits>

#include <rtsg/core/terminal.h>

#include "field_text_parser.h"
#include "field_text_printer.h"
#include "text_position.h"
#include "utf8.h"

namespace rtsg {

namespace {

class FirstError final : public detail::FieldTextReport {
  public:
    void report(Severity severity, const char* at, std::string text) override {
        if (severity != Severity::error || position) return;
        position = at;
        message = std::move(text);
    }
    const char* position = nullptr;
    std::string message;
};

class Printer {
  public:
    Printer(std::string& out, TextSyntax syntax) : out_(out), syntax_(syntax) {}

    void print(bool value) {
        out_ += syntax_ == TextSyntax::classicVrml ? (value ? "TRUE" : "FALSE") : (value ? "true" : "false");
    }
    template <class S>
        requires std::is_arithmetic_v<S>
    void print(S value) {
        if constexpr (std::is_floating_point_v<S>) {
            if (!std::isfinite(value) && syntax_ == TextSyntax::json) {
                out_ += "null";
                return;
            }
        }
        char text[40];
        const auto result = std::to_chars(text, text + sizeof(text), value);
        out_.append(text, result.ptr);
    }
    void print(const Time& value) { print(value.seconds); }
    void print(const Color& value) { list(&value.r, 3); }
    void print(const ColorRGBA& value) { list(&value.r, 4); }
    void print(const Rotation& value) { list(&value.x, 4); }
    template <int N, class S, glm::qualifier Q>
    void print(const glm::vec<N, S, Q>& value) {
        list(&value[0], static_cast<std::size_t>(N));
    }
    template <class S, int N>
    void print(const SquareMatrix<S, N>& value) {
        list(value.elements.data(), value.elements.size());
    }
    void print(const Image& value) {
        if (value.words.empty()) {
            out_ += syntax_ == TextSyntax::json ? "[0,0,0]" : "0 0 0";
            return;
        }
        if (syntax_ == TextSyntax::json) {
            list(value.words.data(), value.words.size());
            return;
        }
        for (std::size_t i = 0; i < value.words.size(); ++i) {
            if (i) out_ += ' ';
            if (i < 3)
                print(value.words[i]);
            else
                hexadecimal(static_cast<std::uint32_t>(value.words[i]));
        }
    }
    void print(const CustomValue& value) {
        const std::optional<std::string> text = customText(value);
        if (text && detail::findInvalidUtf8(*text) == text->npos) return print(String(*text));
        const std::string numbers = customDefaultText(value);
        if (syntax_ != TextSyntax::json) {
            out_ += numbers;
        } else if (numbers.starts_with("0x")) {
            json(numbers);
        } else {
            const bool many = numbers.find(' ') != numbers.npos;
            if (many) out_ += '[';
            for (std::size_t at = 0; at <= numbers.size();) {
                const std::string number = numbers.substr(at, numbers.find(' ', at) - at);
                out_ += number.find_first_of("ni") == number.npos ? number : "null";
                at += number.size() + 1;
                if (at <= numbers.size()) out_ += ',';
            }
            if (many) out_ += ']';
        }
    }
    void print(const String& value) {
        if (syntax_ == TextSyntax::json) {
            json(value);
            return;
        }
        out_ += '"';
        escaped(value);
        out_ += '"';
    }
    void print(NodeId value) {
        if (syntax_ == TextSyntax::json) {
            if (value)
                print(value.value);
            else
                out_ += "null";
        } else {
            out_ += value ? "#" + std::to_string(value.value) : "NULL";
        }
    }
    template <class T>
    void print(const Array<T>& values) {
        if (syntax_ != TextSyntax::xml) out_ += '[';
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (i) out_ += syntax_ == TextSyntax::xml ? " " : ", ";
            print(values[i]);
        }
        if (syntax_ != TextSyntax::xml) out_ += ']';
    }
    /// Without quotes: an XML attribute holding one SFString.
    void escaped(std::string_view text) {
        for (const char c : text) {
            if (c == '"' || c == '\\') out_ += '\\';
            out_ += c;
        }
    }

  private:
    template <class S>
    void list(const S* numbers, std::size_t count) {
        const bool json = syntax_ == TextSyntax::json;
        if (json) out_ += '[';
        for (std::size_t i = 0; i < count; ++i) {
            if (i) out_ += json ? "," : " ";
            print(numbers[i]);
        }
        if (json) out_ += ']';
    }
    void hexadecimal(std::uint32_t word) {
        char text[16];
        const auto result = std::to_chars(text, text + sizeof(text), word, 16);
        out_ += "0x";
        out_.append(text, result.ptr);
    }
    void json(std::string_view text) {
        constexpr char digits[] = "0123456789abcdef";
        out_ += '"';
        for (std::size_t i = 0; i < text.size(); ++i) {
            const char c = text[i];
            auto byte = static_cast<unsigned char>(c);
            // DEL and C1 act on terminals, where lines of JSON often go.
            const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0u;
            const bool isC1 = byte == 0xC2 && next >= 0x80 && next < 0xA0;
            if (isC1) {
                byte = static_cast<unsigned char>(next);
                ++i;
            }
            if (c == '"' || c == '\\') {
                out_ += '\\';
                out_ += c;
            } else if (c == '\n') {
                out_ += "\\n";
            } else if (byte < 0x20 || byte == 0x7F || isC1) {
                out_ += "\\u00";
                out_ += digits[byte >> 4];
                out_ += digits[byte & 15];
            } else {
                out_ += c;
            }
        }
        out_ += '"';
    }

    std::string& out_;
    TextSyntax syntax_;
};

}  // namespace

Result<Value> parseFieldText(FieldType type, std::string_view text, TextSyntax syntax, const CustomType* custom) {
    if (syntax == TextSyntax::json) return fail("JSON values are not parsed");
    FirstError errors;
    detail::FieldTextParser parser(text.data(), text.data() + text.size(), syntax, errors);
    Value value;
    const bool usable = parser.parse(type, value, custom);
    if (usable && !errors.position) {
        parser.skipSpace();
        if (parser.p != text.data() + text.size())
            errors.report(Severity::error, parser.p, "there is more than one " + fieldTypeName(type, custom));
    }
    if (!usable || errors.position) {
        const char* at = errors.position ? errors.position : parser.p;
        return fail(errors.message, at ? detail::TextPosition(text.data()).of(at) : SourceLocation{});
    }
    return value;
}

void appendFieldText(std::string& out, const Value& value, TextSyntax syntax) {
    Printer printer(out, syntax);
    if (syntax == TextSyntax::xml && value.type() == FieldType::SFString) {
        printer.escaped(value.as<String>());
        return;
    }
    if (syntax == TextSyntax::xml && value.type() == FieldType::SFCustom) {
        // A text without quotes, if it stays as it is so; it never reads as numbers.
        const std::optional<std::string> text = customText(value.as<CustomValue>());
        const auto isPlain = [](char c) { return static_cast<unsigned char>(c) >= 0x20 && c != '"' && c != '\\'; };
        if (text && !text->empty() && text->front() != ' ' && text->back() != ' ' &&
            std::ranges::all_of(*text, isPlain) && detail::findInvalidUtf8(*text) == text->npos) {
            out += *text;
            return;
        }
    }
    switch (value.type()) {
#define RTSG_X(suffix, T)                    \
    case FieldType::SF##suffix:              \
        printer.print(value.as<T>());        \
        break;                               \
    case FieldType::MF##suffix:              \
        printer.print(value.as<Array<T>>()); \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
}

namespace detail {

namespace {

template <class S>
std::optional<double> firstNotFinite(const void* numbers, std::size_t count) {
    const S* first = static_cast<const S*>(numbers);
    const S* found = std::find_if(first, first + count, [](S number) { return !std::isfinite(number); });
    return found == first + count ? std::nullopt : std::optional<double>(*found);
}

template <class T>
std::optional<double> firstNotFiniteOf(const T* elements, std::size_t size) {
    if constexpr (std::is_integral_v<T>) return std::nullopt;
    if constexpr (std::is_same_v<T, CustomValue>) {
        for (std::size_t i = 0; i < size; ++i) {
            const std::vector<double> all = customNumbers(elements[i]);
            if (const auto found = firstNotFinite<double>(all.data(), all.size()); found && !customText(elements[i]))
                return found;
        }
        return std::nullopt;
    }
    const FieldTypeInfo& type = info(FieldTypeOf<T>::value);
    const std::size_t count = size * type.components;  // none of a String, Image or NodeId
    if (count == 0) return std::nullopt;
    return type.elementSize / type.components == sizeof(float) ? firstNotFinite<float>(elements, count)
                                                               : firstNotFinite<double>(elements, count);
}

}  // namespace

std::optional<double> firstNotFinite(const Value& value) {
    switch (value.type()) {
#define RTSG_X(suffix, T)                           \
    case FieldType::SF##suffix:                     \
        return firstNotFiniteOf(&value.as<T>(), 1); \
    case FieldType::MF##suffix:                     \
        return firstNotFiniteOf(value.as<Array<T>>().data(), value.as<Array<T>>().size());
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return std::nullopt;
}

void appendArrayElement(std::string& out, const Value& array, std::size_t index, TextSyntax syntax) {
    Printer printer(out, syntax);
    switch (array.type()) {
#define RTSG_X(suffix, T)                           \
    case FieldType::MF##suffix:                     \
        printer.print(array.as<Array<T>>()[index]); \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
        default:
            break;
    }
}

}  // namespace detail

std::string printFieldText(const Value& value, TextSyntax syntax) {
    std::string text;
    appendFieldText(text, value, syntax);
    return text;
}

std::string jsonString(std::string_view text) {
    return printFieldText(Value(String(asUtf8(text))), TextSyntax::json);
}

}  // namespace rtsg
