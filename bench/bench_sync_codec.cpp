// The cost of a changed transform, in bytes and in time, for every coding and mode, beside general compressors.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>

#include <fmt/format.h>
#ifdef RTSG_HAS_LZ4
#include <lz4.h>
#endif
#include <zstd.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/lossy_scene.h>

#include "bench_sync.h"
#include "motion_sync.h"

namespace rtsg::bench {

namespace {

constexpr std::size_t kTransformBytes = 28;  // 3 + 4 f32
constexpr int kWarmUp = 4;                   // frames until everything has a history

/// Frames of one kind of motion, and the same as a flat array of transforms for those who know no fields.
struct Input {
    std::vector<ChangeSet> sets;
    std::vector<std::vector<float>> flat;  // all bodies, moved or not
    std::uint64_t transforms = 0;          // that moved, after the warm-up
    std::uint64_t changes = 0;
};

Input inputOf(Movement movement, int bodies, int frames) {
    Input input;
    Motion motion(movement, static_cast<std::size_t>(bodies));
    std::vector<float> now(static_cast<std::size_t>(bodies) * 7);
    for (int f = 0; f < frames; ++f) {
        ChangeSet set = motion.next();
        std::uint32_t last = 0;
        for (const Change& change : set.changes) {
            float* at = &now[(change.node.value - Motion::kFirstNode) / 3 * std::size_t{7}];
            if (change.value.holds<Vec3f>())
                std::memcpy(at, change.value.storage(), 12);
            else
                std::memcpy(at + 3, change.value.storage(), 16);
            if (f >= kWarmUp && change.node.value != last) ++input.transforms;
            last = change.node.value;
        }
        if (f >= kWarmUp) input.changes += set.changes.size();
        input.sets.push_back(std::move(set));
        input.flat.push_back(now);
    }
    return input;
}

struct Cost {
    double bytes = 0;               // per changed transform
    double encode = 0, decode = 0;  // ns per changed transform
};

double ns(double seconds, std::uint64_t count) {
    return seconds * 1e9 / static_cast<double>(count);
}

/// Empty sets on an error.
Cost measureCodec(const std::vector<ChangeSet>& sets, const StreamMode& mode, std::uint64_t transforms, bool& good) {
    ChangeEncoder encoder(mode);
    ChangeDecoder decoder(builtinTypes());
    ByteBuffer record;
    ChangeSet decoded;
    Cost cost;
    double encode = 0, decode = 0;
    for (std::size_t f = 0; f < sets.size(); ++f) {
        const double start = cpuSeconds();
        encoder.encode(sets[f], record);
        const double middle = cpuSeconds();
        good = good && decoder.decode(record.bytes(), decoded) && decoded.changes.size() == sets[f].changes.size();
        if (f < kWarmUp) continue;
        decode += cpuSeconds() - middle;
        encode += middle - start;
        cost.bytes += static_cast<double>(record.size());
    }
    return {cost.bytes / static_cast<double>(transforms), ns(encode, transforms), ns(decode, transforms)};
}

/// The sets that a lossy scene publishes for these.
class Collector : public Subscriber {
  public:
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        sets.push_back(changes);
        return {};
    }
    std::vector<ChangeSet> sets;
};
std::vector<ChangeSet> lossySets(const Input& input, int bodies, double error, bool& good) {
    Scene scene;
    std::vector<NodeId> nodes;
    for (int i = 0; i < bodies; ++i) nodes.push_back(scene.createNode(x3d::Transform::type));
    Array<NodeId> children;
    for (const NodeId node : nodes) children.push_back(node);
    good = good && scene.setField(scene.root(), x3d::RtsgScene::children.index, children);
    scene.newFrame(0);
    auto lossy = LossyScene::follow(scene, error);
    if (!lossy) {
        good = false;
        return {};
    }
    Collector collector;
    Attachment attachment = (*lossy)->scene().bus().attach(collector);
    collector.sets.clear();
    double t = 0;
    for (const ChangeSet& set : input.sets) {
        for (const Change& change : set.changes)
            (void)scene.setField(nodes[(change.node.value - Motion::kFirstNode) / 3], change.field, change.value);
        scene.newFrame(t += 1. / 60);
    }
    good = good && collector.sets.size() == input.sets.size();
    return std::move(collector.sets);
}

/// A general compressor over a frame's bytes; `delta`: xor with the frame before, split into byte planes, as published.
template <class Compress, class Decompress>
Cost measureGeneral(const Input& input, bool delta, Compress&& compress, Decompress&& decompress) {
    const std::size_t size = input.flat[0].size() * sizeof(float), words = input.flat[0].size();
    std::vector<char> plain(size), packed(2 * size + ZSTD_compressBound(size)), back(size);
    double bytes = 0, encode = 0, decode = 0;
    std::vector<std::uint32_t> x(words);
    for (std::size_t f = kWarmUp; f < input.flat.size(); ++f) {
        const double start = cpuSeconds();
        if (delta) {
            for (std::size_t i = 0; i < words; ++i)
                x[i] =
                    std::bit_cast<std::uint32_t>(input.flat[f][i]) ^ std::bit_cast<std::uint32_t>(input.flat[f - 1][i]);
            for (std::size_t p = 0; p < 4; ++p)
                for (std::size_t c = 0, at = p * words; c < 7; ++c)
                    for (std::size_t i = c; i < words; i += 7) plain[at++] = static_cast<char>(x[i] >> (8 * p));
        } else {
            std::memcpy(plain.data(), input.flat[f].data(), size);
        }
        const std::size_t length = compress(plain, packed);
        const double middle = cpuSeconds();
        decompress(packed, length, back);
        if (delta) {
            for (std::size_t i = 0; i < words; ++i) x[i] = 0;
            for (std::size_t p = 0; p < 4; ++p)
                for (std::size_t c = 0, at = p * words; c < 7; ++c)
                    for (std::size_t i = c; i < words; i += 7)
                        x[i] |= std::uint32_t{static_cast<unsigned char>(back[at++])} << (8 * p);
        }
        keep(x[0]);
        decode += cpuSeconds() - middle;
        encode += middle - start;
        bytes += static_cast<double>(length);
    }
    return {bytes / static_cast<double>(input.transforms), ns(encode, input.transforms), ns(decode, input.transforms)};
}

struct General {
    const char* name;
    Cost cost;
};
std::vector<General> generals(const Input& input) {
    const auto copy = [](const std::vector<char>& from, std::vector<char>& to) {
        std::memcpy(to.data(), from.data(), from.size());
        return from.size();
    };
    const auto copyBack = [](const std::vector<char>& from, std::size_t length, std::vector<char>& to) {
        std::memcpy(to.data(), from.data(), length);
    };
    const auto zstd = [](const std::vector<char>& from, std::vector<char>& to) {
        return ZSTD_compress(to.data(), to.size(), from.data(), from.size(), 1);
    };
    const auto zstdBack = [](const std::vector<char>& from, std::size_t length, std::vector<char>& to) {
        ZSTD_decompress(to.data(), to.size(), from.data(), length);
    };
    std::vector<General> all{{"memcpy", measureGeneral(input, false, copy, copyBack)},
                             {"zstd -1", measureGeneral(input, false, zstd, zstdBack)},
                             {"xor, byte planes, zstd -1", measureGeneral(input, true, zstd, zstdBack)}};
#ifdef RTSG_HAS_LZ4
    const auto lz4 = [](const std::vector<char>& from, std::vector<char>& to) {
        return static_cast<std::size_t>(
            LZ4_compress_default(from.data(), to.data(), static_cast<int>(from.size()), static_cast<int>(to.size())));
    };
    const auto lz4Back = [](const std::vector<char>& from, std::size_t length, std::vector<char>& to) {
        LZ4_decompress_safe(from.data(), to.data(), static_cast<int>(length), static_cast<int>(to.size()));
    };
    all.insert(all.begin() + 1, {{"lz4", measureGeneral(input, false, lz4, lz4Back)},
                                 {"xor, byte planes, lz4", measureGeneral(input, true, lz4, lz4Back)}});
#endif
    return all;
}

/// Bytes a transform takes if what differs from the nearest fixed extrapolation of each component is coded by its own
/// frequencies: how many bits it has by entropy, these bits and the sign as they are. `step`: of a grid, 0 for bits of
/// floats.
double entropy(const Input& input, double error) {
    std::map<int, double> counts[7][3];
    double plain[7][3] = {};
    double total = 0;
    const auto number = [&](std::size_t f, std::size_t i, std::size_t c) -> double {
        const float* at = &input.flat[f][i * 7];
        if (error > 0) {
            const double step = 2 * error / std::sqrt(3.) * (1 - 1. / 1024);
            return c < 3 ? std::nearbyint(double(at[c]) / step) : std::nearbyint(double(at[c]) * double(at[6]) / step);
        }
        const auto bits = std::bit_cast<std::int32_t>(at[c]);
        return bits ^ (bits >> 31 & 0x7FFFFFFF);
    };
    const std::size_t lanes = error > 0 ? 6 : 7;
    for (std::size_t f = kWarmUp; f < input.flat.size(); ++f)
        for (std::size_t i = 0; i < input.flat[f].size() / 7; ++i) {
            if (std::memcmp(&input.flat[f][i * 7], &input.flat[f - 1][i * 7], kTransformBytes) == 0) continue;
            ++total;
            for (std::size_t c = 0; c < lanes; ++c) {
                const double x = number(f, i, c), p = number(f - 1, i, c), q = number(f - 2, i, c),
                             r = number(f - 3, i, c);
                const double misses[] = {x - p, x - 2 * p + q, x - 3 * (p - q) - r};
                for (int o = 0; o < 3; ++o) {
                    const int bits = misses[o] == 0 ? 0 : std::ilogb(std::abs(misses[o])) + 1;
                    ++counts[c][o][bits];
                    plain[c][o] += bits;  // the sign, and all bits but the highest
                }
            }
        }
    double sum = 0;
    for (std::size_t c = 0; c < lanes; ++c) {
        double best = 1e300;
        for (int o = 0; o < 3; ++o) {
            double bits = plain[c][o];
            for (const auto& [size, n] : counts[c][o]) bits -= n * std::log2(n / total);
            best = std::min(best, bits);
        }
        sum += best;
    }
    return sum / 8 / total;
}

struct Variant {
    StreamMode mode;
    std::string name;
};
std::vector<Variant> variants(bool lossy) {
    if (!lossy)
        return {{{Mode::state, Coding::raw, 0}, "raw"},
                {{Mode::state, Coding::compact, 0}, "compact"},
                {{Mode::state, Coding::smallest, 0}, "smallest"}};
    std::vector<Variant> result;
    for (const double error : {1e-2, 1e-3, 1e-4})
        for (const Coding coding : {Coding::compact, Coding::smallest})
            result.push_back({{Mode::lossy, coding, error}, fmt::format("lossy {:g} {}", error, nameOf(coding))});
    return result;
}

}  // namespace

