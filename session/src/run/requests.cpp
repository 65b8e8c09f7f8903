// Parses requests of a mirror's user, sends those that are due, and reports the answers.
#include "requests.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>
#include <rtsg/documents/world.h>

#include "say.h"
#include "start_time.h"

namespace rtsg::app {

void RequestArguments::addTo(Command& command) {
    const Command::Section section(command, "Acting on the scene");
    command.addOption(
        "--set", set,
        "send an event to the origin: DEF.field=VALUE@TIME or pointer=...@TIME, in scene time since joining");
    command.addOption("--edit", edit, "change a field at the origin, DEF.field=VALUE@TIME; undo can take it back");
    command.addOption("--undo", undo, "TIME at which to take back the last request of edits by --name")->repeatable();
    command.addOption("--redo", redo, "TIME at which to do again what was taken back last")->repeatable();
    command.addOption("--lock", lock,
                      "lock nodes for --name, DEF[,DEF...]=LEASE@TIME: nobody else may change them for this time, 60s "
                      "at most; LEASE 0 unlocks");
}

Result<> Requests::parseEdits(Scene& replica) {
    auto parsed = Injections::parse(replica, arguments_.edit);
    if (!parsed) return fail("--edit " + parsed.error().text);
    edits_ = std::move(*parsed);
    if (const Injections::Injection* event = edits_.findInput())
        return fail(fmt::format("--edit {}: the field takes events only: use --set", event->text));
    for (const auto& [texts, kind, option] : {std::tuple(&arguments_.undo, MirrorRequest::Kind::undo, "--undo"),
                                              std::tuple(&arguments_.redo, MirrorRequest::Kind::redo, "--redo")}) {
        for (const std::string& text : *texts)
            takenBack_.emplace_back(parseMoment(text, replica.now()), fmt::format("{} {}", option, text)).request.kind =
                kind;
    }
    std::ranges::stable_sort(takenBack_, {}, &Timed::time);
    return {};
}

Result<> Requests::parseLocks(const Scene& replica) {
    for (const std::string& text : arguments_.lock) {
        const std::size_t at = text.rfind('@'), equals = text.rfind('=', at);
        if (at == std::string::npos || equals == std::string::npos || equals == 0)
            throw UsageError("--lock", text + ": expected DEF[,DEF...]=LEASE@TIME");
        Timed lock{parseMoment(text.substr(at + 1), replica.now()), "--lock " + text};
        lock.request.kind = MirrorRequest::Kind::lock;
        const double lease = parseSeconds(text.substr(equals + 1, at - equals - 1));
        const double most = std::chrono::duration<double>(MirrorRequest::kLongestLease).count();
        if (lease > most) throw UsageError("--lock", fmt::format("{}: {} s at most", text, most));
        lock.request.lease = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * lease));
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
    auto parsed = Injections::parse(replica, arguments_.set);
    if (!parsed) return std::unexpected(parsed.error());
    events_ = std::move(*parsed);
    if (auto ok = parseEdits(replica); !ok) return ok;
    return parseLocks(replica);
}

void Requests::note(const Result<std::uint64_t>& request, std::string text) {
    ++(request ? sent : unsent);
    if (request)
        asked_.emplace(*request, std::move(text));
    else
        printError(fmt::format("{}: {}", text, request.error().text));
}

void Requests::sendDue(MirrorClient& client, std::vector<Timed>& requests, std::size_t& next, double since) {
    for (; next < requests.size() && requests[next].time <= since; ++next) {
        Timed& due = requests[next];
        auto nodes = nodesOf(due, *replica_);
        if (nodes) due.request.nodes = std::move(*nodes);
        note(nodes ? client.submit(due.request) : std::unexpected(nodes.error()), due.text);
    }
}

void Requests::turn(MirrorClient& client, double since, double now) {
    sendDue(client, locks_, nextLock_, since);
    const auto submit = [&](const Injections::Injection& due, auto method) -> Result<std::uint64_t> {
        if (!replica_->find(due.target.node)) return fail("its node is no longer there");
        return (client.*method)(due.target.node, due.target.field, due.isNow ? Value(Time{now}) : due.value);
    };
    while (const Injections::Injection* due = edits_.next(since))
        note(submit(*due, &MirrorClient::submitEdit), "--edit " + due->text);
    while (const Injections::Injection* due = events_.next(since))
        note(submit(*due, &MirrorClient::submitEvent), "--set " + due->text);
    sendDue(client, takenBack_, nextTakenBack_, since);
    takeVerdicts(client);
}

void Requests::takeVerdicts(MirrorClient& client) {
    for (const MirrorVerdict& verdict : client.takeVerdicts()) {
        const auto asked = asked_.extract(verdict.request);
        const std::string text = asked ? asked.mapped() : fmt::format("request {}", verdict.request);
        if (!verdict.kept.empty())
            tellError("{}\n", terminalText(fmt::format("{}: left as it is: {}", text, verdict.kept)));
        ++(verdict.refusal.empty() ? accepted : refused);
        if (!verdict.refusal.empty()) printError(fmt::format("{}: refused: {}", text, verdict.refusal));
    }
}

std::string Requests::firstUnsent() const {
    if (nextLock_ < locks_.size()) return locks_[nextLock_].text;
    if (const Injections::Injection* edit = edits_.waiting()) return "--edit " + edit->text;
    if (const Injections::Injection* event = events_.waiting()) return "--set " + event->text;
    return nextTakenBack_ < takenBack_.size() ? takenBack_[nextTakenBack_].text : std::string();
}

}  // namespace rtsg::app
