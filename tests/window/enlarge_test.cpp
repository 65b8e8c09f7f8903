// Enlarged pictures, against the same sum in double precision.
#include "../../window/sdl_module/enlarge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

TEST(Enlarging, InterpolatesBetweenTheMiddlesOfPixels) {
    std::mt19937 random(3);
    for (const auto& [w, h, width, height] :
         {std::array{7, 5, 31, 40}, std::array{1, 1, 9, 3}, std::array{320, 180, 333, 181}, std::array{4, 9, 4, 9}}) {
        std::vector<std::uint8_t> from(static_cast<std::size_t>(4 * w * h));
        for (std::uint8_t& byte : from) byte = static_cast<std::uint8_t>(random());
        const int stride = 4 * width + 8;
        std::vector<std::uint8_t> to(static_cast<std::size_t>(stride * height), 77);
        enlarge({from.data(), w, h}, to.data(), width, height, stride);
        const auto at = [&](int x, int y, int i) {
            const int row = std::clamp(y, 0, h - 1), column = std::clamp(x, 0, w - 1);
            return static_cast<double>(from[static_cast<std::size_t>(4 * (row * w + column) + i)]);
        };
        for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x)
                for (int i = 0; i < 4; ++i) {
                    const double u = std::clamp((x + .5) * w / width - .5, 0., w - 1.);
                    const double v = std::clamp((y + .5) * h / height - .5, 0., h - 1.);
                    const int x0 = static_cast<int>(u), y0 = static_cast<int>(v);
                    const double above = std::lerp(at(x0, y0, i), at(x0 + 1, y0, i), u - x0);
                    const double below = std::lerp(at(x0, y0 + 1, i), at(x0 + 1, y0 + 1, i), u - x0);
                    ASSERT_NEAR(to[static_cast<std::size_t>(y * stride + 4 * x + i)], std::lerp(above, below, v - y0),
                                3)
                        << x << ' ' << y;
                }
            EXPECT_EQ(to[static_cast<std::size_t>(y * stride + 4 * width)], 77) << "nothing beyond a row";
        }
    }
}

}  // namespace
}  // namespace rtsg
