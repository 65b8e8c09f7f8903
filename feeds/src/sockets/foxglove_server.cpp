// Speaks the protocol of Foxglove with viewers: tells topics, takes subscriptions, and hands messages out.
#include <rtsg/feeds/foxglove_server.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/module.h>

#include "endpoint.h"
#include "lines/viewer_request.h"
#include "sockets/web_module.h"

namespace rtsg {

namespace {

using ViewerClock = std::chrono::steady_clock;

constexpr const char* kProtocol = "foxglove.websocket.v1";
constexpr std::size_t kMaxViewers = 32, kLongestSubscription = 64 << 10;
constexpr auto kHandshake = std::chrono::seconds(5), kSilence = std::chrono::seconds(60);
constexpr auto kMinPause = std::chrono::milliseconds(50);  // between whole messages that viewers ask for
constexpr char kMessageData = 1, kTimeData = 2;

/// Pages from which Foxglove and Lichtblick connect where they are not installed.
const std::vector<std::string> kKnownPages = {"https://app.foxglove.dev", "https://studio.foxglove.dev", "file://"};

Result<StartSockets> loadSockets() {
#ifdef RTSG_NO_WEB
    return fail("live viewers are not served: this build leaves out WebSockets (RTSG_WEB=OFF)");
#else
    const auto symbol = loadModule("rtsg_web", RTSG_SOCKETS_SYMBOL, "serving live viewers needs");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<StartSockets (*)()>(*symbol)();
#endif
}

void appendNumber(std::string& out, auto number) {
    static_assert(std::endian::native == std::endian::little);
    char bytes[sizeof(number)];
    std::memcpy(bytes, &number, sizeof(number));
    out.append(bytes, sizeof(number));
}

std::uint64_t nanosecondsOf(double time) {
    constexpr double kNanoseconds = 1e9;
    return static_cast<std::uint64_t>(std::llround(std::max(0., time) * kNanoseconds));
}

}  // namespace

struct FoxgloveServer::State {
    struct Subscription {
        std::uint32_t id = 0;
        bool needsWhole = true;
    };
    struct Topic {
        std::string advertised;  // as JSON
        bool isState = false;
        std::map<std::uint64_t, Subscription> subscriptions;  // by client
        ViewerClock::time_point nextWhole{};
        std::size_t lastWhole = 0;  // its bytes
    };
    struct Client {
        std::map<std::uint32_t, std::size_t> topics;  // by the number of the subscription
        std::uint64_t missed = 0;                     // that it has not been told of
    };

    void say(std::uint64_t client, const std::string& json) {
        (void)module->send(client, {}, std::make_shared<const std::string>(json), false);
    }
    void sayStatus(std::uint64_t client, int level, const std::string& text) {
        say(client, fmt::format(R"({{"op":"status","level":{},"message":{}}})", level, jsonString(text)));
    }
    void meet(std::uint64_t client);
    void hear(std::uint64_t client, const SocketEvent& news);
    void subscribe(std::uint64_t client, std::uint32_t id, std::uint32_t channel);
    void unsubscribe(std::uint64_t client, std::uint32_t id);
    void forget(std::uint64_t client);

