#include "bench_sync.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include <zmq.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

#include "bench/moving.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
constexpr const char* kAnyPort = "tcp://127.0.0.1:*";

double secondsSince(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

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

bool sync(const SyncSizes& sizes, const Report& report) {
    bool ok = codec(sizes, report);
    ok = input(sizes, report) && ok;
    ok = mirrorThroughput(sizes, report) && ok;
    ok = mirrorLatency(sizes, report) && ok;
    ok = mirrorJoin(sizes, report) && ok;
    return log(sizes, report) && ok;
}

}  // namespace rtsg::bench
