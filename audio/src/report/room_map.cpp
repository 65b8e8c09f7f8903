// Writes maps of figures as tables, and draws them.
#include <rtsg/audio/room_report.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "heat_color.h"
#include "map_text.h"
#include "report_figures.h"

namespace rtsg {
namespace {

constexpr std::string_view kSpeechName = "STI";

const ReportFigure* figureNamed(std::string_view name) {
    const auto found = std::ranges::find_if(
        kReportFigures, [&](const ReportFigure& figure) { return figure.name == name || figure.key == name; });
    return found == kReportFigures.end() ? nullptr : &*found;
}

/// The name as it is typed: a name with a space has a key without one.
std::string_view typedName(const ReportFigure& figure) {
    return figure.name.find(' ') == figure.name.npos ? figure.name : figure.key;
}

double valueOf(const RoomReport::Pair& pair, const MapFigure& figure) {
    if (figure.name == kSpeechName) return pair.speech.sti;
    const ReportFigure* found = figureNamed(figure.name);
    if (!found) return std::numeric_limits<double>::quiet_NaN();
    const RoomMetrics& metrics = pair.metrics.value;
    return figure.band ? (metrics.*found->values)[*figure.band] : found->single(metrics);
}

}  // namespace

Result<MapFigure> MapFigure::parse(std::string_view text) {
    const std::size_t at = text.find('@');
    MapFigure figure{std::string(text.substr(0, at)), std::nullopt};
    if (figure.name != kSpeechName && !figureNamed(figure.name)) {
        std::string names;
        for (const ReportFigure& one : kReportFigures) names += std::string(typedName(one)) + ", ";
        return fail(fmt::format("'{}' is no figure; there are {}{}", figure.name, names, kSpeechName));
    }
    if (at == text.npos) return figure;
    std::string octaves;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const std::string hz = fmt::format("{}", kBandHz[b]);
        if (figure.name != kSpeechName && text.substr(at + 1) == hz) figure.band = b;
        octaves += (b > 0 ? ", " : "") + hz;
    }
    if (figure.name == kSpeechName) return fail("STI has no octaves: it is one figure of all");
    if (!figure.band) return fail(fmt::format("'{}' is no octave; there are {}", text.substr(at + 1), octaves));
    return figure;
}

std::string MapFigure::title() const {
    const ReportFigure* found = figureNamed(name);
    if (!found) return name;
    const std::string octaves =
        band ? fmt::format("{} Hz", kBandHz[*band])
             : fmt::format("mean of {} to {} Hz", kBandHz[static_cast<std::size_t>(found->first)],
                           kBandHz[static_cast<std::size_t>(found->last)]);
    return fmt::format("{}, {}", found->title(), octaves);
}

std::vector<double> RoomMap::values(const MapFigure& figure) const {
    std::vector<double> sums(grid.columns * grid.rows), counts(sums.size());
    const std::size_t inside = grid.inside.size();
    for (std::size_t i = 0; i < report.pairs.size() && inside > 0; ++i)
        if (const double value = valueOf(report.pairs[i], figure); std::isfinite(value)) {
            sums[grid.inside[i % inside]] += value;
            counts[grid.inside[i % inside]] += 1;
        }
    for (std::size_t point = 0; point < sums.size(); ++point) sums[point] /= counts[point];  // 0 / 0 is no number
    return sums;
}

std::string RoomMap::toCsv() const {
    std::string text = "source,x,y,z";
    for (const ReportFigure& figure : kReportFigures)
        for (const double hz : kBandHz) text += fmt::format(",{0}@{1},{0}@{1}_ci95", figure.key, hz);
    text += ",STI,STI_ci95\n";
    const auto add = [&](double value) { text += std::isfinite(value) ? fmt::format(",{:.6g}", value) : ","; };
    for (const RoomReport::Pair& pair : report.pairs) {
        std::string source = pair.source;
        for (std::size_t at = 0; (at = source.find('"', at)) != source.npos; at += 2) source.insert(at, 1, '"');
        text += '"' + printable(source) + '"';
        for (int axis = 0; axis < 3; ++axis) add(pair.listenerAt[axis]);
        for (const ReportFigure& figure : kReportFigures)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                add((pair.metrics.value.*figure.values)[b]);
                add((pair.metrics.ci95.*figure.values)[b]);
            }
        add(pair.speech.sti);
        add(pair.speech.ci95);
        text += '\n';
    }
    return text;
}

namespace {

const Vec4f kMapInk(.1f, .1f, .12f, 1), kMapPaper(1, 1, 1, 1);

/// Draws at metres of a map, into a picture.
class MapCanvas {
  public:
    MapCanvas(const FloorGrid& grid, int cell)
        : grid_(grid),
          cell_(cell),
          mapWidth_(static_cast<int>(grid.columns) * cell),
          mapHeight_(static_cast<int>(grid.rows) * cell),
          picture_(std::max(mapWidth_, kMinWidth) + 2 * kAround + kScale, mapHeight_ + 2 * kAround + kHead, kMapPaper) {
        picture_.space = ColorSpace::display;
    }