    FoxgloveOptions options;
    std::string address;
    std::vector<Topic> topics;  // channel n is the topic n - 1
    std::map<std::uint64_t, Client> clients;
    FoxgloveCounts counts;
    std::vector<Diagnostic> diagnostics;
    std::unique_ptr<SocketModule> module;
};

FoxgloveServer::FoxgloveServer(std::unique_ptr<State> state) : state_(std::move(state)) {}
FoxgloveServer::~FoxgloveServer() = default;

Result<std::unique_ptr<FoxgloveServer>> FoxgloveServer::start(FoxgloveOptions options) {
    auto endpoint = feeds::Endpoint::ofPort(options.listen);
    if (!endpoint) return std::unexpected(endpoint.error());
    const auto startSockets = loadSockets();
    if (!startSockets) return std::unexpected(startSockets.error());
    auto listener = feeds::listenAt(*endpoint, options.insecure);
    if (!listener) return std::unexpected(listener.error());
    SocketSettings settings;
    settings.listener = ::dup(listener->get());
    const auto real = feeds::findAddress(*endpoint);
    settings.loopback = real && real->isLoopback();
    settings.anyOrigin = options.insecure;
    settings.origins = kKnownPages;
    settings.protocol = kProtocol;
    settings.maximumConnections = kMaxViewers;
    settings.longestIncoming = kLongestSubscription;
    settings.maxQueued = kMaxQueued;
    settings.requestTimeout = kHandshake;
    settings.silence = kSilence;
    settings.call = options.call;
    auto state = std::make_unique<State>();
    state->address = "ws" + endpoint->text.substr(endpoint->text.find("://"));
    state->options = std::move(options);
    std::string problem;
    state->module = (*startSockets)(settings, problem);
    if (!state->module) return fail(fmt::format("cannot serve viewers at {}: {}", endpoint->text, problem));
    return std::unique_ptr<FoxgloveServer>(new FoxgloveServer(std::move(state)));
}

std::uint16_t FoxgloveServer::addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema,
                                       bool isState) {
    State::Topic& added = state_->topics.emplace_back();
    added.isState = isState;
    added.advertised = fmt::format(
        R"({{"id":{},"topic":{},"encoding":"json","schemaName":{},"schema":{},"schemaEncoding":"jsonschema"}})",
        state_->topics.size(), jsonString(topic), jsonString(schemaName), jsonString(schema));
    return static_cast<std::uint16_t>(state_->topics.size() - 1);
}

/// A viewer has come.
void FoxgloveServer::State::meet(std::uint64_t client) {
    clients[client];
    say(client, fmt::format(R"({{"op":"serverInfo","name":{},"capabilities":["time"],"metadata":{{}}}})",
                            jsonString(options.name)));
    std::string channels;
    for (const Topic& topic : topics) channels += (channels.empty() ? "" : ",") + topic.advertised;
    say(client, fmt::format(R"({{"op":"advertise","channels":[{}]}})", channels));
}

void FoxgloveServer::State::hear(std::uint64_t client, const SocketEvent& news) {
    const auto request = news.kind == SocketEvent::Kind::text
                             ? feeds::readViewerRequest(news.text)
                             : Result<feeds::ViewerRequest>(fail("nothing is published from here to the scene"));
    const bool known = request && (request->op == "subscribe" || request->op == "unsubscribe");
    if (!known) {
        ++counts.garbage;
        return sayStatus(client, 2,
                         request ? fmt::format("{}: this server does not do that", request->op) : request.error().text);
    }
    for (const auto& [id, channel] : request->subscriptions) subscribe(client, id, channel);
    for (const std::uint32_t id : request->ended) unsubscribe(client, id);
}

void FoxgloveServer::State::subscribe(std::uint64_t client, std::uint32_t id, std::uint32_t channel) {
    const auto refuse = [&](const std::string& why) {
        ++counts.garbage;
        sayStatus(client, 1, fmt::format("subscription {}: {}", id, why));
    };
    if (channel == 0 || channel > topics.size()) return refuse(fmt::format("there is no channel {}", channel));
    Topic& topic = topics[channel - 1];
    if (clients.at(client).topics.contains(id)) return refuse("there is one with this id");
    if (topic.subscriptions.contains(client)) return refuse(fmt::format("channel {} has one already", channel));
    clients.at(client).topics[id] = channel - 1;
    topic.subscriptions[client] = {id, topic.isState};
}

void FoxgloveServer::State::unsubscribe(std::uint64_t client, std::uint32_t id) {
    auto& held = clients.at(client).topics;
    const auto found = held.find(id);
    if (found == held.end()) {
        ++counts.garbage;
        return sayStatus(client, 1, fmt::format("there is no subscription {}", id));
    }
    topics[found->second].subscriptions.erase(client);
    held.erase(found);
}

