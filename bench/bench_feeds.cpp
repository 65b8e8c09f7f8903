// Bench "feeds": from a click at a TouchSensor to a line in somebody's hands, by a function, a socket and a broker,
// beside the same bytes by each of them alone.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <sys/socket.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/listeners.h>
#include <rtsg/core/x3d.h>
#include <rtsg/feeds/publisher.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/renderers/world_queries.h>

#include "bench.h"
#include "sockets/endpoint.h"
#include "sockets/mqtt.h"
#include "support/mosquitto.h"

namespace rtsg::bench {

namespace {

using FeedClock = std::chrono::steady_clock;
constexpr std::string_view kLineOfClick = R"({"t":1.2333333333333334,"node":"BUTTON","field":"isActive","value":true})";

/// Counts lines, and notes when the newest came. Threading: one thread notes, another one waits.
class Arrivals {
  public:
    void note(std::string_view bytes) {
        const auto lines = std::ranges::count(bytes, '\n');
        if (lines == 0) return;
        at_ = FeedClock::now().time_since_epoch().count();
        count_ += static_cast<int>(lines);
    }
    /// Seconds from `since` until that many had come; < 0 if they do not.
    double waitFor(int count, FeedClock::time_point since) const {
        for (const auto end = since + std::chrono::seconds(10); count_ < count && FeedClock::now() < end;)
            std::this_thread::sleep_for(std::chrono::microseconds(100));
        return count_ < count ? -1 : static_cast<double>(at_ - since.time_since_epoch().count()) * 1e-9;
    }

  private:
    std::atomic<int> count_{0};
    std::atomic<std::int64_t> at_{0};
};

/// Reads a connection until its end.
class LineReader {
  public:
    LineReader(Descriptor socket, Arrivals& arrivals)
        : socket_(std::move(socket)), thread_([this, &arrivals] {
              char bytes[4096];
              for (ssize_t size = 0; (size = ::recv(socket_.get(), bytes, sizeof(bytes), 0)) > 0;)
                  arrivals.note({bytes, static_cast<std::size_t>(size)});
          }) {}
    ~LineReader() {
        ::shutdown(socket_.get(), SHUT_RDWR);
        thread_.join();
    }
    LineReader(const LineReader&) = delete;
    LineReader& operator=(const LineReader&) = delete;

  private:
    Descriptor socket_;
    std::thread thread_;
};

Descriptor connectedTo(const std::string& text) {
    const auto endpoint = feeds::Endpoint::parse(text);
    const auto at = endpoint ? feeds::findAddress(*endpoint) : Result<feeds::SocketAddress>(fail(""));
    Descriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (at) (void)::connect(socket.get(), at->get(), at->length);
    return socket;
}

/// A box that can be clicked, and rays to find it with.
struct Button {
    Scene scene;
    NodeId sensor = scene.createNode(x3d::TouchSensor::type);
    SharedWorld world{scene};
    WorldQueries queries{[this]() -> SharedWorld& { return world; }, Resources()};
    int frames = 0;

