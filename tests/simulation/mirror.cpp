// What mirrors, relays and strangers do, and what has to hold for each.
#include "mirror.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "sockets/message.h"

namespace rtsg::simulation {

using namespace std::chrono_literals;

void EditLedger::answer(const std::string& name, const MirrorVerdict& verdict, std::uint32_t lineage) {
    Edit& edit = edits_[name];
    edit.lineage = lineage;
    edit.at = verdict.state;
    // Nobody knows which of a server's last requests were carried out if it started over, or if a relay was lost.
    const bool isSure = verdict.refusal.find("started over") == std::string::npos &&
                        verdict.refusal.find("other node types") == std::string::npos;
    edit.state = verdict.refusal.empty() ? State::accepted : isSure ? State::refused : State::unknown;
}

void EditLedger::forgetAfter(std::uint64_t state, std::uint32_t lineage) {
    for (auto& [name, edit] : edits_)
        if (edit.state == State::accepted && (edit.lineage != lineage || edit.at > state)) edit.state = State::unknown;
}

std::string EditLedger::check(const Scene& scene, std::uint32_t lineage) const {
    std::map<std::string, int, std::less<>> found;
    scene.forEachNode([&](const Node& node) {
        if (node.type().name != "WorldInfo") return;
        // Not the name of the node, which another node can take over.
        const std::string title(node.get(x3d::WorldInfo::title).view());
        if (title.starts_with("EDIT")) ++found[title];
    });
    for (const auto& [name, edit] : edits_) {
        const auto entry = found.find(name);
        const int count = entry == found.end() ? 0 : entry->second;
        if (count > 1) return fmt::format("the edit {} was carried out {} times", name, count);
        if (edit.state == State::accepted && edit.lineage == lineage && count == 0)
            return fmt::format("the edit {}, acknowledged for state {}, is lost", name, edit.at);
        if (edit.state == State::refused && count > 0)
            return fmt::format("the edit {} was refused, and is there", name);
    }
    return {};
}

bool Mirror::isWhole() const {
    return settings_.kind != MirrorSettings::Kind::part && settings_.kind != MirrorSettings::Kind::region &&
           settings_.kind != MirrorSettings::Kind::aspects;
}

void Mirror::start() {
    replica_ = std::make_unique<Scene>();
    MirrorClientOptions options = settings_.options;
    options.transport = network_.transportOf(*this);
    client_ = *MirrorClient::connect(*replica_, settings_.endpoint, std::move(options));
    if (settings_.kind == MirrorSettings::Kind::optimistic)
        optimistic_ = std::make_unique<OptimisticScene>(*client_, *replica_);
    due = clock.at();
    startAt = 0;
    asked_.clear();
    certain_.clear();
    isMeddledWith_ = false;
    divergences_ = 0;
}

void Mirror::die() {
    if (!client_) return;
    network_.kill(*this, false);
    leave();
}

void Mirror::leave() {
    optimistic_.reset();
    client_.reset();
    replica_.reset();
}

std::string Mirror::status() const {
    if (!client_) return "not running";
    const MirrorStatistics& s = client_->statistics();
    std::string text = fmt::format(
        "mirror {} of kind {} at {}: state {} of {}, equal {}, in step {}, lost {}, left {}, unanswered {}, snapshots "
        "{}, gaps {}, "
        "restarts {}, refusal '{}'",
        settings_.number, static_cast<int>(settings_.kind), settings_.endpoint, s.sequence, s.originSequence, s.equal,
        client_->inStep(), client_->originLost(), client_->serverLeft(), client_->unanswered(), s.snapshots, s.gaps,
        s.restarts, client_->refusal());
    if (optimistic_) {
        text += fmt::format(", {} fields wait", optimistic_->waiting());
        const std::string shown = optimistic_->scene().dump(), own = replica_->dump();
        const auto a = std::ranges::mismatch(shown, own).in1;
        if (shown != own) {
            const auto at = static_cast<std::size_t>(a - shown.begin());
            text += fmt::format("; shown '{}', replica '{}'", shown.substr(at > 60 ? at - 60 : 0, 120),
                                own.substr(at > 60 ? at - 60 : 0, 120));
        }
    }
    for (const Diagnostic& d : client_->takeDiagnostics()) text += "\n    " + d.format();
    return text;
}

std::string Mirror::poll(const Origin& origin) {
    if (optimistic_)
        optimistic_->poll();
    else
        client_->poll();
    due = clock.at() + clock.worldFromLocal(std::max<std::chrono::milliseconds>(client_->waiting().maximum, 1ms));
    const MirrorStatistics& s = client_->statistics();
    if (isMeddledWith_) {
        divergences_ = s.divergences;
        isMeddledWith_ = !(client_->inStep() && s.equal && replica_->hash() == s.originHash);
        return takeVerdicts(origin);
    }
    if (s.divergences > divergences_) return "a replica has diverged: " + status();
    if (s.garbage > 0) return "a mirror got what makes no sense: " + status();
    if (s.frames > 0 && replica_->sequence() > 0) {
        if (isInStates() && !origin.witness.saw(replica_->sequence(), replica_->hash()))
            return fmt::format("a replica in state {} has a hash that the origin never had there: {}",
                               replica_->sequence(), status());
        if (s.sequence > 0 && !s.equal) return "a replica has another hash than its origin: " + status();
    }
    return takeVerdicts(origin);
}

std::string Mirror::takeVerdicts(const Origin& origin) {
    for (const MirrorVerdict& verdict : optimistic_ ? optimistic_->takeVerdicts() : client_->takeVerdicts()) {
        const auto found = asked_.find(verdict.request);
        if (verdict.refusal.empty() && client_->statistics().sequence < verdict.state)
            return fmt::format("a verdict for state {} came before it: {}", verdict.state, status());
        if (certain_.erase(verdict.request) > 0 && verdict.refusal.find("locked") != std::string::npos)
            return fmt::format("an edit was refused though nobody holds its node: {}: {}", verdict.refusal, status());
        if (found == asked_.end()) continue;
        ledger_.answer(found->second, verdict, origin.lineage);
        if (verdict.refusal.empty() && isWhole() && !replica_->findName(found->second))
            return fmt::format("the edit {} was acknowledged, and its replica does not have it: {}", found->second,
                               status());
        asked_.erase(found);
    }
    return {};
}

void Mirror::editAll(std::uint32_t movers) {
    for (std::uint32_t i = 0; i < movers; ++i)
        if (const NodeId mover = replica_->findName(fmt::format("MOVER{}", i)))
            if (const auto request =
                    client_->submitEdit(mover, x3d::Transform::scale.index, Vec3f(1, 1, 1 + float(settings_.number))))
                certain_.insert(*request);
    isDue(clock.at());
}

void Mirror::meddle(Random random, std::uint32_t movers) {
    if (!client_) return;
    const NodeId mover = replica_->findName(fmt::format("MOVER{}", random.below(movers)));
    if (mover) isMeddledWith_ = bool(replica_->set(mover, x3d::Transform::scale, Vec3f(7, float(random.below(99)), 7)));
}

void Mirror::edit(Random random, std::uint32_t movers) {
    if (!client_ || client_->unanswered() > 20) return;
    const NodeId mover = replica_->findName(fmt::format("MOVER{}", random.below(movers)));
    ++edits;
    if (!settings_.undoes && random.chance(500)) {
        const std::string name = fmt::format("EDIT{}_{}", settings_.number, next_++);
        Change created, titled, named;
        created.kind = ChangeKind::createNode;
        created.node = titled.node = named.node = client_->newNode();
        created.index = x3d::WorldInfo::type.value;
        titled.field = x3d::WorldInfo::title.index;
        titled.value = String(name);
        named.kind = ChangeKind::setName;
        named.value = String(name);
        ledger_.ask(name);
        if (const auto request = client_->submit(std::vector{created, titled, named})) asked_[*request] = name;
        return;
    }
    if (random.chance(50)) return (void)client_->control("pause");  // no log is played: it is refused
    if (!mover) return;
    if (settings_.undoes && random.chance(400)) return (void)(random.chance(700) ? client_->undo() : client_->redo());
    if (settings_.locks && random.chance(300))
        return (void)client_->lock({mover}, std::chrono::milliseconds(random.below(3) * 900));
    const Vec3f value(float(random.below(999)), float(settings_.number), 2);
    if (optimistic_)
        (void)optimistic_->edit(mover, x3d::Transform::translation.index, value);
    else if (random.chance(500))
        (void)client_->submitEdit(mover, x3d::Transform::translation.index, value);
    else
        (void)client_->submitEvent(mover, x3d::Transform::translation.index, value);
}

bool Mirror::isSettled(const Origin& origin) const {
    if (!client_ || !client_->inStep() || client_->unanswered() > 0 || !client_->statistics().equal) return false;
    if (client_->statistics().sequence != origin.served().sequence()) return false;
    if (optimistic_ && (optimistic_->waiting() > 0 || optimistic_->scene().hash() != replica_->hash())) return false;
    return !isWhole() || replica_->hash() == origin.served().hash();
}

void Relay::start() {
    replica_ = std::make_unique<Scene>();
    MirrorClientOptions from;
    MirrorServerOptions to;
    from.transport = to.transport = network_.transportOf(*this);
    from.name = endpoint_;
    to.upstream = upstream_;
    relay_ = *MirrorRelay::connect(*replica_, from_, endpoint_, std::move(from), std::move(to));
    due = clock.at();
    startAt = 0;
}

void Relay::die() {
    if (!relay_) return;
    network_.kill(*this, false);
    relay_.reset();
    replica_.reset();
}

std::string Relay::poll(const Origin& origin) {
    if (const auto ok = relay_->poll(); !ok) return "a relay cannot serve: " + ok.error().format();
    due =
        clock.at() + std::min<Nanoseconds>(20 * kMillisecond, clock.worldFromLocal(std::max<std::chrono::milliseconds>(
                                                                  relay_->client().waiting().maximum, 1ms)));
    if (relay_->client().statistics().frames > 0 && replica_->sequence() > 0 &&
        !origin.witness.saw(replica_->sequence(), replica_->hash()))
        return fmt::format("the relay {} in state {} has a hash that the origin never had there", endpoint_,
                           replica_->sequence());
    return {};
}

bool Relay::isSettled(const Origin& origin) const {
    return relay_ && relay_->client().inStep() && relay_->server() && replica_->hash() == origin.served().hash();
}

void Stranger::send(Random random, std::uint32_t count, const std::string& endpoint) {
    if (!connection_ || random.chance(100)) connection_ = *network_.transportOf(*this)->connect(endpoint, {});
    while (connection_->nextEvent() != Connection::Event::none) continue;
    mirror::Hello hello;
    hello.session = random.next();
    hello.window = random.next() >> random.below(64);
    hello.name = std::string(random.below(40), 'x');
    hello.wishes.client = random.next();
    hello.wishes.inputs = random.chance(300);
    hello.wishes.whenSlow = static_cast<std::uint8_t>(random.below(5));
    hello.epoch = random.next();
    ByteBuffer message;
    for (std::uint32_t i = 0; i < count; ++i) {
        if (i == 0 || random.chance(50)) {
            hello.write(message);
        } else {
            mirror::begin(message, static_cast<mirror::Message>(random.below(24)));
            if (random.chance(800)) message.put(hello.session);
            for (std::uint32_t n = random.below(6); n > 0; --n) message.put(random.next() >> random.below(64));
        }
        if (random.chance(300) && message.size() > 0)
            message.data()[random.below(static_cast<std::uint32_t>(message.size()))] ^=
                std::byte(1 + random.below(255));
        const std::size_t cut =
            random.chance(100) ? random.below(static_cast<std::uint32_t>(message.size()) + 1) : message.size();
        std::vector<std::byte> second(random.chance(300) ? random.below(300) : 0);
        for (std::byte& byte : second) byte = std::byte(random.below(256));
        if (!connection_->send(message.bytes().first(cut), second)) break;
    }
    due = clock.at() + kMillisecond;
}

void Stranger::poll() {
    due = clock.at() + kSecond;
    if (!connection_) {
        due = kNever;
        return;
    }
    while (connection_->nextEvent() != Connection::Event::none) continue;
    Received lost;
    while (connection_->receive(lost)) continue;
}

}  // namespace rtsg::simulation