void FoxgloveServer::State::forget(std::uint64_t client) {
    const auto found = clients.find(client);
    if (found == clients.end()) return;
    for (const auto& [id, topic] : found->second.topics) topics[topic].subscriptions.erase(client);
    clients.erase(found);
}

void FoxgloveServer::service() {
    State& s = *state_;
    using Kind = SocketEvent::Kind;
    for (const SocketEvent& news : s.module->takeNews()) {
        if (news.kind == Kind::refused) {
            ++s.counts.refused;
            s.diagnostics.push_back({Severity::warning, s.address, {}, news.text});
        } else if (news.kind == Kind::came) {
            s.meet(news.client);
        } else if (news.kind == Kind::left) {
            s.forget(news.client);
        } else if (s.clients.contains(news.client)) {
            s.hear(news.client, news);
        }
    }
}

bool FoxgloveServer::wants(std::uint16_t topic) const {
    return !state_->topics[topic].subscriptions.empty();
}

bool FoxgloveServer::wantsWhole(std::uint16_t topic) const {
    const State::Topic& all = state_->topics[topic];
    if (all.subscriptions.empty() || ViewerClock::now() < all.nextWhole) return false;
    return std::ranges::any_of(all.subscriptions, [&](const auto& one) {
        return one.second.needsWhole && state_->module->hasRoom(one.first, all.lastWhole);
    });
}

bool FoxgloveServer::owesWhole() const {
    return std::ranges::any_of(state_->topics, [](const State::Topic& topic) {
        return std::ranges::any_of(topic.subscriptions, [](const auto& one) { return one.second.needsWhole; });
    });
}

void FoxgloveServer::send(std::uint16_t topic, double time, std::string json, Reach reach) {
    State& s = *state_;
    State::Topic& all = s.topics[topic];
    const auto body = std::make_shared<const std::string>(std::move(json));
    if (all.isState && reach != Reach::change) {
        all.lastWhole = body->size();
        const std::chrono::duration<double> pause(static_cast<double>(body->size()) / double{kWholeRate});
        all.nextWhole = ViewerClock::now() + std::max<ViewerClock::duration>(
                                                 kMinPause, std::chrono::duration_cast<ViewerClock::duration>(pause));
    }
    for (auto& [client, subscription] : all.subscriptions) {
        if (subscription.needsWhole ? reach == Reach::change : reach == Reach::wholeForNew) continue;
        std::string head(1, kMessageData);
        appendNumber(head, subscription.id);
        appendNumber(head, nanosecondsOf(time));
        State::Client& to = s.clients.at(client);
        if (!s.module->send(client, std::move(head), body, true)) {
            ++s.counts.missed;
            ++to.missed;
            subscription.needsWhole = all.isState;
            continue;
        }
        ++s.counts.messages;
        subscription.needsWhole = false;
        if (to.missed > 0)
            s.sayStatus(client, 1, fmt::format("{} messages were left out, as nobody read them", to.missed));
        to.missed = 0;
    }
}

void FoxgloveServer::sendTime(double time) {
    static const auto nothing = std::make_shared<const std::string>();
    std::string head(1, kTimeData);
    appendNumber(head, nanosecondsOf(time));
    // A viewer without room hears a later one.
    for (const auto& [client, state] : state_->clients) (void)state_->module->send(client, head, nothing, true);
}

const std::string& FoxgloveServer::address() const {
    return state_->address;
}

FoxgloveCounts FoxgloveServer::counts() const {
    FoxgloveCounts counts = state_->counts;
    counts.clients = state_->clients.size();
    return counts;
}

std::vector<Diagnostic> FoxgloveServer::takeDiagnostics() {
    return std::exchange(state_->diagnostics, {});
}

}  // namespace rtsg