    Button() {
        const NodeId shape = scene.createNode(x3d::Shape::type), group = scene.createNode(x3d::Group::type);
        keep(bool(scene.set(shape, x3d::Shape::geometry, scene.createNode(x3d::Box::type))));
        keep(bool(scene.setName(sensor, "BUTTON")));
        keep(bool(scene.insertChild(group, x3d::Group::children, sensor)));
        keep(bool(scene.insertChild(group, x3d::Group::children, shape)));
        keep(bool(scene.insertChild(scene.root(), x3d::RtsgScene::children, group)));
        scene.setSpaceQueries(&queries);
        frame();
    }
    void frame() { scene.newFrame(++frames / 60.); }
    void point(bool down) {
        PointerInput input;
        input.origin = {0, 0, 9};
        input.buttons = down ? PointerInput::kPrimary : 0;
        keep(bool(sendPointer(scene, input)));
        frame();
    }
};

/// The delays of clicks in seconds, sorted; empty if one does not come. `publish` may be empty.
std::vector<double> clicks(int count, Button& button, const Arrivals& arrivals, const std::function<void()>& frame) {
    std::vector<double> seconds;
    for (int i = 1; i <= count; ++i)
        for (const bool down : {true, false}) {
            const auto since = FeedClock::now();
            button.point(down);
            if (frame) frame();
            const double delay = arrivals.waitFor(2 * i - (down ? 1 : 0), since);
            if (delay < 0) return {};
            seconds.push_back(delay);
        }
    std::ranges::sort(seconds);
    return seconds;
}

std::vector<double> published(int count, const std::string& target, Arrivals& arrivals) {
    Button button;
    PublishOptions options;
    options.target = target;
    options.fields = {"BUTTON.isActive"};
    auto publisher = Publisher::start(button.scene, options);
    if (!publisher) return {};
    std::unique_ptr<LineReader> reader;
    if (target.starts_with("tcp:")) {
        reader = std::make_unique<LineReader>(connectedTo((*publisher)->target()), arrivals);
        std::this_thread::sleep_for(std::chrono::milliseconds(100));  // until the publisher has met it
    }
    return clicks(count, button, arrivals, [&] { (*publisher)->frame(button.scene.now()); });
}

/// As many lines as the clicks make, sent by `send` alone.
std::vector<double> alone(int count, const Arrivals& arrivals, const std::function<void(const std::string&)>& send) {
    std::vector<double> seconds;
    for (int i = 1; i <= 2 * count; ++i) {
        const auto since = FeedClock::now();
        send(std::string(kLineOfClick) + "\n");
        const double delay = arrivals.waitFor(i, since);
        if (delay < 0) return {};
        seconds.push_back(delay);
    }
    std::ranges::sort(seconds);
    return seconds;
}

double fractionOf(const std::vector<double>& sorted, double q) {
    return sorted.empty() ? 0 : sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

void sayClicks(const Report& report, const char* variant, const std::vector<double>& ours, const char* baseline,
               const std::vector<double>& bare) {
    const std::string name = fmt::format("a click, {}", variant);
    for (const auto& [metric, q] :
         {std::pair("to the user's code, median", .5), std::pair("to the user's code, p99", .99)})
        report({"feeds", name, metric, "ms", 1e3 * fractionOf(ours, q), baseline, 1e3 * fractionOf(bare, q), "", 0});
}

std::vector<double> calledBack(int count) {
    Button button;
    Arrivals arrivals;
    Listeners listeners(button.scene);
    keep(
        bool(listeners.onField(button.sensor, x3d::TouchSensor::isActive, [&](bool, double) { arrivals.note("\n"); })));
    return clicks(count, button, arrivals, {});
}

bool byBroker(const Report& report, int count) {
    if (test::Mosquitto::program().empty()) {
        fmt::print(stderr, "not measured: {}\n", test::Mosquitto::kMissing);
        return true;
    }
    const test::Mosquitto broker;
    Arrivals ours, bare;
    const auto heard = [&](Arrivals& into, const std::string& topic) {
        feeds::MqttSettings settings;
        settings.note = [](const std::string&) {};
        settings.take = [&into](std::string_view) { into.note("\n"); };
        return feeds::startMqtt(*feeds::Endpoint::parse(broker.endpoint(topic)), std::move(settings));
    };
    const auto reader = heard(ours, "ours"), other = heard(bare, "bare");
    feeds::MqttSettings settings;
    settings.note = [](const std::string&) {};
    const auto sender = feeds::startMqtt(*feeds::Endpoint::parse(broker.endpoint("bare")), std::move(settings));
    if (!reader || !other || !sender) {
        fmt::print(stderr, "not measured: {}\n", (!reader ? reader : !other ? other : sender).error().format());
        return true;
    }
    const auto clicked = published(count, broker.endpoint("ours"), ours);
    const auto sent = alone(count, bare, [&](const std::string& line) { (void)(*sender)->publish(line); });
    sayClicks(report, "a message by MQTT", clicked, "the broker alone", sent);
    return !clicked.empty() && !sent.empty();
}

}  // namespace

bool feedsLatency(const Report& report, bool quick) {
    const int count = quick ? 20 : 500;
    const auto called = calledBack(count);
    Arrivals ours, bare;
    const auto clicked = published(count, "tcp://127.0.0.1:0", ours);
    feeds::Endpoint endpoint = *feeds::Endpoint::parse("tcp://127.0.0.1:0");
    const auto listener = feeds::listenAt(endpoint, false);
    if (!listener) return false;
    const LineReader reader(connectedTo(endpoint.text), bare);
    const Descriptor socket(::accept4(listener->get(), nullptr, nullptr, SOCK_CLOEXEC));
    const auto sent = alone(count, bare, [&](const std::string& line) {
        (void)::send(socket.get(), line.data(), line.size(), MSG_NOSIGNAL);
    });
    sayClicks(report, "a function in C++", called, "a line by a bare socket", sent);
    sayClicks(report, "a line by TCP", clicked, "a line by a bare socket", sent);
    return byBroker(report, count) && !called.empty() && !clicked.empty() && !sent.empty();
}

}  // namespace rtsg::bench
