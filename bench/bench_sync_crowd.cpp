// Many mirrors of one scene: what flows, how late it is, how long they take to come in.
#include <algorithm>
#include <memory>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/sync/mirror_server.h>

#include "bench_sync_mirror.h"
#include "bench_sync_raw.h"
#include "followers_sync.h"
#include "moving.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;

constexpr int kTransforms = 1050;  // whose moves are a frame of 13 kB
constexpr int kOneAtATime = 60;    // frames whose delay is measured,
constexpr int kBefore = 5;         // and before them
constexpr double kHertz = 60;

double quantileOf(const std::vector<double>& sorted, double q) {
    return sorted[static_cast<std::size_t>(q * double(sorted.size() - 1))];
}

/// From newFrame() to each replica's verified state, one frame at a time.
struct Crowd : Delays {
    double joining = 0, bytesPerFrame = 0;
};
Crowd crowdOf(int peers) {
    Crowd result;
    Moving origin(kTransforms);
    MirrorServerOptions options;
    options.maximumPeers = static_cast<std::size_t>(peers);
    options.peerTimeout = 60s;
    auto server = MirrorServer::start(origin.scene, kAnyPort, options);
    if (!server) return {};
    const double start = wallSeconds();
    std::vector<std::unique_ptr<Follower>> all;
    for (int i = 0; i < peers; ++i) all.push_back(std::make_unique<Follower>((*server)->endpoint()));
    // Who waits leaves the cores to those who work.
    const auto arrived = [&](std::uint64_t state) {
        const double until = wallSeconds() + 60;
        for (const auto& f : all)
            while (f->reached() < state) {
                if (wallSeconds() > until) return false;
                std::this_thread::sleep_for(1ms);
            }
        return true;
    };
    if (!arrived(origin.scene.sequence())) return {};
    result.joining = wallSeconds() - start;
    // Warm the sockets up, as those of a PUB socket are: steady operation is measured.
    for (int i = 1; i <= kBefore; ++i) {
        origin.frame(i);
        if (!arrived(origin.scene.sequence())) return {};
    }
    std::this_thread::sleep_for(500ms);
    const std::uint64_t before = (*server)->statistics().bytes;
    const double cpuBefore = cpuSeconds();
    for (int i = 1; i <= kOneAtATime; ++i) {
        const std::int64_t created = std::chrono::steady_clock::now().time_since_epoch().count();
        origin.frame(kBefore + i);
        if (!arrived(origin.scene.sequence())) return {};
        for (const auto& f : all) result.seconds.push_back(static_cast<double>(f->reachedAt() - created) * 1e-9);
    }
    result.cpuSeconds = (cpuSeconds() - cpuBefore) / kOneAtATime / peers;
    result.bytesPerFrame = double((*server)->statistics().bytes - before) / kOneAtATime / peers;
    for (const auto& f : all) f->stop();
    for (const auto& f : all)
        if (f->finish().divergences != 0) return {};
    std::ranges::sort(result.seconds);
    return result;
}

}  // namespace

bool mirrorPeers(const SyncSizes& sizes, const Report& report) {
    const int transforms = std::max(100, sizes.transforms / 10), frames = std::max(20, sizes.frames / 2);
    const int stopped = sizes.peers / 4, running = sizes.peers - stopped;
    double best = 0, hindered = 0;
    for (int round = 0; round < 3; ++round) {
        MirrorClientOptions clients;
        clients.window = std::uint64_t{256} << 10;
        const Flow all = flow(kAnyPort, transforms, frames, running, 0, clients);
        const Flow some = flow(kAnyPort, transforms, frames, running, stopped, clients);
        if (!all.good || !some.good) return false;
        best = std::max(best, all.framesPerSecond);
        hindered = std::max(hindered, some.framesPerSecond);
    }
    const std::string name = std::to_string(running) + " peers";
    report({"sync", name, "frames of " + std::to_string(transforms) + " transforms", "1/s", best, "", 0, "", 0});
    report({"sync", name + " and " + std::to_string(stopped) + " stopped", "frames, as a share of without those", "%",
            100 * hindered / best, "if those stopped cost as much as the others", 100. * running / sizes.peers,
            "nothing lost", 100});
    return true;
}

bool mirrorCrowd(const SyncSizes& sizes, const Report& report) {
    const int some = sizes.peers * 4, many = sizes.peers * 16;
    const Flow flowing = flow(kAnyPort, kTransforms, std::max(20, sizes.frames / 2), some);
    if (!flowing.good) return false;
    report({"sync", fmt::format("{} peers", some), "frames of 13 kB made, some merged", "1/s", flowing.framesPerSecond,
            "", 0, "", 0});
    const Paced film = paced(kTransforms, kHertz, std::max(60, sizes.frames), some);
    if (!film.good) return false;
    report({"sync", fmt::format("{} peers at 60 Hz", some), "frames of 13 kB that each gets", "1/s",
            film.framesPerSecond, "", 0, "asked for of 256", kHertz});
    const Delays alone = rawPublishing(static_cast<std::size_t>(film.bytesPerFrame), some, kOneAtATime);
    if (alone.seconds.empty()) return false;
    report({"sync", fmt::format("{} peers at 60 Hz", some), "a frame's CPU time for each, both ends", "us",
            1e6 * film.cpuSeconds, "what the cores have for each",
            1e6 * std::thread::hardware_concurrency() / kHertz / some, "bare PUB, same bytes", 1e6 * alone.cpuSeconds});
    const Crowd crowd = crowdOf(many);
    if (crowd.seconds.empty()) return false;
    const Delays bare = rawPublishing(static_cast<std::size_t>(crowd.bytesPerFrame), many, kOneAtATime);
    if (bare.seconds.empty()) return false;
    const std::string name = fmt::format("{} peers", many);
    report({"sync", name, "a frame's delay, median", "ms", 1e3 * quantileOf(crowd.seconds, .5), "", 0,
            "bare PUB, same bytes", 1e3 * quantileOf(bare.seconds, .5)});
    report({"sync", name, "a frame's delay, p99", "ms", 1e3 * quantileOf(crowd.seconds, .99), "", 0,
            "bare PUB, same bytes", 1e3 * quantileOf(bare.seconds, .99)});
    report({"sync", name, "a frame's CPU time for each, both ends", "us", 1e6 * crowd.cpuSeconds, "", 0,
            "bare PUB, same bytes", 1e6 * bare.cpuSeconds});
    report({"sync", name, "all have joined", "s", crowd.joining, "asked for of 1,000", 2, "", 0});
    return true;
}

}  // namespace rtsg::bench
