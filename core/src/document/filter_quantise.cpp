// Shortens numbers: each becomes the shortest decimal that is near enough.
#include <array>
#include <charconv>
#include <cmath>

#include "filter_parts.h"

namespace rtsg::detail {

namespace {

template <class S>
S shortest(S number, double error) {
    if (!std::isfinite(number)) return number;
    const auto exact = static_cast<double>(number);
    if (std::abs(exact) <= error) return 0;
    constexpr int most = sizeof(S) == 4 ? 9 : 17;
    for (int digits = 1; digits < most; ++digits) {
        std::array<char, 40> text{};
        const auto end =
            std::to_chars(text.data(), text.data() + text.size(), exact, std::chars_format::scientific, digits - 1);
        S candidate{};
        std::from_chars(text.data(), end.ptr, candidate);
        if (std::abs(static_cast<double>(candidate) - exact) <= error) return candidate;
    }
    return number;
}

class Quantise final : public Filter {
  public:
    Quantise(double error, DocumentHandler& next) : Filter(next), error_(error) {}

    void setField(std::string_view name, Value value, SourceLocation where) override {
        quantise(value);
        Filter::setField(name, std::move(value), where);
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        if (value) quantise(*value);
        Filter::declareField(field, std::move(value), where);
    }

  private:
    template <class T, class S>
    void change(Value& value) const {
        const auto numbers = [&](S* first, std::size_t count) {
            for (std::size_t i = 0; i < count; ++i) first[i] = shortest(first[i], error_);
        };
        if (value.holds<T>()) {
            T one = value.as<T>();
            numbers(reinterpret_cast<S*>(&one), sizeof(T) / sizeof(S));
            value = Value(one);
        } else {
            Array<T> all = value.as<Array<T>>();
            if (all.empty()) return;
            numbers(reinterpret_cast<S*>(all.mutableData()), all.size() * sizeof(T) / sizeof(S));
            value = Value(std::move(all));
        }
    }
    void quantise(Value& value) const {
        switch (sf(value.type())) {
            case FieldType::SFFloat:
                return change<float, float>(value);
            case FieldType::SFVec2f:
                return change<Vec2f, float>(value);
            case FieldType::SFVec3f:
                return change<Vec3f, float>(value);
            case FieldType::SFVec4f:
                return change<Vec4f, float>(value);
            case FieldType::SFColor:
                return change<Color, float>(value);
            case FieldType::SFColorRGBA:
                return change<ColorRGBA, float>(value);
            case FieldType::SFDouble:
                return change<double, double>(value);
            case FieldType::SFVec2d:
                return change<Vec2d, double>(value);
            case FieldType::SFVec3d:
                return change<Vec3d, double>(value);
            default:
                return;  // rotations keep their axes, times their moments
        }
    }
    double error_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeQuantise(double error, DocumentHandler& next) {
    return std::make_unique<Quantise>(error, next);
}

}  // namespace rtsg::detail
