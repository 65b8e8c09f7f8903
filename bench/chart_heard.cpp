// Chart "heard": how far what is heard is from what is right, against what it costs, by quality and with less
// diffraction.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "bench.h"
#include "charts.h"
#include "engine/acoustic_engine.h"
#include "signal/fft.h"
#include "sound_rooms.h"

namespace rtsg::bench {

namespace {

constexpr int kHeardRate = 48'000;
constexpr double kFramesPerSecond = 30;
/// When the source clicks in each second, and how fast it walks, m/s, on which circle, m.
constexpr double kClick = .05, kWalk = 1, kCircle = .5;
/// Thirds of an octave from 125 Hz to 4 kHz.
constexpr int kThirds = 16;

/// Energies by third and window of 20 ms after a click, and those of an octave before and after 80 ms.
struct ClickHeard {
    std::array<std::vector<double>, kThirds> windows;
    std::array<double, kThirds> early{}, late{};
};

/// The click in the second that begins at sample `begin`, both channels together.
ClickHeard clickOf(const SoundBuffer& sound, std::size_t begin) {
    constexpr std::size_t kSize = 65'536, kWindow = kHeardRate / 50;
    const std::size_t first = begin + static_cast<std::size_t>(kClick * kHeardRate),
                      count = std::min(sound.frames(), begin + kHeardRate) - first;
    const auto fft = RealFft::kept(kSize);
    ClickHeard heard;
    for (std::size_t channel = 0; channel < 2; ++channel) {
        std::vector<float> samples(kSize), filtered(kSize);
        for (std::size_t i = 0; i < count; ++i) samples[i] = sound.samples[2 * (first + i) + channel];
        RealFft::Spectrum whole, part;
        fft->forward(samples, whole);
        const std::size_t onset = static_cast<std::size_t>(
            std::ranges::find_if(samples, [](float sample) { return std::abs(sample) > 1e-6f; }) - samples.begin());
        for (int third = 0; third < kThirds; ++third) {
            const double middle = 1000 * std::exp2((third - 9) / 3.0);
            part = whole;
            for (std::size_t k = 0; k < part.size(); ++k) {
                const double hertz = static_cast<double>(k) * kHeardRate / kSize;
                const double away = k == 0 ? 1 : std::min(1.0, std::abs(3 * std::log2(hertz / middle)));
                part[k] *= static_cast<float>(std::cos(away * M_PI / 2));
            }
            fft->inverse(part, filtered);
            auto& windows = heard.windows[static_cast<std::size_t>(third)];
            windows.resize(count / kWindow);
            for (std::size_t i = 0; i < count; ++i) {
                const double energy = static_cast<double>(filtered[i]) * static_cast<double>(filtered[i]);
                if (i / kWindow < windows.size()) windows[i / kWindow] += energy;
                (i < onset + .08 * kHeardRate ? heard.early : heard.late)[static_cast<std::size_t>(third)] += energy;
            }
        }
    }
    return heard;
}

/// Sums of squares, in noticeable differences: 1 dB of level, 1 dB of C80.
struct HeardErrors {
    double level = 0, c80 = 0;
    int levels = 0, clarities = 0;

    void add(const ClickHeard& heard, const ClickHeard& truth) {
        constexpr double kHeardRange = 1e-3;  // of the loudest window of a band
        for (std::size_t third = 0; third < kThirds; ++third) {
            const std::vector<double>&is = heard.windows[third], &right = truth.windows[third];
            const double minimum = kHeardRange * *std::ranges::max_element(right);
            for (std::size_t w = 0; w < std::min(is.size(), right.size()); ++w) {
                if (!(right[w] > minimum && is[w] > 0)) continue;
                level += std::pow(10 * std::log10(is[w] / right[w]), 2);
                ++levels;
            }
        }
        for (std::size_t octave = 0; octave + 2 < kThirds; octave += 3) {
            const auto clarity = [&](const ClickHeard& one) {
                double early = 0, late = 0;
                for (std::size_t third = octave; third < octave + 3; ++third)
                    early += one.early[third], late += one.late[third];
                return 10 * std::log10(early / late);
            };
            c80 += std::pow(clarity(heard) - clarity(truth), 2);
            ++clarities;
        }
    }
    double largest() const {
        return std::max(std::sqrt(level / std::max(1, levels)), std::sqrt(c80 / std::max(1, clarities)));
    }
};

/// An engine that hears, with the time that it takes after the first second.
struct Hearing {
    double quality = 1;
    int diffraction = 2;
    std::unique_ptr<AcousticEngine> engine = nullptr;
    SoundBuffer sound = {};
    double cpu = 0;
    HeardErrors errors = {};

