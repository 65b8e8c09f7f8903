// Checks and carries out requests of peers, joins those that come in parts, and remembers which were answered.
#include "upstream.h"

#include <algorithm>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/terminal.h>

#include "code_guard.h"
#include "codec/node_label.h"
#include "edit.h"
#include "request.h"

namespace rtsg::mirror {

namespace {

constexpr std::size_t kMaxClients = 256;
constexpr std::size_t kMaxAnswers = 256;   // kept for each client
constexpr std::size_t kMaxPending = 4096;  // for each client
constexpr std::size_t kLongestReason = 300;

/// Checks and carries out one submission. Provisional numbers of its new nodes are replaced as they are created.
class Request {
  public:
    Request(Scene& scene, MirrorUpstream permission, Verdict& verdict)
        : scene_(scene), permission_(permission), verdict_(verdict), guard_(scene) {}

    /// Checks a change without any effect.
    Result<> check(const Change& c);
    /// The change with the scene's numbers instead of provisional ones.
    Change real(const Change& c) const;
    /// Carries out `c`, which is real(asked).
    Result<> carryOut(const Change& asked, const Change& c, std::string_view author);

  private:
    Result<const NodeType*> typeOf(NodeId id) const;
    Result<> checkKind(const Change& c);
    Result<> checkCode(const Change& c);
    /// The thing that the origin loads when this field changes, such as "Inline.url"; empty if there is none.
    std::string loadedBy(NodeId id, FieldIndex field);
    Result<> checkField(NodeId id, FieldIndex field, const Value& value, bool event) const;
    NodeId real(NodeId id) const {
        const auto found = real_.find(id.value);
        return found == real_.end() ? id : found->second;
    }
    Value real(const Value& value) const;