bool codec(const SyncSizes& sizes, const Report& report) {
    bool good = true;
    const int bodies = sizes.transforms, frames = std::clamp(400000 / sizes.transforms, 24, 120);
    for (const Movement movement : {Movement::smooth, Movement::chaotic, Movement::mixed}) {
        const std::string motion(kMovementNames[static_cast<std::size_t>(movement)]);
        const Input input = inputOf(movement, bodies, frames);
        const std::vector<General> others = generals(input);
        const Cost &copying = others[0].cost, &published = others.back().cost;
        for (const General& other : others) {
            const std::string name = motion + ", " + other.name;
            report({"codec", name, "size of a changed transform", "bytes", other.cost.bytes, "raw", kTransformBytes, "",
                    0});
            report({"codec", name, "time to encode it", "ns", other.cost.encode, "memcpy", copying.encode, "", 0});
            report({"codec", name, "time to decode it", "ns", other.cost.decode, "memcpy", copying.decode, "", 0});
        }
        const auto line = [&](const Variant& v, const Cost& cost, double bound) {
            const std::string name = motion + ", " + v.name;
            report({"codec", name, "size of a changed transform", "bytes", cost.bytes,
                    published.bytes > 0 ? others.back().name : "", published.bytes,
                    "entropy of one fixed extrapolation", bound});
            report({"codec", name, "time to encode it", "ns", cost.encode, others.back().name, published.encode,
                    "memcpy", copying.encode});
            report({"codec", name, "time to decode it", "ns", cost.decode, others.back().name, published.decode,
                    "memcpy", copying.decode});
            report({"codec", name, "raw values encoded", "MB/s", kTransformBytes * 1e3 / cost.encode,
                    others.back().name, kTransformBytes * 1e3 / published.encode, "memcpy",
                    kTransformBytes * 1e3 / copying.encode});
        };
        const double lossless = entropy(input, 0);
        for (const Variant& v : variants(false))
            line(v, measureCodec(input.sets, v.mode, input.transforms, good), lossless);
        double error = 0, bound = 0;
        std::vector<ChangeSet> sets;
        for (const Variant& v : variants(true)) {
            if (v.mode.maxError != error) {
                error = v.mode.maxError;
                sets = lossySets(input, bodies, error, good);
                bound = entropy(input, error);
            }
            line(v, measureCodec(sets, v.mode, input.transforms, good), bound);
        }
    }
    return good;
}

