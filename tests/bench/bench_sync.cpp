#include "bench_sync.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <unistd.h>
#include <zmq.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/replay.h>

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
constexpr const char* kAnyPort = "tcp://127.0.0.1:*";

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Translation and rotation of `transforms` nodes, chaotic enough that nothing repeats.
ChangeSet animatedSet(int transforms) {
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    for (int i = 0; i < transforms; ++i) {
        Change change;
        change.node = NodeId{static_cast<std::uint32_t>(100 + 3 * i)};
        change.field = x3d::Transform::translation.index;
        change.value = Vec3f(float(i), float(i % 17), 1);
        set.changes.push_back(change);
        change.field = x3d::Transform::rotation.index;
        change.value = Rotation{0, 1, 0, float(i) * .01f};
        set.changes.push_back(change);
    }
    return set;
}

/// A scene whose transforms all move in every frame.
struct Moving {
    Scene scene;
    std::vector<NodeId> nodes;
    float phase = 0;

    explicit Moving(int transforms) {
        Array<NodeId> children;
        for (int i = 0; i < transforms; ++i) {
            nodes.push_back(scene.createNode(x3d::Transform::type));
            children.push_back(nodes.back());
        }
        (void)scene.setField(scene.root(), x3d::RtsgScene::children.index, children);
        scene.newFrame(0);
    }
    void frame(int number) {
        phase += .01f;
        for (std::size_t i = 0; i < nodes.size(); ++i)
            (void)scene.set(nodes[i], x3d::Transform::translation, Vec3f(phase, float(i), phase * float(i)));
        scene.newFrame(number);
    }
};

/// Bytes per second that ROUTER/DEALER over loopback TCP moves in messages of `size`, between two threads.
double rawZmq(std::size_t size, int messages) {
    void* server = zmq_ctx_new();
    void* client = zmq_ctx_new();
    void *router = zmq_socket(server, ZMQ_ROUTER), *dealer = zmq_socket(client, ZMQ_DEALER);
    const int unlimited = 0;
    for (void* socket : {router, dealer}) {
        zmq_setsockopt(socket, ZMQ_SNDHWM, &unlimited, sizeof(unlimited));
        zmq_setsockopt(socket, ZMQ_RCVHWM, &unlimited, sizeof(unlimited));
        zmq_setsockopt(socket, ZMQ_LINGER, &unlimited, sizeof(unlimited));
    }
    zmq_bind(router, kAnyPort);
    char endpoint[256];
    std::size_t length = sizeof(endpoint);
    zmq_getsockopt(router, ZMQ_LAST_ENDPOINT, endpoint, &length);
    zmq_connect(dealer, endpoint);
    zmq_send(dealer, "hi", 2, 0);
    char identity[64], text[8];
    const int identitySize = zmq_recv(router, identity, sizeof(identity), 0);
    zmq_recv(router, text, sizeof(text), 0);
    const std::vector<char> payload(size, 'x');
    std::thread receiver([&] {
        zmq_msg_t message;
        zmq_msg_init(&message);
        for (int i = 0; i < messages; ++i) zmq_msg_recv(&message, dealer, 0);
        zmq_msg_close(&message);
    });
    const auto start = Clock::now();
    for (int i = 0; i < messages; ++i) {
        zmq_msg_t message;
        zmq_msg_init_data(&message, const_cast<char*>(payload.data()), size, nullptr, nullptr);
        zmq_send(router, identity, static_cast<std::size_t>(identitySize), ZMQ_SNDMORE);
        zmq_msg_send(&message, router, 0);
    }
    receiver.join();
    const double seconds = secondsSince(start);
    for (void* socket : {router, dealer}) zmq_close(socket);
    zmq_ctx_term(server);
    zmq_ctx_term(client);
    return double(size) * messages / seconds;
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

}  // namespace

bool mirrorThroughput(const SyncSizes& sizes, const Report& report) {
    Moving origin(sizes.transforms);
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    std::atomic<bool> good{true}, ready{false};
    std::atomic<std::uint64_t> reached{0};
    std::uint64_t bytes = 0, frames = 0;
    const std::uint64_t last = origin.scene.sequence() + static_cast<std::uint64_t>(sizes.frames);
    std::thread follower([&] {
        Scene replica;
        auto client = MirrorClient::connect(replica, (*server)->endpoint());
        good = client && pollTo(**client, 1);
        ready = true;
        if (!good) return;
        const std::uint64_t bytesBefore = (*client)->statistics().bytes;
        const std::uint64_t framesBefore = (*client)->statistics().frames;
        const auto end = Clock::now() + 120s;
        while ((*client)->statistics().sequence < last && Clock::now() < end) {
            (*client)->poll(5ms);
            reached = (*client)->statistics().sequence;
        }
        const MirrorStatistics& s = (*client)->statistics();
        bytes = s.bytes - bytesBefore;
        frames = s.frames - framesBefore;
        good = s.sequence == last && s.equal && s.divergences == 0;
    });
    while (!ready) std::this_thread::sleep_for(1ms);
    const auto start = Clock::now();
    for (int i = 1; i <= sizes.frames && good; ++i) {
        origin.frame(i);
        // A scene that produces faster than a network carries would have its frames merged: keep to what arrives.
        while (good && origin.scene.sequence() > reached + 16) std::this_thread::yield();
    }
    follower.join();
    const double seconds = secondsSince(start);
    if (!good || frames == 0) return false;
    const double rate = double(sizes.transforms) * sizes.frames / seconds;
    const double raw = rawZmq(bytes / frames, sizes.frames * 4);
    report({"sync", "mirror tcp", "verified transforms", "1/s", rate, "raw ZeroMQ, same bytes",
            raw / (double(bytes) / frames) * sizes.transforms, "goal", 2e6});
    report({"sync", "mirror tcp", "states compared", "1/s", double(frames) / seconds, "frames published",
            double(sizes.frames) / seconds, "frames published", double(sizes.frames) / seconds});

    // What the scene alone costs, without anybody following.
    Moving alone(sizes.transforms);
    const auto begin = Clock::now();
    for (int i = 1; i <= sizes.frames; ++i) alone.frame(i);
    const double sceneRate = double(sizes.transforms) * sizes.frames / secondsSince(begin);
    report({"sync", "scene alone", "transforms", "1/s", sceneRate, "mirrored", rate, "none", 0});
    return true;
}

