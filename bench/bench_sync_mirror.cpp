// Mirrors over loopback: throughput, latency, joining, resuming, many peers.
#include "bench_sync_mirror.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include <sys/mman.h>
#include <unistd.h>
#include <zmq.h>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

#include "bench_sync_raw.h"
#include "followers_sync.h"
#include "moving.h"
#include "support/tcp_proxy.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Seconds to copy a scene without a mirror, one step after the other: snapshot, code, decode, apply. Sending the whole
/// scene each time would cost as much. Negative if the copy differs.
double mirrorCopySeconds(const Scene& scene) {
    const auto start = Clock::now();
    ByteBuffer record;
    ChangeEncoder().encode(scene.snapshot(), record);
    auto set = std::make_shared<ChangeSet>();
    ChangeDecoder decoder(builtinTypes());
    const auto decoded = decoder.decode({record.data(), record.size()}, *set);
    Scene copy;
    const bool good = decoded && copy.apply(set) && copy.hash() == scene.hash();
    return good ? secondsSince(start) : -1;
}

/// The time in which the system gives one thread so much memory filled with zeros, in large pages; the best of three.
double givingMemorySeconds(std::size_t bytes) {
    constexpr std::size_t kPage = 4096;
    double best = 1e9;
    for (int round = 0; round < 3; ++round) {
        const auto start = Clock::now();
        void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) return best;
        (void)::madvise(memory, bytes, MADV_HUGEPAGE);
        for (std::size_t at = 0; at < bytes; at += kPage) static_cast<volatile char*>(memory)[at] = 1;
        best = std::min(best, secondsSince(start));
        ::munmap(memory, bytes);
    }
    return best;
}

/// Polls `client` on this thread until it is where `target` says; false after 60 s.
bool pollTo(MirrorClient& client, std::uint64_t target) {
    const auto end = Clock::now() + 60s;
    while (client.statistics().sequence < target || !client.inStep()) {
        client.poll(1ms);
        if (Clock::now() > end) return false;
    }
    return true;
}

std::string ipcEndpoint() {
    return "ipc:///tmp/rtsg-bench-" + std::to_string(::getpid());
}

}  // namespace

bool mirrorThroughput(const SyncSizes& sizes, const Report& report) {
    Moving alone(sizes.transforms);
    const double copying = mirrorCopySeconds(alone.scene);
    if (copying < 0) return false;
    int frame = 0;
    double fastestAlone = 0, cpuAlone = 1e9;
    const auto changesAlone = [&] {  // a second, without anybody following
        const auto begin = Clock::now();
        const double cpuBegin = cpuSeconds();
        for (int i = 0; i < sizes.frames; ++i) alone.frame(++frame);
        cpuAlone = std::min(cpuAlone, (cpuSeconds() - cpuBegin) / sizes.frames);
        return double(sizes.transforms) * sizes.frames / secondsSince(begin);
    };
    for (const auto& [name, endpoint] :
         {std::pair("mirror tcp", std::string(kAnyPort)), std::pair("mirror ipc", ipcEndpoint())}) {
        Flow best;
        double raw = 0, cpu = 1e9;
        std::vector<double> fractions;  // of neighbouring measurements: the machine may be busy with other things
        for (int round = 0; round < 5; ++round) {
            const double before = changesAlone();
            const Flow now = flow(endpoint, sizes.transforms, sizes.frames, 1);
            if (!now.good) return false;
            const double after = changesAlone();
            fractions.push_back(now.changesPerSecond / ((before + after) / 2));
            fastestAlone = std::max({fastestAlone, before, after});
            cpu = std::min(cpu, now.cpuSeconds);
            if (now.changesPerSecond > best.changesPerSecond) best = now;
            raw = std::max(raw, rawThroughput(endpoint, static_cast<std::size_t>(now.bytesPerFrame), sizes.frames));
        }
        std::ranges::sort(fractions);
        report({"sync", name, "verified transforms", "1/s", best.changesPerSecond, "the whole scene copied each frame",
                sizes.transforms / copying, "raw ZeroMQ, same bytes", raw / best.bytesPerFrame * sizes.transforms});
        report({"sync", name, "the same as a share of the scene alone, median of pairs", "1",
                fractions[fractions.size() / 2], "asked for", .6, "nothing sent", 1});
        report({"sync", name, "CPU time of a frame, both ends", "us", cpu * 1e6, "", 0, "the scene alone",
                cpuAlone * 1e6});
    }
    report({"sync", "scene alone", "transforms", "1/s", fastestAlone, "", 0, "", 0});
    return true;
}

