// Parses requests of a mirror's user, sends those that are due, and reports the answers.
#include <rtsg/session/requests.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/documents/world.h>
#include <rtsg/session/moments.h>

#include "run/injections.h"

namespace rtsg {

namespace {

Diagnostic failed(const std::string& request, const std::string& why) {
    return {Severity::error, {}, {}, fmt::format("{}: {}", request, why)};
}

}  // namespace

Requests::Requests(RequestOptions options, SessionContext context)
    : options_(std::move(options)),
      context_(context),
      events_(std::make_unique<Injections>()),
      edits_(std::make_unique<Injections>()) {}
Requests::~Requests() = default;

Result<> Requests::parseEdits(Scene& replica) {
    auto parsed = Injections::parse(replica, options_.edit);
    if (!parsed && parsed.error().code == kUsageCode) return std::unexpected(parsed.error());
    if (!parsed) return fail("--edit " + parsed.error().text);
    *edits_ = std::move(*parsed);
    if (const Injections::Injection* event = edits_->findInput())
        return fail(fmt::format("--edit {}: the field takes events only: use --set", event->text));
    for (const auto& [texts, kind, option] : {std::tuple(&options_.undo, MirrorRequest::Kind::undo, "--undo"),
                                              std::tuple(&options_.redo, MirrorRequest::Kind::redo, "--redo")}) {
        for (const std::string& text : *texts) {
            const auto time = momentIn(text, replica.now());
            if (!time) return std::unexpected(time.error());
            takenBack_.emplace_back(*time, fmt::format("{} {}", option, text)).request.kind = kind;
        }
    }
    std::ranges::stable_sort(takenBack_, {}, &Timed::time);
    return {};
}

Result<> Requests::parseLocks(const Scene& replica) {
    for (const std::string& text : options_.lock) {
        const std::size_t at = text.rfind('@'), equals = text.rfind('=', at);
        if (at == std::string::npos || equals == std::string::npos || equals == 0)
            return fail(kUsageCode, "--lock: " + text + ": expected DEF[,DEF...]=LEASE@TIME");
        const auto time = momentIn(text.substr(at + 1), replica.now());
        if (!time) return std::unexpected(time.error());
        Timed lock{*time, "--lock " + text};
        lock.request.kind = MirrorRequest::Kind::lock;
        const auto lease = secondsIn(text.substr(equals + 1, at - equals - 1));
        if (!lease) return std::unexpected(lease.error());
        const double maximum = std::chrono::duration<double>(MirrorRequest::kLongestLease).count();
        if (*lease > maximum) return fail(kUsageCode, fmt::format("--lock: {}: {} s at most", text, maximum));
        lock.request.lease = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * *lease));
        for (std::size_t from = 0; from <= equals;) {
            const std::size_t comma = std::min(text.find(',', from), equals);
            lock.names.push_back(text.substr(from, comma - from));
            from = comma + 1;
        }
        if (const auto nodes = nodesOf(lock, replica); !nodes)
            return fail(fmt::format("{}: {}", lock.text, nodes.error().text));
        locks_.push_back(std::move(lock));
    }
    std::ranges::stable_sort(locks_, {}, &Timed::time);
    return {};
}

/// The nodes that have the names now.
Result<std::vector<NodeId>> Requests::nodesOf(const Timed& lock, const Scene& replica) {
    std::vector<NodeId> nodes;
    for (const std::string& name : lock.names) {
        const auto node = findNode(replica, name);
        if (!node) return std::unexpected(node.error());
        nodes.push_back(*node);
    }
    return nodes;
}

Result<> Requests::parse(Scene& replica) {
    replica_ = &replica;
    auto parsed = Injections::parse(replica, options_.set);
    if (!parsed) return std::unexpected(parsed.error());
    *events_ = std::move(*parsed);
    if (auto ok = parseEdits(replica); !ok) return ok;
    return parseLocks(replica);
}

void Requests::note(const Result<std::uint64_t>& request, std::string text) {
    ++(request ? sent : unsent);
    if (request)
        asked_.emplace(*request, std::move(text));
    else
        context_.report(failed(text, request.error().text));
}

void Requests::sendDue(MirrorClient& client, std::vector<Timed>& requests, std::size_t& next, double since) {
    for (; next < requests.size() && requests[next].time <= since; ++next) {
        Timed& due = requests[next];
        auto nodes = nodesOf(due, *replica_);
        if (nodes) due.request.nodes = std::move(*nodes);
        note(nodes ? client.submit(due.request) : std::unexpected(nodes.error()), due.text);
    }
}

void Requests::poll(MirrorClient& client, double since, double now) {
    sendDue(client, locks_, nextLock_, since);
    const auto submit = [&](const Injections::Injection& due, auto method) -> Result<std::uint64_t> {
        if (!replica_->find(due.target.node)) return fail("its node is no longer there");
        return (client.*method)(due.target.node, due.target.field, due.isNow ? Value(Time{now}) : due.value);
    };
    while (const Injections::Injection* due = edits_->next(since))
        note(submit(*due, &MirrorClient::submitEdit), "--edit " + due->text);
    while (const Injections::Injection* due = events_->next(since))
        note(submit(*due, &MirrorClient::submitEvent), "--set " + due->text);
    sendDue(client, takenBack_, nextTakenBack_, since);
    takeVerdicts(client);
}

void Requests::takeVerdicts(MirrorClient& client) {
    for (const MirrorVerdict& verdict : client.takeVerdicts()) {
        const auto asked = asked_.extract(verdict.request);
        const std::string text = asked ? asked.mapped() : fmt::format("request {}", verdict.request);
        if (!verdict.kept.empty()) context_.note(fmt::format("{}: left as it is: {}", text, verdict.kept));
        ++(verdict.refusal.empty() ? accepted : refused);
        if (!verdict.refusal.empty()) context_.report(failed(text, "refused: " + verdict.refusal));
    }
}

std::string Requests::firstUnsent() const {
    if (nextLock_ < locks_.size()) return locks_[nextLock_].text;
    if (const Injections::Injection* edit = edits_->waiting()) return "--edit " + edit->text;
    if (const Injections::Injection* event = events_->waiting()) return "--set " + event->text;
    return nextTakenBack_ < takenBack_.size() ? takenBack_[nextTakenBack_].text : std::string();
}

}  // namespace rtsg
