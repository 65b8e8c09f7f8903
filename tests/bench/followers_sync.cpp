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
        std::uint64_t least = UINT64_MAX;
        for (int i = 0; i < followers; ++i) least = std::min(least, all[static_cast<std::size_t>(i)]->reached());
        return least;
    };
    const auto end = Clock::now() + 120s;
    const std::uint64_t bytesBefore = (*server)->statistics().bytes;
    // Who waits leaves the cores to those who work: a thousandth of what the frames under way take.
    const auto waitFor = [&](std::uint64_t state) {
        while (slowest() < state && Clock::now() < end) std::this_thread::sleep_for(10us);
    };
    const auto show = [&](int first, int last) {
        for (int i = first; i <= last; ++i) {
            origin.frame(i);
            waitFor(origin.scene.sequence() - std::min<std::uint64_t>(16, origin.scene.sequence()));
        }
    };
    // Those who are stopped take what their window allows; what they cost from then on is the question.
    const int before = followers > 1 ? 100 : 0;
    show(1, before);
    waitFor(origin.scene.sequence());
    const double start = wallSeconds();
    show(before + 1, before + frames);
    waitFor(origin.scene.sequence());
    const double seconds = wallSeconds() - start;
    Flow result;
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

}  // namespace rtsg::bench
