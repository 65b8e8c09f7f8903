// Versions of a paged array stay what they were, and differ where something was changed.
#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/paged_array.h>

namespace rtsg {
namespace {

TEST(PagedArray, VersionsStayWhatTheyWere) {
    constexpr std::uint64_t kArraySeed = 3;
    SCOPED_TRACE(kArraySeed);
    std::mt19937_64 random(kArraySeed);
    PagedArrayWriter<int> writer;
    std::vector<int> truth;
    std::vector<std::pair<PagedArray<int>, std::vector<int>>> versions;
    versions.emplace_back(writer.freeze(), truth);
    for (int step = 0; step < 60; ++step) {
        if (random() % 3 == 0) {
            truth.resize(truth.size() + random() % (step < 30 ? 40 : 20'000));
            writer.resize(truth.size());
        }
        for (std::size_t edits = random() % 8; edits > 0 && !truth.empty(); --edits) {
            const std::size_t at = random() % truth.size();
            writer.change(at) = truth[at] = static_cast<int>(random() % 1000);
        }
        ASSERT_EQ(writer.size(), truth.size());
        versions.emplace_back(writer.freeze(), truth);
    }
    for (const auto& [version, values] : versions) {
        ASSERT_EQ(version.size(), values.size());
        for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(version[i], values[i]);
    }
    // Between any two, both ways round.
    for (int pair = 0; pair < 200; ++pair) {
        const auto& [a, x] = versions[random() % versions.size()];
        const auto& [b, y] = versions[random() % versions.size()];
        std::map<std::size_t, std::pair<int, int>> expected, found;
        for (std::size_t i = 0; i < std::max(x.size(), y.size()); ++i) {
            const int before = i < x.size() ? x[i] : 0, now = i < y.size() ? y[i] : 0;
            if (before != now) expected[i] = {before, now};
        }
        PagedArray<int>::differences(a, b, [&](std::size_t i, int before, int now) {
            if (before != now) found[i] = {before, now};
        });
        EXPECT_EQ(found, expected);
    }
}

TEST(PagedArray, DifferencesCostWhatDiffers) {
    for (const std::size_t size : {1000u, 100'000u}) {
        PagedArrayWriter<int> writer;
        writer.resize(size);
        for (std::size_t i = 0; i < size; ++i) writer.change(i) = 1;
        const PagedArray<int> before = writer.freeze();
        writer.change(size / 2) = 2;
        std::size_t looked = 0;
        PagedArray<int>::differences(before, writer.freeze(), [&](std::size_t, int, int) { ++looked; });
        EXPECT_LE(looked, 16u);
    }
}

}  // namespace
}  // namespace rtsg