bool mirrorLatency(const SyncSizes& sizes, const Report& report) {
    Moving origin(1);
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    std::atomic<std::uint64_t> reached{0};
    std::atomic<bool> stop{false}, good{true};
    std::thread follower([&] {
        Scene replica;
        auto client = MirrorClient::connect(replica, (*server)->endpoint());
        if (!client) good = false;
        while (!stop && good) {
            (*client)->poll(100ms);
            reached = (*client)->statistics().sequence;
        }
        good = good && (*client)->statistics().divergences == 0;
    });
    const auto end = Clock::now() + 30s;
    while (reached < origin.scene.sequence() && Clock::now() < end) std::this_thread::sleep_for(1ms);
    std::vector<double> times;
    for (int i = 1; i <= sizes.roundTrips && Clock::now() < end; ++i) {
        const auto start = Clock::now();
        origin.frame(i);
        while (reached < origin.scene.sequence() && Clock::now() < end) std::this_thread::yield();
        times.push_back(secondsSince(start) * 1e6);
    }
    stop = true;
    follower.join();
    if (!good || times.empty()) return false;
    std::ranges::sort(times);
    report({"sync", "mirror tcp", "one change applied remotely, median", "us", times[times.size() / 2],
            "one change applied remotely, p99", times[times.size() * 99 / 100], "goal", 60});
    return true;
}

bool mirrorJoin(const SyncSizes& sizes, const Report& report) {
    Moving origin(sizes.joinNodes);
    auto server = MirrorServer::start(origin.scene, kAnyPort);
    if (!server) return false;
    const auto begin = Clock::now();
    const ChangeSet snapshot = origin.scene.snapshot();
    const double taking = secondsSince(begin) * 1e3;
    Scene replica;
    const auto start = Clock::now();
    auto client = MirrorClient::connect(replica, (*server)->endpoint());
    if (!client || !pollTo(**client, origin.scene.sequence())) return false;
    const double joining = secondsSince(start) * 1e3;
    report({"sync", "late join", "time for " + std::to_string(sizes.joinNodes) + " nodes", "ms", joining,
            "taking the snapshot", taking, "goal for 1 M nodes", 250});
    return (*client)->statistics().equal;
}

bool logThroughput(const SyncSizes& sizes, const Report& report) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("rtsg-bench-" + std::to_string(::getpid()) + ".rlog");
    struct Remove {
        std::filesystem::path path;
        ~Remove() { std::filesystem::remove(path); }
    } remove{file};
    ChangeSet set = animatedSet(sizes.transforms);
    std::uint64_t bytes = 0;
    {
        auto log = LogWriter::create(file, builtinTypes());
        if (!log) return false;
        const auto start = Clock::now();
        for (int i = 1; i <= sizes.frames; ++i) {
            set.from = static_cast<std::uint64_t>(i);
            set.to = set.from + 1;
            if (!(*log)->write(set)) return false;
        }
        bytes = (*log)->bytes();
        const double rate = double(bytes) / secondsSince(start);

        const std::vector<char> block(bytes / static_cast<std::uint64_t>(sizes.frames), 'x');
        const int descriptor = ::open((file.string() + ".raw").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        const auto rawStart = Clock::now();
        for (int i = 0; i < sizes.frames; ++i)
            if (::write(descriptor, block.data(), block.size()) < 0) break;
        const double raw = double(bytes) / secondsSince(rawStart);
        ::close(descriptor);
        std::filesystem::remove(file.string() + ".raw");
        report({"sync", "log", "written with checksums", "MB/s", rate / 1e6, "raw write", raw / 1e6, "goal", 1000});
    }
    {
        auto log = LogReader::open(file);
        if (!log) return false;
        const auto start = Clock::now();
        std::uint64_t records = 0;
        while (log->next()) ++records;
        report({"sync", "log", "scanned with checksums", "MB/s", double(bytes) / secondsSince(start) / 1e6, "records",
                double(records), "goal", 3000});
    }
    Moving origin(sizes.transforms);
    {
        auto log = LogWriter::create(file, builtinTypes());
        if (!log) return false;
        Attachment attachment = origin.scene.bus().attach(**log);
        for (int i = 1; i <= sizes.frames; ++i) origin.frame(i);
    }
    auto replayer = Replayer::open(file);
    if (!replayer) return false;
    const auto start = Clock::now();
    while (true) {
        const Result<bool> more = (*replayer)->step();
        if (!more) return false;
        if (!*more) break;
    }
    const double rate = double((*replayer)->frames()) / secondsSince(start);
    report({"sync", "replay", "verified states of " + std::to_string(sizes.transforms) + " transforms", "1/s", rate,
            "real time at 60 Hz", 60, "goal", 3600});
    return (*replayer)->frames() == (*replayer)->verified();
}

bool sync(const SyncSizes& sizes, const Report& report) {
    bool ok = codec(sizes, report);
    ok = input(sizes, report) && ok;
    ok = mirrorThroughput(sizes, report) && ok;
    ok = mirrorLatency(sizes, report) && ok;
    ok = mirrorJoin(sizes, report) && ok;
    return logThroughput(sizes, report) && ok;
}

}  // namespace rtsg::bench