bool mirrorLatency(const SyncSizes& sizes, const Report& report) {
    Moving origin(1);
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    Follower follower((*server)->endpoint());
    if (!follower.waitFor(origin.scene.sequence())) return false;
    std::vector<double> times;
    for (int i = 1; i <= sizes.roundTrips; ++i) {
        const auto start = Clock::now();
        origin.frame(i);
        if (!follower.waitFor(origin.scene.sequence(), 10s)) return false;
        times.push_back(secondsSince(start) * 1e6);
    }
    if (follower.finish().divergences != 0) return false;
    std::ranges::sort(times);
    const std::vector<double> raw = rawLatency(100, sizes.roundTrips);
    report({"sync", "mirror tcp", "one change applied remotely, median", "us", times[times.size() / 2],
            "asked for: raw ZeroMQ, there and back", 2 * raw[raw.size() / 2], "raw ZeroMQ, one way",
            raw[raw.size() / 2]});
    report({"sync", "mirror tcp", "one change applied remotely, p99", "us", times[times.size() * 99 / 100], "", 0,
            "raw ZeroMQ, one way", raw[raw.size() * 99 / 100]});
    return true;
}

bool mirrorJoin(const SyncSizes& sizes, const Report& report) {
    const std::string size = std::to_string(sizes.joinNodes) + " nodes";
    Moving origin(sizes.joinNodes);
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    const auto begin = Clock::now();
    ByteBuffer record;
    ChangeEncoder().encode(origin.scene.snapshot(), record);
    const double taking = secondsSince(begin) * 1e3;
    const double raw = double(record.size()) / rawThroughput(kAnyPort, record.size(), 3, 1) * 1e3;
    double still = 1e9, taken = 0;
    for (int round = 0; round < 4; ++round) {
        const bool weighed = round == 3;  // after the others: it gives memory back that they may use again
        const double resident = weighed ? residentBytes() : 0;
        Scene replica;
        const auto start = Clock::now();
        auto client = MirrorClient::connect(replica, (*server)->endpoint());
        if (!client || !pollTo(**client, origin.scene.sequence()) || replica.hash() != origin.scene.hash())
            return false;
        if (!weighed) still = std::min(still, secondsSince(start) * 1e3);
        if (weighed) taken = residentBytes() - resident;
    }
    const double giving = givingMemorySeconds(static_cast<std::size_t>(taken)) * 1e3;
    const double copying = mirrorCopySeconds(origin.scene) * 1e3;
    if (copying < 0) return false;
    report({"sync", "late join", size, "ms", still, "copied without a mirror, step after step", copying,
            "raw ZeroMQ, same bytes", raw});
    report({"sync", "late join, memory", "as much as the replica takes, given out by the system alone", "ms", giving,
            "", 0, "", 0});

    // While the scene runs on: what its thread needs for a frame of a hundred changes, as nobody joins and as one does.
    int frame = 0;
    const auto step = [&] {
        ++frame;
        for (std::size_t i = 0; i < 100; ++i)
            (void)origin.scene.set(origin.nodes[(i * 7919 + std::size_t(frame)) % origin.nodes.size()],
                                   x3d::Transform::translation, Vec3f(float(frame), float(i), 0));
        const double start = threadSeconds();
        origin.scene.newFrame(frame);
        (*server)->service();
        return (threadSeconds() - start) * 1e3;
    };
    double alone = 0, joining = 0;
    for (int i = 0; i < 500; ++i) alone = std::max(alone, step());
    Follower follower((*server)->endpoint());
    const auto end = Clock::now() + 60s;
    const auto start = Clock::now();
    while (follower.reached() + 2 < origin.scene.sequence() && Clock::now() < end) {
        joining = std::max(joining, step());
        std::this_thread::sleep_for(1ms);
    }
    const double live = secondsSince(start) * 1e3;
    if (!follower.waitFor(origin.scene.sequence())) return false;
    report({"sync", "late join, live", size, "ms", live, "copied without a mirror, step after step", copying,
            "still scene", still});
    report({"sync", "late join, live", "longest frame of the scene's thread, CPU time", "ms", joining,
            "a snapshot taken there", taking, "nobody joins", alone});
    return (*server)->statistics().stalls == 0;
}

