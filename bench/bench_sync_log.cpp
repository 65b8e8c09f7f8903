// The log: written, scanned, replayed, sought in, and what it costs the scene's thread.
#include "bench_sync.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/replay.h>

#include "moving.h"

namespace rtsg::bench {

namespace {

struct TemporaryLog {
    std::filesystem::path path;
    explicit TemporaryLog(const char* name)
        : path(std::filesystem::temp_directory_path() / ("rtsg-bench-" + std::to_string(::getpid()) + "-" + name)) {}
    ~TemporaryLog() {
        std::error_code ignored;
        std::filesystem::remove(path, ignored);
    }
};

/// CPU seconds of the fastest of three.
template <class Work>
double fastest(const Work& work) {
    double best = 1e30;
    for (int i = 0; i < 3; ++i) {
        const double start = cpuSeconds();
        work();
        best = std::min(best, cpuSeconds() - start);
    }
    return best;
}

bool logWriting(const SyncSizes& sizes, const std::filesystem::path& file, const Report& report) {
    ChangeSet set = animatedSet(sizes.transforms);
    std::uint64_t bytes = 0;
    bool ok = true;
    const double seconds = fastest([&] {
        auto log = LogWriter::create(file, builtinTypes());
        for (int i = 1; log && i <= sizes.frames; ++i) {
            set.from = static_cast<std::uint64_t>(i);
            set.to = set.from + 1;
            ok = ok && (*log)->write(set);
        }
        ok = ok && log && (*log)->close();
        bytes = ok ? (*log)->bytes() : 1;
    });
    const TemporaryLog raw("raw");
    const std::vector<char> block(bytes / static_cast<std::uint64_t>(sizes.frames), 'x');
    const auto rawWrite = [&](std::size_t piece) {
        return fastest([&] {
            const int descriptor = ::open(raw.path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            for (int i = 0; i < sizes.frames; ++i)
                for (std::size_t at = 0; at < block.size(); at += piece)
                    ok = ok && ::write(descriptor, block.data() + at, std::min(piece, block.size() - at)) > 0;
            ::close(descriptor);
        });
    };
    const double mega = double(bytes) / 1e6;
    report({"log", "written with checksums", "bytes a second", "MB/s", mega / seconds, "write() of every transform",
            mega / rawWrite(block.size() / static_cast<std::size_t>(sizes.transforms)), "write() of the same frames",
            mega / rawWrite(block.size())});
    return ok;
}

bool scanning(const std::filesystem::path& file, const Report& report) {
    std::uint64_t records = 0;
    const double mega = double(std::filesystem::file_size(file)) / 1e6;
    const double seconds = fastest([&] {
        auto log = LogReader::open(file);
        while (log && log->next()) ++records;
    });
    std::vector<unsigned char> part(1 << 20);
    const auto reading = [&](bool check) {
        return fastest([&] {
            const int descriptor = ::open(file.c_str(), O_RDONLY);
            unsigned long sum = 0;
            for (ssize_t got = 0; (got = ::read(descriptor, part.data(), part.size())) > 0;)
                if (check) sum = ::crc32_z(sum, part.data(), static_cast<std::size_t>(got));
            keep(sum);
            ::close(descriptor);
        });
    };
    report({"log", "scanned with checksums", "bytes a second", "MB/s", mega / seconds, "read() and zlib's CRC-32",
            mega / reading(true), "read() alone", mega / reading(false)});
    return records > 0;
}

bool replaying(const SyncSizes& sizes, const Report& report) {
    const TemporaryLog file("replay.rlog");
    Moving origin(sizes.transforms);
    double running = 0;
    {
        auto log = LogWriter::create(file.path, builtinTypes());
        if (!log) return false;
        Attachment attachment = origin.scene.bus().attach(**log);
        for (int i = 1; i <= sizes.frames; ++i) origin.frame(i);
    }
    {
        Moving again(sizes.transforms);
        const double start = cpuSeconds();
        for (int i = 1; i <= sizes.frames; ++i) again.frame(i);
        running = cpuSeconds() - start;
    }
    std::uint64_t frames = 0;
    bool verified = true;
    const double seconds = fastest([&] {
        auto replayer = Replayer::open(file.path);
        Result<bool> more = replayer.has_value();
        while (more && *more) more = (*replayer)->step();
        frames = (*replayer)->frames();
        verified = verified && frames > 0 && frames == (*replayer)->verified();
    });
    const double decoding = fastest([&] {
        auto log = LogReader::open(file.path);
        ChangeDecoder decoder(builtinTypes());
        ChangeSet set;
        while (const auto record = log->next())
            if (record->header.kind == RecordKind::frame) verified = verified && decoder.decode(record->bytes, set);
    });
    const double rate = double(frames) / seconds;
    const std::string name = "replay of " + std::to_string(sizes.transforms) + " changes a frame";
    report({"log", name, "verified states a second", "1/s", rate, "running the scene", double(sizes.frames) / running,
            "decoding alone", double(frames) / decoding});
    report({"log", name, "times real time at 60 Hz", "1", rate / 60, "running the scene",
            double(sizes.frames) / running / 60, "decoding alone", double(frames) / decoding / 60});
    return verified;
}

/// An hour at 60 Hz, ten and a hundred changes a frame.
bool seeking(const SyncSizes& sizes, int changes, const Report& report) {
    const TemporaryLog file("seek.rlog");
    const double length = sizes.hourFrames / 60.;
    {
        Moving origin(1000);
        auto log = LogWriter::create(file.path, builtinTypes());
        if (!log) return false;
        Attachment attachment = origin.scene.bus().attach(**log);
        for (int i = 1; i <= sizes.hourFrames; ++i)
            origin.frame(i / 60., static_cast<std::size_t>(i * changes), static_cast<std::size_t>(changes));
    }
    auto replayer = Replayer::open(file.path);
    if (!replayer) return false;
    std::mt19937_64 random(1);
    std::vector<double> times;
    for (int i = 0; i < 200; ++i) {
        const double target = length * double(random() % 1000000) * 1e-6, start = cpuSeconds();
        if (!(*replayer)->seek(target)) return false;
        times.push_back((cpuSeconds() - start) * 1e3);
        if (std::abs((*replayer)->scene().now() - target) > 1.01 / 60) return false;
    }
    std::ranges::sort(times);
    // Without keyframes one would have to play from the start: half the log on average.
    auto whole = Replayer::open(file.path);
    const int part = std::min(sizes.hourFrames, 20000);
    const double begin = cpuSeconds();
    for (int i = 0; i < part; ++i)
        if (!(*whole)->step()) return false;
    const double fromStart = (cpuSeconds() - begin) * 1e3 / part * sizes.hourFrames / 2;
    // At least a keyframe has to be taken: from far away each time.
    double keyframe = 1e30;
    for (const LogKeyframe& k : (*replayer)->keyframes()) {
        if (!(*replayer)->seek(k.time < length / 2 ? length : 0)) return false;
        const double start = cpuSeconds();
        if (!(*replayer)->seek(k.time)) return false;
        keyframe = std::min(keyframe, (cpuSeconds() - start) * 1e3);
    }
    const std::string name = "seek in " + std::to_string(sizes.hourFrames) + " frames of " + std::to_string(changes);
    report({"log", name, "worst of 200", "ms", times.back(), "playing from the start", fromStart, "a keyframe alone",
            keyframe});
    report({"log", name, "median", "ms", times[times.size() / 2], "playing from the start", fromStart,
            "a keyframe alone", keyframe});
    return (*replayer)->frames() == (*replayer)->verified();
}

/// The cost of recording for the scene's thread: CPU time of its own frames.
bool recording(const SyncSizes& sizes, const Report& report) {
    const TemporaryLog file("record.rlog");
    double worst[3] = {}, mean[3] = {};
    for (int mode = 0; mode < 3; ++mode) {
        Moving origin(sizes.transforms);
        std::unique_ptr<LogWriter> writer;
        std::unique_ptr<LogRecorder> recorder;
        Attachment attachment;
        LogOptions options;
        options.keyframeBytes = 1 << 18;
        if (mode == 1) {
            auto log = LogWriter::create(file.path, builtinTypes(), options);
            if (!log) return false;
            writer = std::move(*log);
            attachment = origin.scene.bus().attach(*writer);
        } else if (mode == 2) {
            auto log = LogRecorder::start(origin.scene, file.path, options);
            if (!log) return false;
            recorder = std::move(*log);
        }
        const int frames = std::min(sizes.frames, 200);
        for (int i = 1; i <= frames; ++i) {
            const double start = threadSeconds();
            origin.frame(i);
            const double time = (threadSeconds() - start) * 1e6;
            worst[mode] = std::max(worst[mode], time);
            mean[mode] += time / frames;
            if (recorder && !recorder->waitFor(origin.scene.sequence(), std::chrono::seconds(60))) return false;
        }
    }
    report({"log", "scene's thread", "a frame with LogRecorder, mean", "us", mean[2], "with LogWriter", mean[1],
            "without a log", mean[0]});
    report({"log", "scene's thread", "a frame with LogRecorder, worst", "us", worst[2], "with LogWriter", worst[1],
            "without a log", worst[0]});
    return true;
}

}  // namespace

bool log(const SyncSizes& sizes, const Report& report) {
    const TemporaryLog file("a.rlog");
    bool ok = logWriting(sizes, file.path, report) && scanning(file.path, report);
    ok = replaying(sizes, report) && ok;
    for (const int changes : {10, 100}) ok = seeking(sizes, changes, report) && ok;
    return recording(sizes, report) && ok;
}

}  // namespace rtsg::bench
