// Shortens numbers: each becomes the shortest decimal that is near enough.
#include <array>
#include <charconv>
#include <cmath>

#include "commands/value_numbers.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

template <class S>
S shortest(S number, double error) {
    if (!std::isfinite(number)) return number;
    const auto exact = static_cast<double>(number);
    if (std::abs(exact) <= error) return 0;
    constexpr int maximum = sizeof(S) == 4 ? 9 : 17;
    for (int digits = 1; digits < maximum; ++digits) {
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
    void quantise(Value& value) const {
        const FieldType type = sf(value.type());
        if (type == FieldType::SFRotation || type == FieldType::SFTime) return;  // their axes and moments stay
        changeNumbers(value, [&](auto numbers) {
            for (auto& number : numbers) number = shortest(number, error_);
        });
    }

    double error_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeQuantise(double error, DocumentHandler& next) {
    return std::make_unique<Quantise>(error, next);
}

}  // namespace rtsg::detail
