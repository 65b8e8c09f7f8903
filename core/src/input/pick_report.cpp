// A pick sensor's findings as numbers and back.
#include "pick_report.h"

#include <cmath>

namespace rtsg {

namespace {

constexpr std::size_t kNumbersEach = 9;

bool isNodeNumber(double number) {
    return number >= 1 && number <= double(UINT32_MAX) && number == std::floor(number);
}

}  // namespace

Array<double> PickReport::toValue() const {
    Array<double> value{double(sensor.value), double(geometry.size())};
    for (const NodeId id : geometry) value.push_back(id.value);
    for (const PickedSurface& surface : surfaces)
        for (const Vec3f& v : {surface.point, surface.normal, surface.texCoord})
            for (const float number : {v.x, v.y, v.z}) value.push_back(double(number));
    return value;
}

Result<PickReport> PickReport::fromValue(const Array<double>& value) {
    for (const double number : value)
        if (!std::isfinite(static_cast<float>(number))) return fail("a number of a pick is not finite");
    PickReport report;
    const bool begins = value.size() >= 2 && isNodeNumber(value[0]) && value[1] >= 0 &&
                        value[1] <= double(value.size() - 2) && value[1] == std::floor(value[1]);
    const std::size_t first = begins ? 2 + static_cast<std::size_t>(value[1]) : 0;
    if (!begins || (value.size() - first) % kNumbersEach != 0)
        return fail("no pick: the numbers are too few or too many");
    report.sensor = NodeId{static_cast<std::uint32_t>(value[0])};
    for (std::size_t i = 2; i < first; ++i) {
        if (!isNodeNumber(value[i])) return fail("no pick: not the number of a node");
        report.geometry.push_back(NodeId{static_cast<std::uint32_t>(value[i])});
    }
    for (std::size_t i = first; i < value.size(); i += kNumbersEach) {
        const auto at = [&](std::size_t k) {
            return Vec3f(float(value[i + k]), float(value[i + k + 1]), float(value[i + k + 2]));
        };
        report.surfaces.push_back({at(0), at(3), at(6)});
    }
    return report;
}

}  // namespace rtsg
