// Sends events of a feed to the scene: finds nodes and fields, checks, and merges what one frame cannot take.
#include <rtsg/feeds/feed.h>

#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/field_path.h>

#include "edits/code_guard.h"
#include "inlet.h"

namespace rtsg {

namespace {

constexpr double kSameTime = 1e-9;                       // seconds
constexpr auto kMaxTime = std::chrono::milliseconds(4);  // of a frame, for lines of a live source
constexpr double kNever = std::numeric_limits<double>::infinity();

struct Event {
    FieldRef target;
    Value value;
    std::string author;
    std::uint64_t line = 0;
};

std::uint64_t keyOf(const FieldRef& field) {
    return std::uint64_t{field.node.value} << 16 | field.field;
}

}  // namespace

struct Feed::State {
    State(Scene& fed, FeedOptions given, feeds::Endpoint endpoint, std::unique_ptr<feeds::LineSource> source)
        : scene(fed),
          options(std::move(given)),
          trusted(!endpoint.isSocket()),
          inlet(std::move(endpoint), std::move(source), options.call),
          timed(options.timed || inlet.isFile()) {}

    std::optional<Event> eventOf(const feeds::NumberedLine& line);
    std::optional<FieldRef> find(const feeds::NumberedLine& line);
    std::string refusal(const FieldRef& target);
    void deliver(double t);
    void add(Event event);
    void send();
    template <class Text>
    void fault(std::string_view kind, std::uint64_t line, DiagnosticCode code, Text&& text) {
        inlet.faults().add(kind, line, 0, code, std::forward<Text>(text));
    }

