// Listens to fields, and writes their events as lines, with a rate if one is set.
#include <rtsg/feeds/publisher.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_path.h>
#include <rtsg/core/field_text.h>
#include <rtsg/core/listeners.h>

#include "sockets/line_sink.h"

namespace rtsg {

namespace {

constexpr double kRoundingOfTimes = 1e-9;  // seconds

struct Wanted {
    std::string node;
    NodeId id;
    FieldIndex field = kNoField;
};

/// The fields that "DEF.field" or "DEF.*" names.
Result<std::vector<Wanted>> wantedBy(const Scene& scene, const std::string& text) {
    std::vector<Wanted> all;
    if (!text.ends_with(".*")) {
        const auto one = findField(scene, text);
        if (!one) return std::unexpected(one.error());
        all.push_back({text.substr(0, text.rfind('.')), one->node, one->field});
        return all;
    }
    const std::string name = text.substr(0, text.size() - 2);
    const auto node = findNode(scene, name);
    if (!node) return std::unexpected(node.error());
    const auto& fields = scene.node(*node).type().fields;
    for (std::size_t i = 0; i < fields.size(); ++i)
        if (!fields[i].hidden && fields[i].sends()) all.push_back({name, *node, static_cast<FieldIndex>(i)});
    return all;
}

}  // namespace

struct Publisher::State {
    /// The state of one published field.
    struct Topic {
        std::string words;  // "node":…,"field":…
        std::optional<Value> waiting;
        double at = 0;                                           // when it was sent by the field
        double next = -std::numeric_limits<double>::infinity();  // when the next line may go
    };

    State(Scene& heard, PublishOptions given, feeds::Endpoint endpoint, std::unique_ptr<feeds::LineSink> target)
        : scene(heard), options(std::move(given)), at(std::move(endpoint)), sink(std::move(target)), listeners(heard) {}

    Result<> listen();
    void listenAgain();
    double timeOf(double sceneTime) const;
    void take(Topic& topic, const Value& value, double t);
    void write(Topic& topic, const Value& value, double t);

    Scene& scene;
    const PublishOptions options;
    const feeds::Endpoint at;
    const std::unique_ptr<feeds::LineSink> sink;
    std::optional<double> expected;  // the time of the frame under way
    std::deque<Topic> topics;        // their addresses stay
    std::uint64_t events = 0;
    std::vector<Diagnostic> diagnostics;
    std::string reported;  // the sink's failure
    std::vector<ListenerId> ears;
    Listeners listeners;
};

Publisher::Publisher(std::unique_ptr<State> state) : state_(std::move(state)) {}
Publisher::~Publisher() {
    close();
}

Result<std::unique_ptr<Publisher>> Publisher::start(Scene& scene, PublishOptions options) {
    if (options.fields.empty()) return fail("nothing to publish: no fields are named");
    auto endpoint = feeds::Endpoint::parse(options.target);
    if (!endpoint) return std::unexpected(endpoint.error());
    for (const std::string& text : options.fields)
        if (const auto wanted = wantedBy(scene, text); !wanted) return std::unexpected(wanted.error());
    auto sink = feeds::LineSink::open(*endpoint, options.insecure, options.waits);
    if (!sink) return std::unexpected(sink.error());
    auto state = std::make_unique<State>(scene, std::move(options), std::move(*endpoint), std::move(*sink));
    if (auto ok = state->listen(); !ok) return std::unexpected(ok.error());
    state->listeners.onWorld([s = state.get()] { s->listenAgain(); });
    return std::unique_ptr<Publisher>(new Publisher(std::move(state)));
}

/// Listens to all fields that are there. Returns the first error.
Result<> Publisher::State::listen() {
    Result<> result;
    for (const std::string& text : options.fields) {
        const auto wanted = wantedBy(scene, text);
        if (!wanted) {
            if (result) result = std::unexpected(wanted.error());
            continue;
        }
        for (const Wanted& one : *wanted) {
            const std::string_view field = scene.node(one.id).type().fields[one.field].name;
            Topic& topic = topics.emplace_back();
            topic.words = fmt::format("\"node\":{},\"field\":{}", jsonString(one.node), jsonString(field));
            const auto ear = listeners.onField(one.id, one.field, [this, &topic](const FieldEvent& event, double time) {
                take(topic, event.value, timeOf(time));
            });
            if (ear)
                ears.push_back(*ear);
            else if (result)
                result = std::unexpected(ear.error());
        }
    }
    return result;
}

double Publisher::State::timeOf(double sceneTime) const {
    constexpr double kMicroseconds = 1e6;  // of a second
    const double t = sceneTime - options.start;
    if (expected && std::abs(t - *expected) * kMicroseconds < 1) return *expected;
    return std::round(t * kMicroseconds) / kMicroseconds;
}

void Publisher::expect(double t) {
    state_->expected = t;
}

/// Another world is there, in which the names may belong to other nodes.
void Publisher::State::listenAgain() {
    for (const ListenerId ear : ears) listeners.end(ear);
    ears.clear();
    topics.clear();
    if (const auto ok = listen(); !ok) diagnostics.push_back({Severity::warning, at.text, {}, ok.error().text});
}

void Publisher::State::take(Topic& topic, const Value& value, double t) {
    ++events;
    if (options.rate <= 0 || t + kRoundingOfTimes >= topic.next) return write(topic, value, t);
    topic.waiting = value;
    topic.at = t;
}

void Publisher::State::write(Topic& topic, const Value& value, double t) {
    topic.waiting.reset();
    if (options.rate > 0) topic.next = t + 1 / options.rate;
    std::string line = fmt::format("{{\"t\":{},{},\"value\":", t, topic.words);
    appendFieldText(line, value, TextSyntax::json);
    line += '}';
    sink->write(std::move(line));
}

void Publisher::frame(double t) {
    for (State::Topic& topic : state_->topics) {
        if (!topic.waiting || t + kRoundingOfTimes < topic.next) continue;
        const Value value = std::move(*topic.waiting);
        state_->write(topic, value, topic.at);
        topic.next = t + 1 / state_->options.rate;
    }
}

double Publisher::nextAt() const {
    double next = std::numeric_limits<double>::infinity();
    for (const State::Topic& topic : state_->topics)
        if (topic.waiting) next = std::min(next, topic.next);
    return next;
}

void Publisher::close() {
    for (State::Topic& topic : state_->topics) {
        if (!topic.waiting) continue;
        const Value value = std::move(*topic.waiting);
        state_->write(topic, value, topic.at);
    }
    state_->sink->close();
}

const std::string& Publisher::target() const {
    return state_->at.text;
}

PublishCounts Publisher::counts() const {
    const feeds::SinkCounts sink = state_->sink->counts();
    return {state_->events, sink.lines, sink.missed, sink.subscribers};
}

std::vector<Diagnostic> Publisher::takeDiagnostics() {
    const std::string failure = state_->sink->failure();
    if (failure != state_->reported) {
        state_->reported = failure;
        state_->diagnostics.push_back(
            {Severity::warning, state_->at.text, {}, fmt::format("nothing more is written: {}", failure)});
    }
    return std::exchange(state_->diagnostics, {});
}

}  // namespace rtsg
