// Draws the force on a hand, and its distance from its proxy, by time.
#include "touch_plot.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <fmt/format.h>
#include <glm/geometric.hpp>

namespace rtsg::app {

namespace {

constexpr double kWidth = 800, kHeight = 200, kLeft = 60, kTop = 24, kGap = 50;

/// 1, 2 or 5 times a power of ten, at least `most`.
double roundUp(double maximum) {
    if (!(maximum > 0)) return 1;
    const double power = std::pow(10.0, std::floor(std::log10(maximum)));
    for (const double factor : {1.0, 2.0, 5.0, 10.0})
        if (factor * power >= maximum) return factor * power;
    return maximum;
}

/// One diagram; `unit` stands at its axis. A point for each pixel: the largest value in it.
std::string diagram(const std::vector<HapticTick>& ticks, int row, const std::string& title,
                    const std::function<double(const HapticTick&)>& value) {
    const double first = ticks.front().seconds, last = std::max(ticks.back().seconds, first + 1e-9);
    double maximum = 0;
    for (const HapticTick& t : ticks) maximum = std::max(maximum, value(t));
    const double scale = roundUp(maximum);
    const double top = kTop + row * (kHeight + kGap), bottom = top + kHeight;
    std::vector<double> columns(static_cast<std::size_t>(kWidth) + 1, -1);
    for (const HapticTick& t : ticks) {
        double& column = columns[static_cast<std::size_t>(kWidth * (t.seconds - first) / (last - first))];
        column = std::max(column, value(t));
    }
    std::string points;
    for (std::size_t x = 0; x < columns.size(); ++x)
        if (columns[x] >= 0)
            points +=
                fmt::format("{:.0f},{:.1f} ", kLeft + static_cast<double>(x), bottom - kHeight * columns[x] / scale);
    std::string svg = fmt::format("<text x='{}' y='{}'>{}</text>\n", kLeft, top - 8, title);
    for (int i = 0; i <= 4; ++i) {
        const double y = bottom - kHeight * i / 4, x = kLeft + kWidth * i / 4;
        svg += fmt::format(
            "<path d='M{} {}h{}' stroke='#ddd'/><text x='{}' y='{}' text-anchor='end'>{:.4g}</text>"
            "<text x='{}' y='{}' text-anchor='middle'>{:.4g} s</text>\n",
            kLeft, y, kWidth, kLeft - 6, y + 4, scale * i / 4, x, bottom + 18, first + (last - first) * i / 4);
    }
    return svg + fmt::format("<polyline points='{}' fill='none' stroke='#06c' stroke-width='1.5'/>\n", points);
}

}  // namespace

std::string touchPlot(const std::vector<HapticTick>& ticks) {
    const double height = kTop + 2 * (kHeight + kGap);
    std::string svg = fmt::format(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0} {1}' width='{0}' height='{1}' "
        "font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' fill='white'/>\n",
        kLeft + kWidth + 30, height);
    if (!ticks.empty()) {
        svg += diagram(ticks, 0, "Force on the hand, N", [](const HapticTick& t) { return glm::length(t.force); });
        svg += diagram(ticks, 1, "Distance of the hand from its proxy, mm",
                       [](const HapticTick& t) { return 1e3 * glm::length(t.hand - t.proxy); });
    }
    return svg + "</svg>\n";
}

}  // namespace rtsg::app