    Scene& scene_;
    MirrorUpstream permission_;
    Verdict& verdict_;
    CodeGuard guard_;
    std::unordered_map<std::uint32_t, TypeIndex> types_;  // of the submission's new nodes
    std::unordered_map<std::uint32_t, NodeId> real_;
};

Result<const NodeType*> Request::typeOf(NodeId id) const {
    if (const auto own = types_.find(id.value); own != types_.end()) return &scene_.type(own->second);
    if (const Node* node = scene_.find(id)) return &node->type();
    return fail(fmt::format("no node {}", id.value));
}

Result<> Request::checkField(NodeId id, FieldIndex field, const Value& value, bool event) const {
    const auto owner = typeOf(id);
    if (!owner) return std::unexpected(owner.error());
    const NodeType& node = **owner;
    if (field >= node.fields.size() || node.fields[field].hidden)
        return fail(fmt::format("{} has no field {}", node.name, field));
    const FieldDef& def = node.fields[field];
    if (!def.holds(value))
        return fail(fmt::format("{}.{} is of type {}, not {}", node.name, def.name, def.typeName(), typeNameOf(value)));
    if (event ? !def.writable() : def.access == Access::outputOnly || def.access == Access::inputOnly)
        return fail(fmt::format("{}.{} cannot be {}", node.name, def.name, event ? "sent an event" : "set"));
    return {};
}

Result<> Request::check(const Change& c) {
    if (permission_ == MirrorUpstream::none) return fail("this peer may only follow");
    if (permission_ == MirrorUpstream::events && c.kind != ChangeKind::event)
        return fail("this peer may send events, not edit");
    if (auto ok = checkKind(c); !ok || permission_ == MirrorUpstream::code) return ok;
    return checkCode(c);
}

std::string Request::loadedBy(NodeId id, FieldIndex field) {
    if (const auto own = types_.find(id.value); own != types_.end())
        return nameIfLoading(scene_.type(own->second), field);  // a new node's routes are checked one by one
    return guard_.reachedFrom(id, field);
}

/// Precondition: checkKind(c). Changes that make the origin open files or run programs need a permission of their own.
Result<> Request::checkCode(const Change& c) {
    const bool route = c.kind == ChangeKind::addRoute || c.kind == ChangeKind::removeRoute;
    for (const NodeId id : {c.node, route ? c.other : NodeId{}}) {
        if (!id) continue;
        const auto type = typeOf(id);
        if (type && isScript(**type)) return fail("this peer may not touch Scripts");
    }
    const std::string reached = route ? loadedBy(c.other, c.field2()) : loadedBy(c.node, c.field);
    if (reached.empty()) return {};
    return fail(fmt::format("this peer may not change what the origin loads ({})", reached));
}

Result<> Request::checkKind(const Change& c) {
    const bool event = c.kind == ChangeKind::event;
    const auto known = [&](NodeId id) -> Result<> {
        const auto type = typeOf(id);
        return type ? Result<>{} : std::unexpected(type.error());
    };
    switch (c.kind) {
        case ChangeKind::event:
        case ChangeKind::setField:
            if (sf(c.value.type()) == FieldType::SFNode) {
                std::vector<NodeId> ids;
                if (c.value.holds<NodeId>())
                    ids.push_back(c.value.as<NodeId>());
                else
                    for (const NodeId id : c.value.as<Array<NodeId>>()) ids.push_back(id);
                for (const NodeId id : ids)
                    if (auto ok = id ? known(id) : Result<>{}; !ok) return ok;
            }
            return checkField(c.node, c.field, c.value, event);
        case ChangeKind::insertChild:
            if (auto ok = known(c.other); !ok) return ok;
            return checkField(c.node, c.field, Value(Array<NodeId>()), false);
        case ChangeKind::removeChild:
            return checkField(c.node, c.field, Value(Array<NodeId>()), false);
        case ChangeKind::createNode:
            if (c.node.value < kFirstProvisional) return fail("the origin gives nodes their numbers");
            if (c.index >= scene_.typeCount() || scene_.type(TypeIndex{static_cast<std::uint16_t>(c.index)}).internal)
                return fail(fmt::format("no node type {}", c.index));
            if (c.other) return fail("nodes of a PROTO's body or an Inline come from files only");
            types_[c.node.value] = TypeIndex{static_cast<std::uint16_t>(c.index)};
            return {};
        case ChangeKind::setName:
        case ChangeKind::destroyNode:
            return known(c.node);
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute:
            if (c.isConnection) return fail("IS connections come from files only");
            if (auto ok = known(c.node); !ok) return ok;
            return known(c.other);
        case ChangeKind::defineType:
            return fail("node types come from files only");
    }
    return fail("unknown kind of change");
}

Value Request::real(const Value& value) const {
    if (value.holds<NodeId>()) return real(value.as<NodeId>());
    if (!value.holds<Array<NodeId>>()) return value;
    Array<NodeId> ids = value.as<Array<NodeId>>();
    NodeId* target = ids.mutableData();
    for (std::size_t i = 0; i < ids.size(); ++i) target[i] = real(target[i]);
    return ids;
}

Change Request::real(const Change& c) const {
    Change result = c;
    result.node = real(c.node);
    result.other = real(c.other);
    result.value = real(c.value);
    return result;
}

Result<> Request::carryOut(const Change& asked, const Change& c, std::string_view author) {
    if (c.kind == ChangeKind::event) return scene_.sendEvent(c.node, c.field, c.value, author);
    if (c.kind != ChangeKind::createNode) return edit(scene_, c, author);
    const NodeId created = scene_.createNode(TypeIndex{static_cast<std::uint16_t>(c.index)});
    if (!created) return fail("no node could be created");
    real_[asked.node.value] = created;
    verdict_.created.emplace_back(asked.node.value, created.value);
    scene_.attribute(author, created);
    return {};
}

}  // namespace

void Verdict::write(ByteBuffer& out, std::uint64_t session) const {
    const std::uint64_t numbers[] = {session, request, state};
    mirror::write(out, Message::verdict, numbers);
    wire::putText(out, refusal);
    out.putVarint(created.size());
    for (const auto& [provisional, number] : created) {
        out.putVarint(provisional);
        out.putVarint(number);
    }
    wire::putText(out, kept);
}

bool Verdict::read(wire::Reader& in) {
    request = in.number<std::uint64_t>();
    state = in.number<std::uint64_t>();
    refusal = in.text();
    created.resize(in.count(2));
    for (auto& [provisional, number] : created) {
        provisional = in.varint32();
        number = in.varint32();
    }
    if (in.left() && !in.problem) kept = in.text();
    return !in.problem;
}

namespace {

std::string reason(const Scene& scene, const Change& change, const Diagnostic& why, std::string_view more = {}) {
    std::string text = why.text;
    if (const Node* node = scene.find(change.node); node && change.field < node->type().fields.size())
        text = fmt::format("{}.{}: {}", nodeLabel(scene, change.node), node->type().fields[change.field].name, text);
    return (text + std::string(more)).substr(0, kLongestReason);
}

/// Readers of a saved scene would refuse the whole file otherwise.
bool isReadable(const Value& value) {
    const auto readable = [](std::string_view text) { return asUtf8(text) == text; };
    if (value.type() == FieldType::SFString) return readable(value.as<String>().str());
    if (value.type() != FieldType::MFString) return true;
    return std::ranges::all_of(value.as<Array<String>>(), [&](const String& text) { return readable(text.str()); });
}

/// Afterwards `judge` has checked all of its changes.
Result<MirrorRequest> examine(const Scene& scene, const Submission& submission, Request& judge) {
    auto asked = readRequest(submission.record, submission.noTypes);
    if (!asked) return fail(("a malformed request: " + asked.error().text).substr(0, kLongestReason));
    asked->author = submission.author;
    if (asked->kind != MirrorRequest::Kind::changes && submission.permission < MirrorUpstream::edits)
        return fail(submission.permission == MirrorUpstream::none ? "this peer may only follow"
                                                                  : "this peer may send events, not edit");
    for (const Change& change : asked->changes) {
        if (!isReadable(change.value)) return fail("a text that is not UTF-8");
        if (auto fine = judge.check(change); !fine) return fail(reason(scene, change, fine.error()));
    }
    return asked;
}

/// Says which lock of another author the changes would break, by fields, names, routes or existence of nodes.
std::string lockedFor(const Scene& scene, std::span<const Change> changes, std::string_view author,
                      const NodeLocks& locks) {
    if (locks.empty()) return {};
    const auto now = locks.now();
    for (const Change& c : changes)
        if (std::string why = locks.refusal(scene, c, author, now); !why.empty()) return why;
    return {};
}

/// Returns true if there were events among the changes; they take effect with the next frame.
bool carryOutChanges(Scene& scene, const Submission& submission, std::span<const Change> changes, Request& request,
                     Writers& writers, Verdict& verdict) {
    bool events = false, begun = false;
    for (const Change& asked : changes) {
        const Change change = request.real(asked);
        writers.history.before(scene, change);
        if (auto done = request.carryOut(asked, change, submission.author); !done) {
            verdict.refusal =
                reason(scene, asked, done.error(), begun ? " (changes of the request before this one are made)" : "");
            writers.history.failed();
            break;
        }
        const bool isNew = change.kind == ChangeKind::createNode;
        writers.history.after(scene, isNew ? NodeId{verdict.created.back().second} : NodeId{});
        begun = true;
        writers.pointers.saw(scene, submission.client, change);
        events = events || change.kind == ChangeKind::event;
    }
    writers.history.end(submission.author, submission.permission);
    return events;
}

}  // namespace

Result<MirrorRequest> examine(Scene& scene, const Submission& submission) {
    Verdict unused;
    Request request(scene, submission.permission, unused);
    return examine(scene, submission, request);
}

RequestTouch touchOf(const Submission& submission) {
    RequestTouch touch;
    const auto asked = readRequest(submission.record, submission.noTypes);
    if (!asked) return touch;
    touch.eventsAlone = asked->kind == MirrorRequest::Kind::changes;
    touch.nodes = asked->nodes;
    for (const Change& change : asked->changes) {
        touch.eventsAlone &= change.kind == ChangeKind::event;
        touch.nodes.push_back(change.node);
        if (change.other) touch.nodes.push_back(change.other);
    }
    return touch;
}

Verdict carryOut(Scene& scene, const Submission& submission, Writers& writers) {
    Verdict verdict;
    verdict.client = submission.client;
    verdict.request = submission.request;
    verdict.state = scene.sequence();
    Request request(scene, submission.permission, verdict);
    const auto asked = examine(scene, submission, request);
    if (!asked) {
        verdict.refusal = asked.error().text;
        return verdict;
    }
    bool events = false;
    switch (asked->kind) {
        case MirrorRequest::Kind::changes:
            verdict.refusal = lockedFor(scene, asked->changes, submission.author, writers.locks);
            if (!verdict.refusal.empty()) return verdict;
            events = carryOutChanges(scene, submission, asked->changes, request, writers, verdict);
            break;
        case MirrorRequest::Kind::undo:
        case MirrorRequest::Kind::redo: {
            auto kept = writers.history.takeBack(scene, submission.author, asked->kind == MirrorRequest::Kind::redo,
                                                 submission.permission, writers.locks);
            if (kept)
                verdict.kept = kept->substr(0, kLongestReason);
            else
                verdict.refusal = kept.error().text.substr(0, kLongestReason);
            break;
        }
        case MirrorRequest::Kind::lock:
            if (auto ok = writers.locks.lock(scene, submission.author, asked->nodes, asked->lease, writers.locks.now());
                !ok)
                verdict.refusal = ok.error().text.substr(0, kLongestReason);
            break;
    }
    scene.seal();  // edits are published at once, events with the next frame
    verdict.state = scene.sequence() + (events ? 1 : 0);
    return verdict;
}

bool Assembly::add(std::uint64_t newRequest, std::uint64_t newSize, std::uint64_t offset,
                   std::span<const std::byte> part, const char*& problem) {
    problem = nullptr;
    if (newSize > kLongestSubmission || part.empty() || part.size() > newSize || offset > newSize - part.size()) {
        problem = "a part of a submission that does not fit in it";
        return false;
    }
    if (offset == 0) {
        request = newRequest;
        size = newSize;
        bytes.clear();
    }
    if (request != newRequest || size != newSize || offset != bytes.size()) {
        problem = "a part of a submission out of turn";
        return false;
    }
    bytes.insert(bytes.end(), part.begin(), part.end());
    return bytes.size() == size;
}

RequestLedger::Standing RequestLedger::standing(std::uint64_t client, std::uint64_t request, const Verdict*& verdict) {
    verdict = nullptr;
    const auto found = clients_.find(client);
    if (found == clients_.end()) return Standing::fresh;
    if (found->second.pending.contains(request)) return Standing::pending;
    const auto answer = std::ranges::find(found->second.answers, request, &Verdict::request);
    if (answer != found->second.answers.end()) verdict = &*answer;
    return verdict || request <= found->second.forgotten ? Standing::answered : Standing::fresh;
}

bool RequestLedger::begin(std::uint64_t client, std::uint64_t request) {
    if (!clients_.contains(client) && clients_.size() >= kMaxClients)
        clients_.erase(std::ranges::min_element(clients_, {}, [](const auto& c) { return c.second.used; }));
    Client& c = clients_[client];
    c.used = ++uses_;
    return c.pending.size() < kMaxPending && c.pending.insert(request).second;
}

void RequestLedger::answer(const Verdict& verdict) {
    const auto found = clients_.find(verdict.client);
    if (found == clients_.end()) return;
    Client& c = found->second;
    c.pending.erase(verdict.request);
    c.answers.push_back(verdict);
    if (c.answers.size() <= kMaxAnswers) return;
    c.forgotten = std::max(c.forgotten, c.answers.front().request);
    c.answers.pop_front();
}

}  // namespace rtsg::mirror
