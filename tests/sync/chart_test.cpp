// Charts: what rtsg chart writes.
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/chart.h"

namespace rtsg::bench {
namespace {

using testing::HasSubstr;
using testing::Not;

Chart small() {
    return {"errors",
            "Error & time",
            "",
            {"time (s)", true},
            {"error", true},
            {{"a, b", {{1, 10, {}}, {100, .1, {}}}}, {"bad <points>", {{0, 1, {}}, {NAN, 1, {}}, {10, -1, {}}}}},
            {}};
}

TEST(Chart, CsvHasALineForEachPointAndQuotesWhatNeedsIt) {
    EXPECT_EQ(csvOf(small()),
              "series,time (s),error,label\n\"a, b\",1,10,\n\"a, b\",100,0.1,\nbad <points>,0,1,\nbad <points>,nan,1,\n"
              "bad <points>,10,-1,\n");
}

TEST(Chart, CsvOfRowsNamesThem) {
    Chart chart = small();
    chart.rows = {"upper", "lower"};
    chart.series = {{"s", {{3, 1, "x"}, {4, 0, {}}}}};
    EXPECT_EQ(csvOf(chart), "series,row,time (s),label\ns,lower,3,x\ns,upper,4,\n");
}

TEST(Chart, PictureEscapesTextAndLeavesOutWhatHasNoPlace) {
    const std::string svg = svgOf(small());
    EXPECT_THAT(svg, HasSubstr("Error &amp; time"));
    EXPECT_THAT(svg, HasSubstr("a, b"));
    EXPECT_THAT(svg, Not(HasSubstr("bad")));  // no point of that series can be shown
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(Chart, NothingToShowIsStillAPicture) {
    Chart chart = small();
    for (const bool logarithmic : {true, false}) {
        chart.x.logarithmic = chart.y.logarithmic = logarithmic;
        for (const std::vector<ChartPoint>& points :
             {std::vector<ChartPoint>{}, {{5, 5, {}}}, {{0, 0, {}}}, {{1e300, 1e-300, {}}, {1e-300, 1e300, {}}}}) {
            chart.series = {{"s", points}};
            const std::string svg = svgOf(chart);
            EXPECT_THAT(svg, Not(HasSubstr("nan")));
            EXPECT_THAT(svg, HasSubstr("</svg>"));
            EXPECT_LT(svg.size(), 20'000u);
        }
    }
}

TEST(Chart, WhatStandsBesideAChartIsWrittenWithIt) {
    const auto folder = std::filesystem::temp_directory_path() / ("rtsg_chart_" + std::to_string(::getpid()));
    Chart chart = small();
    std::filesystem::path given;
    chart.beside = [&](const std::filesystem::path& into) -> Result<> {
        given = into;
        return fail("no room for it");
    };
    const Result<> written = writeChart(chart, folder);
    EXPECT_EQ(given, folder);
    EXPECT_TRUE(std::filesystem::exists(folder / "errors.svg"));
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().text, "no room for it");
    std::filesystem::remove_all(folder);
}

TEST(Chart, AFolderThatCannotBeWrittenIsReported) {
    EXPECT_FALSE(writeChart(small(), "/proc/no/such/place"));
}

}  // namespace
}  // namespace rtsg::bench
