// A signal read between its samples, one by one and a block at once.
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "signal/delay_line.h"

namespace rtsg {
namespace {

double sineAt(double sample) {
    return std::sin(2 * std::numbers::pi * 0.037 * sample);
}

/// A tone of `count` samples, written in blocks of 100.
DelayLine toneLine(std::size_t count, std::size_t longest) {
    DelayLine line;
    std::vector<float> block;
    for (std::size_t i = 0; i < count; ++i) {
        block.push_back(static_cast<float>(sineAt(static_cast<double>(i))));
        if (block.size() < 100 && i + 1 < count) continue;
        line.write(block, longest);
        block.clear();
    }
    return line;
}

/// Reading a block at once must give the same as reading samples one by one.
void expectSame(const DelayLine& line, std::size_t index, const std::vector<double>& delays, const char* what) {
    std::vector<float> block(delays.size());
    line.read(index, delays, block);
    for (std::size_t i = 0; i < delays.size(); ++i)
        EXPECT_EQ(block[i], line.read(index + i, delays[i])) << what << ", sample " << i;
}

TEST(DelayLine, ReadsAToneAtAnyDelay) {
    const DelayLine line = toneLine(5000, 3000);
    std::vector<double> delays;
    for (std::size_t i = 0; i < 203; ++i) delays.push_back(1000.3 - 0.031 * static_cast<double>(i));
    std::vector<float> heard(delays.size());
    line.read(4700, delays, heard);
    for (std::size_t i = 0; i < delays.size(); ++i)
        EXPECT_NEAR(static_cast<double>(heard[i]), sineAt(4700 + static_cast<double>(i) - delays[i]), 1e-5) << i;
}

TEST(DelayLine, ABlockIsReadAsEachOfItsSamples) {
    const DelayLine line = toneLine(5000, 3000);
    const auto ramp = [](std::size_t count, double from, double by) {
        std::vector<double> delays;
        for (std::size_t i = 0; i < count; ++i) delays.push_back(from + by * static_cast<double>(i));
        return delays;
    };
    expectSame(line, 4700, ramp(300, 500.25, 0.07), "moves away");
    expectSame(line, 4700, ramp(300, 500.25, -1.5), "faster than sound");
    expectSame(line, 4700, ramp(16, 700, 0), "whole samples");
    expectSame(line, 4700, ramp(16, 699.5, 0.125), "whole samples among others");
    expectSame(line, 4995, ramp(5, 20.5, 0), "less than eight");
    expectSame(line, 4900, ramp(100, 17.3, -0.05), "so near that the taps would reach into the future");
    expectSame(line, 4990, ramp(8, -3.5, 0.5), "what is not there yet");
    expectSame(line, 4700, ramp(64, 4650.5, 2), "before the first sample");
    expectSame(toneLine(60, 1000), 40, ramp(16, 30.5, 0.3), "a line that has just begun");
    // A line of 8,192 samples that has gone round, at and beyond its oldest.
    const DelayLine round = toneLine(30000, 3000);
    for (const double delay : {3000.5, 4000.25, 8100.5, 8190.75, 8300.5, 20000.5})
        expectSame(round, 29900, ramp(96, delay, 0.01), "a line that has gone round");
    for (std::size_t index = 24500; index < 24700; index += 7)
        expectSame(round, index + 5000, ramp(24, 5000.5, 0), "over the end of its memory");
}

}  // namespace
}  // namespace rtsg
