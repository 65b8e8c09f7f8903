// Replicas on threads of their own, and what flows to many of them.
#include "followers_sync.h"

#include <algorithm>
#include <memory>
#include <vector>

#include <rtsg/sync/mirror_server.h>

#include "bench.h"
#include "moving.h"

namespace rtsg::bench {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

Follower::Follower(std::string endpoint, MirrorClientOptions options)
    : endpoint_(std::move(endpoint)), options_(std::move(options)), thread_([this] { run(); }) {}

Follower::~Follower() {
    stop();
    thread_.join();
}

void Follower::stop() {
    stop_ = true;
    pause(false);
}

bool Follower::waitFor(std::uint64_t state, std::chrono::seconds patience) const {
    const auto end = Clock::now() + patience;
    while (reached_ < state && Clock::now() < end) std::this_thread::yield();
    return reached_ >= state;
}

void Follower::pause(bool paused) {
    paused_ = paused;
    paused_.notify_one();
}

MirrorStatistics Follower::finish() {
    stop();
    thread_.join();
    thread_ = std::thread([] {});
    return statistics_;
}

void Follower::run() {
    Scene replica;
    auto client = MirrorClient::connect(replica, endpoint_, options_);
    if (!client) return;
    while (!stop_) {
        paused_.wait(true);
        const bool news = (*client)->poll(200ms) > 0;  // until something has come
        if (news) at_ = Clock::now().time_since_epoch().count();
        applied_ = (*client)->statistics().frames;
        reached_ = (*client)->statistics().equal ? (*client)->statistics().sequence : 0;
    }
    statistics_ = (*client)->statistics();
}

Flow flow(const std::string& endpoint, int transforms, int frames, int followers, int stopped,
          const MirrorClientOptions& clients) {
    Moving origin(transforms);
    MirrorServerOptions options;
    options.maximumPeers = static_cast<std::size_t>(followers + stopped);
    options.peerTimeout = 60s;
    auto server = MirrorServer::start(origin.scene, endpoint, options);
    if (!server) return {};
    std::vector<std::unique_ptr<Follower>> all;
    for (int i = 0; i < followers + stopped; ++i)
        all.push_back(std::make_unique<Follower>((*server)->endpoint(), clients));
    for (const auto& f : all)
        if (!f->waitFor(origin.scene.sequence())) return {};
    for (int i = followers; i < followers + stopped; ++i) all[static_cast<std::size_t>(i)]->pause(true);
    const auto slowest = [&] {
        std::uint64_t minimum = UINT64_MAX;
        for (int i = 0; i < followers; ++i) minimum = std::min(minimum, all[static_cast<std::size_t>(i)]->reached());
        return minimum;
    };
    const auto end = Clock::now() + 120s;
    const std::uint64_t bytesBefore = (*server)->statistics().bytes;
    // Who waits leaves the cores to those who work: looks at each follower take a thousandth of what frames take.
    const auto pause = 10us * std::clamp(followers, 1, 100);
    const auto waitFor = [&](std::uint64_t state) {
        while (slowest() < state && Clock::now() < end) std::this_thread::sleep_for(pause);
    };
    const auto show = [&](int first, int last) {
        for (int i = first; i <= last; ++i) {
            origin.frame(i);
            waitFor(origin.scene.sequence() - std::min<std::uint64_t>(16, origin.scene.sequence()));
        }
    };
    // Stopped followers take as much as their window allows; their cost from then on is measured. The cost of one is
    // measured in a session that has run for a while, so that the server's history is full and its memory is reused.
    const int before = followers > 1 ? 100 : 600;
    show(1, before);
    waitFor(origin.scene.sequence());
    const double start = wallSeconds(), cpuStart = cpuSeconds();
    show(before + 1, before + frames);
    waitFor(origin.scene.sequence());
    const double seconds = wallSeconds() - start;
    Flow result;
    result.cpuSeconds = (cpuSeconds() - cpuStart) / frames;
    result.good = slowest() == origin.scene.sequence();
    result.changesPerSecond = double(transforms) * frames / seconds;
    result.framesPerSecond = frames / seconds;
    result.bytesPerFrame =
        double((*server)->statistics().bytes - bytesBefore) / frames / std::max(1, followers + stopped);
    // Those who were stopped go on and end in the same state.
    for (const auto& f : all) f->pause(false);
    for (const auto& f : all) result.good = f->waitFor(origin.scene.sequence()) && result.good;
    for (const auto& f : all) f->stop();
    for (const auto& f : all) result.good = f->finish().divergences == 0 && result.good;
    return result;
}

Paced paced(int transforms, double hertz, int frames, int followers) {
    Moving origin(transforms);
    MirrorServerOptions options;
    options.maximumPeers = static_cast<std::size_t>(followers);
    options.peerTimeout = 60s;
    auto server = MirrorServer::start(origin.scene, kAnyPort, options);
    if (!server) return {};
    std::vector<std::unique_ptr<Follower>> all;
    for (int i = 0; i < followers; ++i) all.push_back(std::make_unique<Follower>((*server)->endpoint()));
    const auto everybody = [&] {
        return std::ranges::all_of(all, [&](const auto& f) { return f->waitFor(origin.scene.sequence()); });
    };
    int frame = 0;
    const auto show = [&](int count) {
        auto next = Clock::now();
        for (int i = 0; i < count; ++i) {
            origin.frame(++frame);
            next += std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / hertz));
            std::this_thread::sleep_until(next);
        }
    };
    if (!everybody()) return {};
    show(frames / 4);  // until the ways are known
    if (!everybody()) return {};
    const auto applied = [&] {
        std::uint64_t sum = 0;
        for (const auto& f : all) sum += f->applied();
        return static_cast<double>(sum);
    };
    const std::uint64_t bytes = (*server)->statistics().bytes;
    const double got = applied(), start = wallSeconds(), cpu = cpuSeconds();
    show(frames);
    if (!everybody()) return {};
    const double seconds = wallSeconds() - start, each = applied() - got;
    Paced result{each / followers / seconds, (cpuSeconds() - cpu) / each, 0, true};
    result.bytesPerFrame = double((*server)->statistics().bytes - bytes) / each;
    for (const auto& f : all) f->stop();
    for (const auto& f : all) result.good = f->finish().divergences == 0 && result.good;
    return result;
}

}  // namespace rtsg::bench
