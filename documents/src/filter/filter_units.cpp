// Converts a document to other units. Values pass in those of the standard, and writers convert them to the document's.
#include <charconv>
#include <cmath>
#include <string>
#include <vector>

#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class UnitsFilter final : public Filter {
  public:
    using Filter::Filter;

    struct Unit {
        std::string category;
        double factor;
    };
    std::vector<Unit> units;

    void beginDocument(const DocumentHeader& header) override {
        Filter::beginDocument(header);
        for (const Unit& unit : units) Filter::unit(unit.category, "own_" + unit.category, unit.factor, {});
    }
    void unit(std::string_view, std::string_view, double, SourceLocation) override {}
};

}  // namespace

Result<FilterPtr> makeUnits(std::string_view units, DocumentHandler& next) {
    auto filter = std::make_unique<UnitsFilter>(next);
    for (std::size_t from = 0; from < units.size();) {
        const std::size_t end = std::min(units.find(',', from), units.size());
        const std::string_view one = units.substr(from, end - from);
        const std::size_t colon = std::min(one.find(':'), one.size());
        const std::string_view category = one.substr(0, colon), number = one.substr(std::min(colon + 1, one.size()));
        double factor = 0;
        const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), factor);
        const bool known = category == "length" || category == "angle" || category == "mass" || category == "force";
        if (!known || error != std::errc() || stop != number.data() + number.size() || !(factor > 0) ||
            !std::isfinite(factor))
            return fail(
                "units=CATEGORY:FACTOR,... takes length, angle, mass or force, and how many metres, radians, "
                "kilograms or newtons one is, not '" +
                std::string(one) + "'");
        filter->units.push_back({std::string(category), factor});
        from = end + 1;
    }
    return filter;
}

}  // namespace rtsg::detail
