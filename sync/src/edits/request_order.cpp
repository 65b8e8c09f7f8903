// Decides which requests of peers are carried out now, and which wait for earlier events.
#include "request_order.h"

#include <algorithm>
#include <utility>

namespace rtsg::mirror {

namespace {

constexpr auto kLongestWait = std::chrono::milliseconds(250);

bool anyOf(const std::vector<NodeId>& nodes, const std::set<NodeId>& among) {
    return std::ranges::any_of(nodes, [&](NodeId node) { return among.contains(node); });
}

}  // namespace

void RequestOrder::add(std::vector<Submission> submissions) {
    const auto now = writers_.locks.now();
    for (Submission& submission : submissions) waiting_.push_back({std::move(submission), now, {}});
}

/// Computed only when another request depends on it, as mostly nothing waits.
const RequestTouch& RequestOrder::touch(Waiting& request) {
    if (!request.touch) request.touch = touchOf(request.submission);
    return *request.touch;
}

bool RequestOrder::mustWait(Waiting& request, Clock::time_point now) {
    if ((events_.empty() && heldClients_.empty()) || now - request.since >= kLongestWait) return false;
    const auto& [eventsAlone, nodes] = touch(request);
    if (heldClients_.contains(request.submission.client) || anyOf(nodes, heldNodes_)) return true;
    return !eventsAlone && (eventClients_.contains(request.submission.client) || anyOf(nodes, eventNodes_));
}

void RequestOrder::note(Waiting& held) {
    const std::vector<NodeId>& nodes = touch(held).nodes;
    heldClients_.insert(held.submission.client);
    heldNodes_.insert(nodes.begin(), nodes.end());
}

std::vector<Verdict> RequestOrder::carryOut() {
    std::vector<Verdict> verdicts;
    heldClients_.clear();
    heldNodes_.clear();
    const auto now = writers_.locks.now();
    for (std::size_t left = waiting_.size(); left > 0; --left) {
        Waiting request = std::move(waiting_.front());
        waiting_.pop_front();
        if (mustWait(request, now)) {
            note(request);
            waiting_.push_back(std::move(request));
            continue;
        }
        Verdict verdict = mirror::carryOut(scene_, request.submission, writers_);
        if (verdict.state <= scene_.sequence()) {
            verdicts.push_back(std::move(verdict));
            continue;
        }
        events_.push_back(std::move(verdict));
        queuedAt_ = scene_.now();
        eventClients_.insert(request.submission.client);
        const std::vector<NodeId>& nodes = touch(request).nodes;
        eventNodes_.insert(nodes.begin(), nodes.end());
    }
    return verdicts;
}

/// A set of edits alone has the time of the last frame, and no events.
std::vector<Verdict> RequestOrder::happened(const ChangeSet& changes) {
    const auto isEvent = [](const Change& change) { return change.kind == ChangeKind::event; };
    if (events_.empty() || (changes.time == queuedAt_ && std::ranges::none_of(changes.changes, isEvent))) return {};
    eventClients_.clear();
    eventNodes_.clear();
    std::vector<Verdict> verdicts = std::exchange(events_, {});
    for (Verdict& verdict : verdicts) verdict.state = changes.to;
    return verdicts;
}

bool RequestOrder::holds(std::uint64_t client) const {
    return std::ranges::any_of(waiting_, [&](const Waiting& w) { return w.submission.client == client; });
}

std::uint64_t RequestOrder::bytes() const {
    std::uint64_t sum = 0;
    for (const Waiting& request : waiting_) sum += request.submission.record.size();
    return sum;
}

}  // namespace rtsg::mirror