bool chartCodec(const ChartSink& sink, bool quick) {
    bool good = true;
    const int bodies = quick ? 500 : 3000, frames = quick ? 40 : 100;
    Chart size{
        "sync-codec-error",
        "Bytes of a changed transform against the error allowed",
        fmt::format("{} bodies, 60 frames a second; dashed: lossless, published method (xor, byte planes, zstd -1)",
                    bodies),
        {"largest error (m, rad)", true, false},
        {"bytes per changed transform", false, true},
        {},
        {}};
    Chart time{"sync-codec-time",
               "Bytes of a changed transform against the time to encode and decode it",
               fmt::format("{} bodies, 60 frames a second, CPU time of one core", bodies),
               {"encode + decode (ns per changed transform)", true, false},
               {"bytes per changed transform", false, true},
               {},
               {}};
    for (const Movement movement : {Movement::smooth, Movement::chaotic, Movement::mixed}) {
        const std::string motion(kMovementNames[static_cast<std::size_t>(movement)]);
        const Input input = inputOf(movement, bodies, frames);
        Series points{motion, {}, false, true}, other{motion + ", general compressors", {}, true, true};
        const std::vector<General> known = generals(input);
        for (const General& g : known)
            other.points.push_back(
                {g.cost.encode + g.cost.decode, g.cost.bytes, movement == Movement::smooth ? g.name : ""});
        double lossless = 0;
        for (const Variant& v : variants(false)) {
            const Cost cost = measureCodec(input.sets, v.mode, input.transforms, good);
            points.points.push_back({cost.encode + cost.decode, cost.bytes, v.name});
            lossless = cost.bytes;
        }
        Series limit{motion + ", lossless smallest", {}, true};
        Series published{motion + ", published lossless", {}, true};
        for (const Coding coding : {Coding::compact, Coding::smallest}) {
            Series line{fmt::format("{}, lossy {}", motion, nameOf(coding)), {}};
            for (const double error : {1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5}) {
                const std::vector<ChangeSet> sets = lossySets(input, bodies, error, good);
                const Cost cost = measureCodec(sets, {Mode::lossy, coding, error}, input.transforms, good);
                line.points.push_back({error, cost.bytes, ""});
                if (error == 1e-3)
                    points.points.push_back(
                        {cost.encode + cost.decode, cost.bytes, fmt::format("lossy 1e-3 {}", nameOf(coding))});
            }
            size.series.push_back(std::move(line));
        }
        for (const double error : {1e-5, 1e-1}) {
            limit.points.push_back({error, lossless, ""});
            published.points.push_back({error, known.back().cost.bytes, ""});
        }
        size.series.push_back(std::move(limit));
        size.series.push_back(std::move(published));
        time.series.push_back(std::move(points));
        time.series.push_back(std::move(other));
    }
    sink(size);
    sink(time);
    return good;
}

}  // namespace rtsg::bench