bool mirrorResume(const SyncSizes& sizes, const Report& report) {
    Moving origin(std::min(sizes.transforms, 1000));
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    test::TcpProxy proxy((*server)->endpoint());
    Follower follower(proxy.endpoint);
    if (!follower.waitFor(origin.scene.sequence())) return false;
    std::vector<double> times, rawTimes;
    const int rounds = std::max(3, sizes.roundTrips / 100);
    for (int i = 1; i <= rounds; ++i) {
        proxy.cut();
        for (int k = 0; k < 5; ++k) origin.frame(i * 5 + k);
        std::this_thread::sleep_for(50ms);
        const auto start = Clock::now();
        proxy.restore();
        if (!follower.waitFor(origin.scene.sequence())) return false;
        times.push_back(secondsSince(start) * 1e3);
    }
    const MirrorStatistics statistics = follower.finish();
    std::vector<double> anew;
    for (int i = 0; i < rounds; ++i) {
        const auto start = Clock::now();
        Follower fresh((*server)->endpoint());
        if (!fresh.waitFor(origin.scene.sequence())) return false;
        anew.push_back(secondsSince(start) * 1e3);
    }
    std::ranges::sort(anew);
    // Raw: from the link's return to the first message, with the same interval between attempts.
    void* context = zmq_ctx_new();
    void *router = zmq_socket(context, ZMQ_ROUTER), *dealer = zmq_socket(context, ZMQ_DEALER);
    const int interval = 10, on = 1, none = 0;
    zmq_setsockopt(dealer, ZMQ_RECONNECT_IVL, &interval, sizeof(interval));
    zmq_setsockopt(dealer, ZMQ_IMMEDIATE, &on, sizeof(on));
    for (void* socket : {router, dealer}) zmq_setsockopt(socket, ZMQ_LINGER, &none, sizeof(none));
    zmq_bind(router, kAnyPort);
    char bound[256];
    std::size_t length = sizeof(bound);
    zmq_getsockopt(router, ZMQ_LAST_ENDPOINT, bound, &length);
    {
        test::TcpProxy rawProxy(bound);
        zmq_connect(dealer, rawProxy.endpoint.c_str());
        for (int i = 0; i < rounds; ++i) {
            rawProxy.cut();
            std::this_thread::sleep_for(50ms);
            char text[64];
            while (zmq_recv(router, text, sizeof(text), ZMQ_DONTWAIT) >= 0) continue;
            const auto start = Clock::now();
            rawProxy.restore();
            while (zmq_send(dealer, "x", 1, ZMQ_DONTWAIT) < 0) std::this_thread::sleep_for(100us);
            zmq_recv(router, text, sizeof(text), 0);
            zmq_recv(router, text, sizeof(text), 0);
            rawTimes.push_back(secondsSince(start) * 1e3);
        }
    }
    for (void* socket : {router, dealer}) zmq_close(socket);
    zmq_ctx_term(context);
    std::ranges::sort(times);
    std::ranges::sort(rawTimes);
    report({"sync", "resume", "after the link's return, median", "ms", times[times.size() / 2],
            "joining anew where the link is up, median", anew[anew.size() / 2], "raw ZeroMQ, first message",
            rawTimes[rawTimes.size() / 2]});
    return statistics.snapshots == 1 && statistics.divergences == 0;
}

bool chartMirror(const ChartSink& sink, bool quick) {
    Chart peers{.name = "sync-replicas",
                .title = "Replicas against throughput",
                .note =
                    "1,000 transforms a frame over loopback TCP, every replica's hash compared in every frame, all on "
                    "one machine",
                .x = {.label = "replicas", .logarithmic = true},
                .y = {.label = "changes applied by all replicas (1/s)"},
                .series = {{.name = "mirror", .points = {}}},
                .rows = {}};
    SyncSizes sizes;
    for (const int count : {1, 2, 4, 8, 16, 32, 64}) {
        if (quick && count > 8) break;
        const Flow f = flow(kAnyPort, 1000, quick ? 50 : 200, count);
        if (!f.good) return false;
        peers.series[0].points.push_back({double(count), f.changesPerSecond * count, ""});
    }
    sink(peers);
    Chart joins{.name = "sync-late-join",
                .title = "Late join against the size of the scene",
                .note = "from connect() to a replica with the origin's hash, over loopback TCP",
                .x = {.label = "nodes", .logarithmic = true},
                .y = {.label = "time (ms)", .logarithmic = true},
                .series = {{.name = "late join", .points = {}},
                           {.name = "raw ZeroMQ, same bytes", .points = {}, .reference = true}},
                .rows = {}};
    for (int nodes = 1000; nodes <= (quick ? 10000 : 1000000); nodes *= 10) {
        SyncSizes one;
        one.joinNodes = nodes;
        bool good = mirrorJoin(one, [&](const Line& line) {
            if (line.name != "late join") return;
            joins.series[0].points.push_back({double(nodes), line.value, ""});
            joins.series[1].points.push_back({double(nodes), line.limit, ""});
        });
        if (!good) return false;
    }
    sink(joins);
    return true;
}

}  // namespace rtsg::bench