    bool start() {
        AcousticOptions options;
        options.trace = AcousticOptions::heardTrace(quality);
        options.trace.diffractionOrder = diffraction;
        auto created = AcousticEngine::create(options);
        if (created) engine = std::move(*created);
        return created.has_value();
    }
    bool render(const SoundRoom& room, double time) {
        const double before = cpuSeconds();
        const bool done = engine->render(*room.tables->latest(), room.world->rays(), time, sound).has_value();
        if (time > 1) cpu += cpuSeconds() - before;
        return done;
    }
};

/// All hear together, while the source walks round and clicks; what the last one hears is taken for right.
bool hearRoom(SoundRoom& room, std::vector<Hearing>& all, int clicks) {
    for (Hearing& one : all)
        if (!one.start()) return false;
    const NodeId voice = room.scene.findName("Voice");
    const int frames = static_cast<int>(kFramesPerSecond) * (clicks + 1);
    for (int frame = 0; frame <= frames; ++frame) {
        const double time = frame / kFramesPerSecond, angle = kWalk / kCircle * time;
        const glm::dvec3 position = room.source + kCircle * glm::dvec3(std::cos(angle), 0, std::sin(angle));
        if (!room.scene.set(voice, x3d::Transform::translation, Vec3f(position))) return false;
        room.scene.newFrame(time);
        room.world->finishBackgroundWork();
        for (Hearing& one : all)
            if (!one.render(room, time)) return false;
    }
    for (int click = 1; click <= clicks; ++click) {
        const std::size_t begin = static_cast<std::size_t>(click) * kHeardRate;
        const ClickHeard right = clickOf(all.back().sound, begin);
        for (Hearing& one : all) one.errors.add(clickOf(one.sound, begin), right);
    }
    return true;
}

}  // namespace

bool chartHeard(const ChartSink& sink, bool quick) {
    const std::vector<double> qualities = quick ? std::vector<double>{.5, 2} : std::vector<double>{.25, .5, 1, 2, 4};
    const int clicks = quick ? 1 : 3;
    Chart chart{"heard-error",
                "What is heard: error against cost",
                "A source that walks round at 1 m/s in five rooms. Error: the larger one of levels by thirds of an "
                "octave in 20 ms, 125 Hz to 4 kHz, within 30 dB of the loudest, and C80; root mean square, in "
                "noticeable differences (1 dB), from 64 times the usual rays. Labels: --quality, 1 unless given.",
                {"CPU seconds a second of sound", true},
                {"error (noticeable differences)", true},
                {},
                {}};
    Series fewer{"one edge in a row", {}, false, true}, none{"no diffraction", {}, false, true};
    for (const auto& [name, make] : {std::pair{"box", +[] { return boxRoom(.5); }}, std::pair{"hall", &hallRoom},
                                     std::pair{"coupled rooms", &coupledRoom}, std::pair{"office", &officeRoom},
                                     std::pair{"corridor", &corridorRoom}}) {
        const std::unique_ptr<SoundRoom> room = make();
        if (!room) return false;
        std::vector<Hearing> all;
        for (const double quality : qualities) all.push_back({.quality = quality});
        for (const int order : {1, 0}) all.push_back({.quality = 1, .diffraction = order});
        all.push_back({.quality = 8});
        if (!hearRoom(*room, all, clicks)) return false;
        Series series{name, {}};
        const auto pointOf = [&](const Hearing& one, const std::string& label) {
            return ChartPoint{one.cpu / clicks, one.errors.largest(), label};
        };
        for (std::size_t k = 0; k < qualities.size(); ++k)
            series.points.push_back(pointOf(all[k], fmt::format("{:g}", qualities[k])));
        fewer.points.push_back(pointOf(all[qualities.size()], name));
        none.points.push_back(pointOf(all[qualities.size() + 1], name));
        chart.series.push_back(std::move(series));
        if (quick) break;
    }
    chart.series.push_back(std::move(fewer));
    chart.series.push_back(std::move(none));
    sink(chart);
    return true;
}

}  // namespace rtsg::bench