    void fill(int x, int y, int width, int height, const Vec4f& color) {
        for (int py = std::max(0, y); py < std::min(picture_.height, y + height); ++py)
            for (int px = std::max(0, x); px < std::min(picture_.width, x + width); ++px) picture_.at(px, py) = color;
    }
    void square(std::size_t point, const Vec4f& color) {
        const auto column = static_cast<int>(point % grid_.columns), row = static_cast<int>(point / grid_.columns);
        fill(kAround + column * cell_, kTop + row * cell_, cell_, cell_, color);
    }
    /// x and z, m.
    void line(const glm::dvec2& from, const glm::dvec2& to) {
        const glm::dvec2 a = pixel(from), b = pixel(to);
        const int steps = static_cast<int>(std::min(1e4, 2 * glm::distance(a, b))) + 1;
        for (int i = 0; i <= steps; ++i) {
            const glm::dvec2 at = glm::mix(a, b, static_cast<double>(i) / steps);
            fill(static_cast<int>(at.x), static_cast<int>(at.y), 2, 2, kMapInk);
        }
    }
    void source(const glm::dvec3& position) {
        const glm::dvec2 at = pixel({position.x, position.z});
        const int x = static_cast<int>(at.x), y = static_cast<int>(at.y);
        fill(x - 6, y - 6, 13, 13, kMapPaper);
        fill(x - 4, y - 4, 9, 9, {.8f, .1f, .1f, 1});
    }
    void text(int x, int y, std::string_view text) { drawMapText(picture_, x, y, text, kMapInk); }
    /// Colours from `low` below to `high` above, with numbers every `step`.
    void scale(double low, double high, double step, int digits) {
        const int x = picture_.width - kScale - kAround + kGap, height = mapHeight_;
        for (int y = 0; y < height; ++y) {
            const HeatColor color = heatColor(1 - (y + .5) / height);
            fill(x, kTop + y, kBar, 1, Vec4f(color[0] / 255, color[1] / 255, color[2] / 255, 1));
        }
        for (double value = std::ceil(low / step - 1e-9) * step; value <= high + 1e-9 * step; value += step) {
            const int y = kTop + static_cast<int>(std::lround((high - value) / (high - low) * height));
            fill(x, y, kBar + 4, 1, kMapInk);
            text(x + kBar + 8, y - kMapLetterHeight / 2, fmt::format("{:.{}f}", value + 0.0, digits));
        }
    }
    /// A length along the map, m.
    void metres(double length) {
        const int y = kTop + mapHeight_ + kGap, width = static_cast<int>(std::lround(length / grid_.step * cell_));
        fill(kAround, y, width, 3, kMapInk);
        text(kAround + width + 8, y - 5, fmt::format("{:.4g} m", length));
    }
    Picture take() { return std::move(picture_); }
    int mapWidth() const { return mapWidth_; }

    static constexpr int kAround = 40, kHead = 34, kTop = kAround + kHead, kGap = 14, kBar = 22, kScale = 130;

  private:
    static constexpr int kMinWidth = 420;

    glm::dvec2 pixel(const glm::dvec2& point) const {
        return {kAround + ((point.x - grid_.x) / grid_.step + .5) * cell_,
                kTop + ((point.y - grid_.z) / grid_.step + .5) * cell_};
    }

    const FloorGrid& grid_;
    int cell_, mapWidth_, mapHeight_;
    Picture picture_;
};

}  // namespace

Picture RoomMap::picture(const MapFigure& figure) const {
    constexpr int kLongSide = 840;
    const auto maximum = static_cast<int>(std::max(grid.columns, grid.rows));
    MapCanvas canvas(grid, std::clamp(kLongSide / std::max(1, maximum), 2, 96));
    const std::vector<double> all = values(figure);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double value : all)
        if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
    canvas.text(MapCanvas::kAround, MapCanvas::kAround, figure.title());
    for (const std::size_t point : grid.inside) canvas.square(point, {.86f, .86f, .86f, 1});
    if (low <= high) {
        // A figure that is the same everywhere gets the middle of its scale.
        const double around = std::max(1e-3 * std::max(std::abs(low), 1e-3), (high - low) / 20);
        low -= around, high += around;
        for (std::size_t point = 0; point < all.size(); ++point)
            if (std::isfinite(all[point])) {
                const HeatColor color = heatColor((all[point] - low) / (high - low));
                canvas.square(point, Vec4f(color[0] / 255, color[1] / 255, color[2] / 255, 1));
            }
        const double step = niceStep(high - low, 6);
        canvas.scale(low, high, step, std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9))));
    }
    for (const RoomPlan::Line& line : report.plan.lines) canvas.line(line[0], line[1]);
    const std::string* last = nullptr;
    for (const RoomReport::Pair& pair : report.pairs) {
        if (!last || *last != pair.source) canvas.source(pair.sourceAt);
        last = &pair.source;
    }
    canvas.metres(niceStep(grid.step * static_cast<double>(grid.columns), 4));
    return canvas.take();
}

}  // namespace rtsg
