// Listeners and their images are chosen in proportion to what they would hear, and with the chance that is told.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "response/listener_choice.h"
#include "signal/random.h"

namespace rtsg::trace {
namespace {

constexpr std::size_t kOnPlane = 3, kOnNone = 1000;

struct Field {
    ListenerChoice choice{4};
    std::vector<glm::dvec3> positions;
    std::vector<double> fractions;

    explicit Field(std::size_t count) {
        Random random(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            const double x = 8 * random.uniform() - 4, y = 8 * random.uniform() - 4, z = 8 * random.uniform() - 4;
            positions.push_back(i == 0 ? glm::dvec3(0, 0, 3) : glm::dvec3(x, y, z));  // one before all of the places
            fractions.push_back(random.uniform());
            choice.add({positions.back(), 0, i}, fractions.back());
        }
    }
    /// By Lambert's law, in double precision.
    std::vector<double> expected(const glm::dvec3& point, const glm::dvec3& normal) const {
        std::vector<double> worth;
        double all = 0;
        for (std::size_t i = 0; i < positions.size(); ++i) {
            const glm::dvec3 displacement = positions[i] - point;
            const double distance = glm::length(displacement);
            worth.push_back(fractions[i] * std::max(0.0, glm::dot(displacement, normal)) / std::pow(distance, 3));
            all += worth.back();
        }
        for (double& w : worth) w /= all;
        return worth;
    }
};

void expectChances(Field& field, std::size_t side, const glm::dvec3& point, const glm::dvec3& normal) {
    constexpr int kTries = 100'000;
    const std::vector<double> expected = field.expected(point, normal);
    std::vector<double> counts(expected.size()), reported(expected.size());
    for (int i = 0; i < kTries; ++i) {
        std::size_t which = 0;
        const double chance = field.choice.choose(side, point, normal, (i + 0.5) / kTries, which);
        ASSERT_LT(which, expected.size());
        counts[which] += 1.0 / kTries;
        reported[which] = chance;
    }
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(counts[i], expected[i], 0.01 * expected[i] + 2.0 / kTries) << i;
        // The energy is divided by it.
        if (counts[i] == 0) continue;
        EXPECT_NEAR(reported[i], counts[i], 1e-5 * counts[i] + 2.0 / kTries) << i;
    }
}

TEST(ListenerChoice, IsInProportionToWhatIsHeardAndTheChanceIsTold) {
    for (const std::size_t count : {1u, 7u, 8u, 9u, 65u}) {
        Field field(count);
        const glm::dvec3 up(0, 0, 1);
        // Places on one side of a plane; then the other side of it, and no plane at all.
        expectChances(field, kOnPlane, {0.3, 0.2, -1}, up);
        expectChances(field, kOnPlane, {-3, 2, -1}, up);
        expectChances(field, kOnNone, {1, 0.5, 0.2}, glm::normalize(glm::dvec3(1, 2, 3)));
        expectChances(field, kOnNone, {1, 0.5, -0.2}, glm::normalize(glm::dvec3(-1, 0.2, 3)));
    }
}

TEST(ListenerChoice, NothingIsChosenWhereAllIsBehind) {
    Field field(9);
    std::size_t which = 7;
    for (const std::size_t side : {kOnPlane, kOnPlane, kOnNone})
        EXPECT_EQ(field.choice.choose(side, {0, 0, 5}, {0, 0, 1}, 0.5, which), 0);
    EXPECT_EQ(which, 7u);
}

}  // namespace
}  // namespace rtsg::trace