    Scene& scene;
    FeedOptions options;
    const bool trusted;  // the user's own file or pipe
    feeds::Inlet inlet;
    const bool timed;
    double time = 0;                                       // of the last line that had one
    std::optional<feeds::NumberedLine> early;              // it waits for its time
    std::vector<Event> batch;                              // of this frame
    std::unordered_map<std::uint64_t, std::size_t> slots;  // in `batch`
    std::deque<Event> putOff;
    std::uint64_t events = 0, merged = 0, flooded = 0, reportedFlooded = 0;
    std::optional<mirror::CodeGuard> guard;
    std::uint64_t guarded = 0;  // Scene::hearingEdits() that `guard` knows
};

Feed::Feed(std::unique_ptr<State> state) : state_(std::move(state)) {}
Feed::~Feed() = default;

Result<std::unique_ptr<Feed>> Feed::start(Scene& scene, FeedOptions options) {
    auto endpoint = feeds::Endpoint::parse(options.source);
    if (!endpoint) return std::unexpected(endpoint.error());
    auto source = feeds::LineSource::open(*endpoint, options.insecure);
    if (!source) return std::unexpected(source.error());
    return std::unique_ptr<Feed>(
        new Feed(std::make_unique<State>(scene, std::move(options), std::move(*endpoint), std::move(*source))));
}

/// Searches for similar names only if they will be reported, because the search is costly.
std::optional<FieldRef> Feed::State::find(const feeds::NumberedLine& line) {
    const std::string& name = line.line.node;
    NodeId node = scene.findName(name);
    if (!node && name.find_first_of("/#") != std::string::npos)
        if (const auto found = findNode(scene, name)) node = *found;
    const FieldIndex field = node ? scene.node(node).type().find(line.line.field) : kNoField;
    if (field != kNoField) return FieldRef{node, field};
    const auto why = [&] { return findField(scene, fmt::format("{}.{}", name, line.line.field)).error().text; };
    if (node)
        fault("field", line.number, DiagnosticCode("no-such-field"), why);
    else
        fault("node", line.number, DiagnosticCode("no-such-node"), why);
    return std::nullopt;
}

/// The file that the event would make the scene load, or the program that it would run; only the user's own files may
/// do so. Empty if the event is allowed.
std::string Feed::State::refusal(const FieldRef& target) {
    if (trusted) return {};
    const NodeType& type = scene.node(target.node).type();
    if (mirror::isScript(type)) return "feeds by sockets may not touch Scripts";
    if (!guard || std::exchange(guarded, scene.hearingEdits()) != scene.hearingEdits()) guard.emplace(scene);
    const std::string loads = guard->reachedFrom(target.node, target.field);
    return loads.empty() ? loads : fmt::format("feeds by sockets may not change what is loaded ({})", loads);
}

std::optional<Event> Feed::State::eventOf(const feeds::NumberedLine& line) {
    const auto target = find(line);
    if (!target) return std::nullopt;
    const FieldDef& def = scene.node(target->node).type().fields[target->field];
    const auto named = [&](const std::string& why) {
        return [&, why] { return fmt::format("{}.{}: {}", line.line.node, line.line.field, why); };
    };
    if (def.hidden || !def.writable()) {
        fault("access", line.number, DiagnosticCode("access"), named("it takes no events"));
        return std::nullopt;
    }
    auto value = feeds::valueOf(line.line, def.type, def.custom.get());
    if (!value) {
        fault("value", line.number, DiagnosticCode("wrong-type"), named(value.error().text));
        return std::nullopt;
    }
    if (const std::string why = refusal(*target); !why.empty()) {
        fault("code", line.number, DiagnosticCode("request-refused"), named(why));
        return std::nullopt;
    }
    return Event{*target, std::move(*value), line.line.author.empty() ? "feed" : line.line.author, line.number};
}

/// A field that has a value takes the newest. One that only takes events gets all, one a frame.
void Feed::State::add(Event event) {
    const auto [slot, isFirst] = slots.try_emplace(keyOf(event.target), batch.size());
    if (isFirst) return batch.push_back(std::move(event));
    const FieldDef& def = scene.node(event.target.node).type().fields[event.target.field];
    if (def.access != Access::inputOnly) {
        ++merged;
        batch[slot->second] = std::move(event);
    } else if (putOff.size() < kMaxPutOff) {
        putOff.push_back(std::move(event));
    } else {
        ++flooded;
    }
}

void Feed::State::send() {
    for (Event& event : batch) {
        // Its author's name is short; a node may be gone since the event was put off.
        const auto sent = scene.find(event.target.node)
                              ? scene.sendEvent(event.target.node, event.target.field, std::move(event.value),
                                                std::string_view(event.author).substr(0, 200))
                              : fail(DiagnosticCode("no-such-node"), "its node is no longer there");
        if (sent)
            ++events;
        else
            fault("event", event.line, sent.error().code, [&] { return sent.error().text; });
    }
    batch.clear();
    slots.clear();
}

void Feed::State::deliver(double t) {
    for (std::deque<Event> before = std::exchange(putOff, {}); Event & event : before)
        if (scene.find(event.target.node)) add(std::move(event));
    const auto end = std::chrono::steady_clock::now() + kMaxTime;
    for (std::size_t taken = 0; taken < kMaxWaiting; ++taken) {
        if (!early) early = inlet.take(timed, options.cancelled);
        if (!early) break;
        if (timed) {
            time = early->line.time.value_or(time);
            if (time > t + kSameTime) break;
        }
        if (auto event = eventOf(*std::exchange(early, std::nullopt))) add(std::move(*event));
        if (!timed && taken % 16 == 15 && std::chrono::steady_clock::now() > end) break;
    }
    send();
    const std::uint64_t left = flooded + inlet.flooded();
    if (left >= 2 * std::max<std::uint64_t>(reportedFlooded, 1) || (left > 0 && reportedFlooded == 0)) {
        reportedFlooded = left;
        inlet.faults().note(fmt::format("lines come faster than frames take them: {} left out by now", left));
    }
}

void Feed::deliver(double t) {
    state_->deliver(t);
}

double Feed::nextAt() const {
    if (!state_->putOff.empty()) return -kNever;
    if (!state_->timed) return state_->inlet.waits() ? -kNever : kNever;
    return state_->early ? state_->time : kNever;
}

const std::string& Feed::source() const {
    return state_->inlet.name();
}

FeedCounts Feed::counts() const {
    return {state_->inlet.lines(),
            state_->events,
            state_->merged,
            state_->inlet.faults().count(),
            state_->flooded + state_->inlet.flooded(),
            state_->inlet.isBroken()};
}

bool Feed::hasLeft() const {
    return state_->timed && state_->early.has_value();
}

std::vector<Diagnostic> Feed::takeDiagnostics() {
    return state_->inlet.faults().take();
}

}  // namespace rtsg
