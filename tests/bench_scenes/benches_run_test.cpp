// Every bench runs to its end when it is run small, and each of its lines says what it is measured against.
#include <cmath>
#include <ostream>

#include <gtest/gtest.h>

#include "bench/bench.h"

namespace rtsg::bench {
namespace {

struct One {
    const char* name;
    bool (*run)(const Report&);
};
void PrintTo(const One& one, std::ostream* out) {
    *out << one.name;
}

template <auto Run>
bool always(const Report& report) {
    Run(report, true);
    return true;
}
template <auto Run>
bool asItSays(const Report& report) {
    return Run(report, true);
}

class Benches : public testing::TestWithParam<One> {};

TEST_P(Benches, RunToTheirEnd) {
    std::size_t lines = 0, against = 0;
    EXPECT_TRUE(GetParam().run([&](const Line& line) {
        ++lines;
        against += !line.baselineName.empty() || !line.limitName.empty();
        EXPECT_EQ(line.bench, GetParam().name);
        EXPECT_TRUE(std::isfinite(line.value)) << line.name << ": " << line.metric;
    }));
    EXPECT_GT(lines, 0u);
    EXPECT_GT(2 * against, lines) << "more than half of the lines have a baseline or a limit";
}

INSTANTIATE_TEST_SUITE_P(Small, Benches,
                         testing::Values(One{"transform", always<transform>}, One{"animated", always<animated>},
                                         One{"changes", always<changes>}, One{"structure", always<structure>},
                                         One{"rays", asItSays<rays>}, One{"overlap", asItSays<overlap>},
                                         One{"deform", always<deform>}, One{"instances", always<instances>},
                                         One{"stage", always<stage>}, One{"export", always<exporting>},
                                         One{"sound", asItSays<sound>}, One{"feeds", asItSays<feedsLatency>}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace rtsg::bench
