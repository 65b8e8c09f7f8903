// The same frames to as many mirrors by NATS and by ZeroMQ, and the same bytes by both alone.
#include "bench_nats.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <sstream>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <rtsg/nats/nats_publisher.h>
#include <rtsg/nats/nats_subscriber.h>
#include <rtsg/sync/mirror_server.h>

#include "bench_sync_raw.h"
#include "followers_sync.h"
#include "link/open_nats.h"
#include "moving.h"
#include "support/nats_server.h"

namespace rtsg::bench {

namespace {

using namespace std::chrono_literals;

constexpr int kMovers = 1050;   // whose moves are a frame of 13 kB
constexpr int kUnmeasured = 5;  // frames that are not measured
constexpr auto kPatience = 60s;

/// CPU seconds that another process has used.
double cpuSecondsOf(pid_t process) {
    std::ifstream in("/proc/" + std::to_string(process) + "/stat");
    std::string text;
    std::getline(in, text);
    std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 1)));
    std::string skipped;
    for (int i = 0; i < 11; ++i) fields >> skipped;
    double user = 0, system = 0;
    fields >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

/// True once all have reached something, while whoever waits leaves the cores to those who work.
template <class All, class Reached>
bool waitForEach(const All& all, Reached&& reached) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    for (const auto& one : all)
        while (!reached(*one)) {
            if (std::chrono::steady_clock::now() > end) return false;
            std::this_thread::sleep_for(1ms);
        }
    return true;
}

struct Deliveries : Delays {
    double bytes = 0;  // of a frame
};

/// Mirrors by ZeroMQ, or by the NATS server if there is one.
Deliveries mirrored(int peers, int frames, const test::NatsServer* nats) {
    Deliveries result;
    Moving origin(kMovers);
    MirrorServerOptions options;
    options.maximumPeers = static_cast<std::size_t>(peers) + 2;
    options.peerTimeout = 60s;
    auto server = MirrorServer::start(origin.scene, kAnyPort, options);
    if (!server) return {};
    std::unique_ptr<NatsPublisher> publisher;
    std::vector<std::unique_ptr<NatsSubscriber>> clients;
    if (nats) {
        NatsPublisherOptions to;
        to.address = nats->address();
        auto started = NatsPublisher::start(**server, to);
        if (!started) return {};
        publisher = std::move(*started);
    }
    std::vector<std::unique_ptr<Follower>> all;
    for (int i = 0; i < peers; ++i) {
        std::string endpoint = (*server)->endpoint();
        MirrorClientOptions by;
        if (nats) {
            auto variant = NatsSubscriber::start(nats->address(), 5s);
            if (!variant) return {};
            endpoint = (*variant)->address();
            by.transport = (*variant)->transport();
            clients.push_back(std::move(*variant));
        }
        all.push_back(std::make_unique<Follower>(endpoint, by));
    }
    const auto arrived = [&] {
        return waitForEach(all, [&](const Follower& f) { return f.reached() >= origin.scene.sequence(); });
    };
    if (!arrived()) return {};
    double before = 0;
    const auto spent = [&] { return cpuSeconds() + (nats ? cpuSecondsOf(nats->process()) : 0); };
    std::uint64_t bytes = 0;
    for (int i = 1; i <= kUnmeasured + frames; ++i) {
        const bool counts = i > kUnmeasured;
        if (i == kUnmeasured + 1) {
            std::this_thread::sleep_for(500ms);
            before = spent();
            bytes = publisher ? publisher->statistics().bytes : (*server)->statistics().bytes;
        }
        const std::int64_t created = std::chrono::steady_clock::now().time_since_epoch().count();
        origin.frame(i);
        if (!arrived()) return {};
        for (const auto& f : all)
            if (counts) result.seconds.push_back(static_cast<double>(f->reachedAt() - created) * 1e-9);
    }
    result.cpuSeconds = (spent() - before) / frames / peers;
    const std::uint64_t after = publisher ? publisher->statistics().bytes : (*server)->statistics().bytes;
    result.bytes = static_cast<double>(after - bytes) / frames / (publisher ? 1 : peers);
    for (const auto& f : all) f->stop();
    for (const auto& f : all)
        if (f->finish().divergences != 0) return {};
    std::ranges::sort(result.seconds);
    return result;
}

