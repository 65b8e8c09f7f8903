// Charts of `rtsg chart`: what was measured, as series of points, and how they become CSV and SVG.
//
// A chart source measures and hands finished charts to a sink; it draws nothing. To add a chart: write such a function
// next to the bench whose figures it shows, and one row into the table of app/verbs/verb_chart.cpp.
// Threading: plain data.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::bench {

struct ChartPoint {
    double x = 0, y = 0;
    std::string label;  // written beside the point; most have none
};

/// Joined in the order given, except in a chart with rows.
struct Series {
    std::string name;
    std::vector<ChartPoint> points;
    /// For limits and closed forms: a thin dashed line without marks, in grey.
    bool reference = false;
    /// Marks alone, not joined.
    bool scattered = false;
};

struct Axis {
    std::string label;  // with the unit: "time per frame (us)"
    bool logarithmic = false;
    /// Linear axes start at 0 unless values are negative or this says otherwise.
    bool fromZero = true;
};

struct Chart {
    std::string name;   // of the files, without ending: "scale-add"
    std::string title;  // what is to be seen
    std::string note;   // how it was measured, below the title
    Axis x, y;
    std::vector<Series> series;
    /// If any: names of rows, the first on top; a point's y is then the index of its row and the y axis is not drawn.
    std::vector<std::string> rows;
    /// If any: writes what stands beside the chart, such as pictures, into its folder.
    std::function<Result<>(const std::filesystem::path& folder)> beside = {};
};

using ChartSink = std::function<void(const Chart&)>;

/// The picture. Points that are not finite, or not positive on a logarithmic axis, are left out.
std::string svgOf(const Chart& chart);
/// One line a point: series, x (or the row's name), y, label; the first line names the axes.
std::string csvOf(const Chart& chart);
/// Writes NAME.svg and NAME.csv into `folder`, which is made. Error: a file that cannot be written.
Result<> writeChart(const Chart& chart, const std::filesystem::path& folder);

}  // namespace rtsg::bench