/// A subscription with a connection and a thread of its own, as a process of its own would have it.
class BareSubscription {
  public:
    explicit BareSubscription(std::unique_ptr<NatsLink> link) : link_(std::move(link)) {
        (void)link_->subscribe("bare");
        (void)link_->flush(5s);
        thread_ = std::thread([this] { run(); });
    }
    ~BareSubscription() {
        stop_ = true;
        thread_.join();
    }
    int received() const { return received_; }
    std::int64_t receivedAt() const { return at_; }

  private:
    void run() {
        NatsMessage message;
        while (!stop_) {
            while (link_->take(message)) {
                unsigned sum = 0;
                for (std::size_t i = 0; i < message.bytes.size(); i += 64)
                    sum += static_cast<unsigned char>(message.bytes[i]);
                keep(sum);
                at_ = std::chrono::steady_clock::now().time_since_epoch().count();
                ++received_;
            }
            pollfd item{link_->descriptor(), POLLIN, 0};
            (void)::poll(&item, 1, 100);
        }
    }
    std::unique_ptr<NatsLink> link_;
    std::atomic<bool> stop_{false};
    std::atomic<int> received_{0};
    std::atomic<std::int64_t> at_{0};
    std::thread thread_;
};

Delays bareNats(std::size_t size, int peers, int messages, const test::NatsServer& nats) {
    Delays result;
    const auto address = NatsAddress::parse(nats.address());
    auto publisher = openNatsLink(*address, "bench");
    if (!publisher) return {};
    std::vector<std::unique_ptr<BareSubscription>> all;
    for (int i = 0; i < peers; ++i) {
        auto link = openNatsLink(*address, "bench", 5s);
        if (!link) return {};
        all.push_back(std::make_unique<BareSubscription>(std::move(*link)));
    }
    const std::vector<std::byte> payload(size);
    double before = 0;
    const auto spent = [&] { return cpuSeconds() + cpuSecondsOf(nats.process()); };
    for (int i = 1; i <= kUnmeasured + messages; ++i) {
        if (i == kUnmeasured + 1) {
            std::this_thread::sleep_for(500ms);
            before = spent();
        }
        const std::int64_t created = std::chrono::steady_clock::now().time_since_epoch().count();
        if (!(*publisher)->publish("bare", "", payload).empty()) return {};
        if (!waitForEach(all, [&](const BareSubscription& s) { return s.received() >= i; })) return {};
        for (const auto& s : all)
            if (i > kUnmeasured) result.seconds.push_back(static_cast<double>(s->receivedAt() - created) * 1e-9);
    }
    result.cpuSeconds = (spent() - before) / messages / peers;
    std::ranges::sort(result.seconds);
    return result;
}

double atFraction(const std::vector<double>& sorted, double q) {
    return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

}  // namespace

bool natsCrowd(const SyncSizes& sizes, const Report& report) {
    if (test::NatsServer::program().empty()) {
        fmt::print(stderr, "not measured: {}\n", test::NatsServer::kMissing);
        return true;
    }
    const test::NatsServer nats;
    if (const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "bench", 5s); !link) {
        fmt::print(stderr, "not measured: {}\n", link.error().format());
        return true;
    }
    const int peers = sizes.peers, frames = std::max(20, sizes.frames / 4);
    const Deliveries direct = mirrored(peers, frames, nullptr), over = mirrored(peers, frames, &nats);
    if (direct.seconds.empty() || over.seconds.empty()) return false;
    const auto size = static_cast<std::size_t>(over.bytes);
    const Delays bare = bareNats(size, peers, frames, nats), socket = rawPublishing(size, peers, frames);
    if (bare.seconds.empty() || socket.seconds.empty()) return false;
    const auto say = [&](const char* name, const Delays& ours, const char* baseline, const Delays& alone) {
        const std::string text = fmt::format("{} mirrors {}, frames of 13 kB", peers, name);
        report({"sync", text, "CPU time of a delivery", "us", 1e6 * ours.cpuSeconds, baseline, 1e6 * alone.cpuSeconds,
                "", 0});
        for (const auto& [which, q] :
             {std::pair("a frame's delay, median", .5), std::pair("a frame's delay, p99", .99)})
            report({"sync", text, which, "ms", 1e3 * atFraction(ours.seconds, q), baseline,
                    1e3 * atFraction(alone.seconds, q), "", 0});
    };
    say("by NATS", over, "bare NATS, same bytes", bare);
    say("by ZeroMQ", direct, "bare PUB, same bytes", socket);
    return true;
}

}  // namespace rtsg::bench
