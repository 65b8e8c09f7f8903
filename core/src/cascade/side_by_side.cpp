// Parts of a cascade side by side on several threads. Each part notes what it does in a lane of its own; the notes are
// put behind each other as one thread would have made them, so nothing tells afterwards how many there were.
//
// Time: the nodes that are due are cut into pieces of as many. Routes: the emissions at hand are cut into stretches, by
// the part to which what hangs behind them belongs (division.h). One thread would take all stretches' emissions in
// turn, then all that these led to, and so on: so the notes of each such turn are kept apart.
#include <algorithm>
#include <atomic>
#include <unordered_set>
#include <utility>

#include "state/state.h"

namespace rtsg {

namespace {

/// One of as many pieces of about the same length.
std::span<const NodeId> fractionOf(std::span<const NodeId> nodes, unsigned part, unsigned parts) {
    const std::size_t each = (nodes.size() + parts - 1) / parts, first = std::min(part * each, nodes.size());
    return nodes.subspan(first, std::min(each, nodes.size() - first));
}

}  // namespace

ThreadTeam* Scene::State::teamFor(std::uint64_t expectedWork) {
    constexpr unsigned kMax = 8;
    if (threadsAsked < 2 || expectedWork < kWorthDividing) return nullptr;
    if (!team) {
        team = std::make_unique<ThreadTeam>(std::min(threadsAsked, kMax));
        for (unsigned i = static_cast<unsigned>(lanes.size()); i < team->parts(); ++i) {
            lanes.push_back(std::make_unique<Lane>());
            lanes.back()->isBeside = true;
            lanes.back()->laneNumber = i + 1;
        }
    }
    return team.get();
}

void Scene::State::callTeam() {
    // The first round decides, since every frame has one: if nothing happens any more, no helper wakes.
    if (team && std::max(roundWork[0].ticks, roundWork[0].routes) >= kWorthDividing) team->attend();
}

bool Scene::State::mayDivide() const {
    return !listener && childOpCounts.empty() && currentCall == kNoCall && playDepth == 0;
}

void Scene::State::beginBeside(Lane& lane) {
    lane.writingExternally = writingExternally;
    lane.touched = 0;
    lane.work = 0;
    lane.marks.clear();
}

void Scene::State::mark(Lane& lane) {
    endPiece(lane);
    lane.marks.push_back({lane.pieces.size(), lane.emissions.size(), lane.heard.size(), lane.woken.size(),
                          lane.moved.size(), lane.complaints.size()});
}

void Scene::State::takeOver(Lane& lane, std::size_t number) {
    const Lane::Mark from = number ? lane.marks[number - 1] : Lane::Mark{}, to = lane.marks[number];
    for (std::size_t i = from.pieces; i < to.pieces; ++i) written->append(lane.pieces[i].piece, lane.pieces[i].slot);
    for (std::size_t i = from.heard; i < to.heard; ++i) heard.push_back(std::move(lane.heard[i]));
    for (std::size_t i = from.woken; i < to.woken; ++i) woken.push_back(lane.woken[i]);
    for (std::size_t i = from.moved; i < to.moved; ++i) worldTransforms.noteMoved(lane.moved[i]);
    for (std::size_t i = from.complaints; i < to.complaints; ++i)
        warn(*lane.complaints[i].node, lane.complaints[i].text);
}

void Scene::State::endBeside(Lane& lane) {
    touched |= lane.touched;
    work += lane.work;
    lane.pieces.clear();
    lane.emissions.clear();
    lane.heard.clear();
    lane.woken.clear();
    lane.moved.clear();
    lane.complaints.clear();
}

// ---- time -------------------------------------------------------------------------------------------------------

Scene::State::Local Scene::State::areLocal(std::span<const NodeId> nodes) const {
    Local all = Local::untilEdited;
    for (const NodeId id : nodes) {
        const Node* node = find(id);
        if (!node) {
            all = Local::now;  // a set that is applied may bring one of this number
            continue;
        }
        const Behaviour& behaviour = types[node->typeIndex_.value].behaviour;
        const bool here = isLocal(behaviour) && behaviour.beyond == kNoField;
        if (behaviour.onTime && !here && !(behaviour.last && !asksLast)) return Local::no;
    }
    return all;
}

bool Scene::State::areKnownLocal(std::span<const NodeId> nodes) const {
    return localAt == linkEdits && localLast == asksLast && nodes.size() == localNodes.size() &&
           std::memcmp(nodes.data(), localNodes.data(), nodes.size_bytes()) == 0;
}

bool Scene::State::areLocalBeside(std::span<const NodeId> nodes, ThreadTeam& some) {
    if (areKnownLocal(nodes)) return true;
    std::atomic<Local> all{Local::untilEdited};
    some.run([&](unsigned part) {
        if (all.load(std::memory_order_relaxed) == Local::no) return;
        const Local own = areLocal(fractionOf(nodes, part, some.parts()));
        Local before = all.load(std::memory_order_relaxed);
        while (own < before && !all.compare_exchange_weak(before, own, std::memory_order_relaxed)) {
        }
    });
    localNodes.clear();
    if (all == Local::untilEdited) {
        localNodes.assign(nodes.begin(), nodes.end());
        localAt = linkEdits;
        localLast = asksLast;
    }
    return all != Local::no;
}

void Scene::State::tickAll(Cascade& cascade, std::span<const NodeId> nodes, std::size_t round) {
    const std::uint64_t before = work;
    const bool isEarly = round < roundWork.size();
    const std::uint64_t likely = isEarly ? std::max<std::uint64_t>(nodes.size(), roundWork[round].ticks) : 0;
    ThreadTeam* some = nodes.size() > 1 && mayDivide() ? teamFor(likely) : nullptr;
    if (!some || !tickBeside(cascade, nodes, *some)) tick(cascade, nodes);
    if (isEarly) roundWork[round].ticks = work - before;
}

bool Scene::State::tickBeside(Cascade& cascade, std::span<const NodeId> nodes, ThreadTeam& some) {
    if (!areLocalBeside(nodes, some)) return false;
    endPiece(*this);
    some.run([&](unsigned part) {
        Lane& lane = *lanes[part];
        beginBeside(lane);
        Cascade own(owner, now, cascade.previous(), lane);
        tick(own, fractionOf(nodes, part, some.parts()));
        mark(lane);
        lane.ticked.swap(lane.emissions);
        lane.tickedAsLaidOut = isLaidOut(part + 1, lane.ticked);
    });
    const auto move = [](auto& from, auto& to) {
        to.insert(to.end(), from.begin(), from.end());
        from.clear();
    };
    for (unsigned part = 0; part < some.parts(); ++part) {
        Lane& lane = *lanes[part];
        takeOver(lane, 0);
        emissionRuns.push_back(&lane.ticked);
        move(lane.nextActive, nextActive);
        move(lane.watchers, watchers);
        move(lane.late, late);
        move(lane.goToSleep, goToSleep);
        endBeside(lane);
    }
    return true;
}

// ---- routes -----------------------------------------------------------------------------------------------------

/// Whether an event may be delivered there on another thread.
bool Scene::State::mayReachBeside(const Node& node, FieldIndex field) const {
    const TypeEntry& entry = types[node.typeIndex_.value];
    if (sf(node.type_->slot(field).type) == FieldType::SFNode) return false;
    if (!entry.behaviour.accepts && !entry.behaviour.onEvent) return true;
    return isLocal(entry.behaviour) && entry.behaviour.beyond != field;
}

/// All routes that lead on from `sources`. False if an event would get to what only the scene's thread may do.
bool Scene::State::gatherEdges(std::vector<Division::Edge>& edges) const {
    std::unordered_set<std::uint32_t> seen;
    std::vector<NodeId> waiting;
    const auto visit = [&](NodeId id) {
        if (seen.insert(id.value).second) waiting.push_back(id);
    };
    for (const NodeId id : sources) visit(id);
    for (std::size_t i = 0; i < waiting.size(); ++i) {
        const Node* node = find(waiting[i]);
        if (!node || !node->links_) continue;
        for (const RouteGroup& group : node->links_->out)
            for (const OutgoingRoute& route : group.targets.items()) {
                const Node* target = route.to.node ? find(route.to.node) : nullptr;
                if (!target) continue;
                if (!mayReachBeside(*target, route.to.field)) return false;
                edges.push_back({node->id_, target->id_});
                visit(target->id_);
            }
    }
    return true;
}

bool Scene::State::divideAnew(unsigned parts) {
    if (dividedAt != linkEdits) sources.clear();
    for (const auto* run : emissionRuns)
        for (const Emission& emission : *run) sources.push_back(emission.node);
    std::ranges::sort(sources);
    sources.erase(std::unique(sources.begin(), sources.end()), sources.end());
    std::erase_if(sources, [&](NodeId id) { return !find(id); });
    dividedAt = linkEdits;
    std::vector<Division::Edge> edges;
    if (gatherEdges(edges) && division.divide(sources, edges, parts)) return true;
    division.clear();
    sources.clear();
    laidOut.clear();
    return false;
}

bool Scene::State::extendStretches(std::size_t run, std::size_t number) {
    const Emission& emission = (*emissionRuns[run])[number];
    const auto extend = [&](unsigned part, std::size_t firstTarget, std::size_t endTarget) {
        if (stretches.empty() || stretches.back().part != part || stretches.back().run != run)
            stretches.push_back({.part = part, .run = run, .first = number, .firstTarget = firstTarget});
        stretches.back().last = number;
        stretches.back().endTarget = endTarget;
    };
    const std::uint8_t part = division.partOf(emission.node);
    if (part == Division::kNone || emission.linkEdits != linkEdits) return false;
    if (part != Division::kSeveral) {
        extend(part, 0, SIZE_MAX);
        return true;
    }
    if (!emission.group) return true;
    const auto& outgoing = emission.group->targets.items();
    const auto isNew = [&] {
        return stretches.empty() || stretches.back().last != number || stretches.back().run != run;
    };
    for (std::size_t i = 0; i < outgoing.size(); ++i) {
        if (!outgoing[i].to.node) continue;
        const std::uint8_t one = division.partOf(outgoing[i].to.node);
        if (one >= Division::kSeveral) return false;
        extend(one, isNew() ? 0 : i, i + 1);
    }
    if (isNew()) extend(stretches.empty() ? 0 : stretches.back().part, 0, SIZE_MAX);  // for those who listen
    return true;
}

bool Scene::State::isLaidOut(std::size_t run, const std::vector<Emission>& sentNow) const {
    const auto isSame = [&](const Emission& a, const Emission& b) {
        return a.node == b.node && a.group == b.group && a.linkEdits == linkEdits;
    };
    return run < laidOut.size() && std::ranges::equal(sentNow, laidOut[run], isSame);
}

/// The lanes beside the scene's have already compared their own emissions.
bool Scene::State::areLaidOut() const {
    if (emissionRuns.size() != laidOut.size() || !isLaidOut(0, *emissionRuns[0])) return false;
    for (std::size_t run = 1; run < emissionRuns.size(); ++run)
        if (!lanes[run - 1]->tickedAsLaidOut) return false;
    return true;
}

void Scene::State::joinEmissions() {
    for (std::size_t run = 1; run < emissionRuns.size(); ++run) {
        std::vector<Emission>& sent = lanes[run - 1]->ticked;
        emissions.insert(emissions.end(), sent.begin(), sent.end());
        sent.clear();
    }
    emissionRuns.assign(1, &emissions);
}

bool Scene::State::layOutStretches(unsigned parts) {
    constexpr unsigned kPatience = 2, kMaxPatience = 64, kStretchesPerPart = 16;
    const auto layOut = [&] {
        stretches.clear();
        for (std::size_t run = 0; run < emissionRuns.size(); ++run)
            for (std::size_t i = 0; i < emissionRuns[run]->size(); ++i)
                if (!extendStretches(run, i) || stretches.size() > std::size_t{kStretchesPerPart} * parts) {
                    laidOut.clear();
                    return false;
                }
        laidOut.resize(emissionRuns.size());
        for (std::size_t run = 0; run < emissionRuns.size(); ++run) laidOut[run] = *emissionRuns[run];
        return true;
    };
    if (dividedAt == linkEdits && (areLaidOut() || layOut())) {
        if (++fullRounds == kMaxPatience) patience = kPatience;
        return stretches.size() > 1;
    }
    // Dividing costs about as much as a frame, so it is not tried each time if it does not last.
    fullRounds = 0;
    if (untilDivided > 0) {
        --untilDivided;
        return false;
    }
    patience = std::min(2 * patience, kMaxPatience);
    untilDivided = patience;
    return divideAnew(parts) && layOut() && stretches.size() > 1;
}

void Scene::State::runStretches(Cascade& cascade, Lane& lane, std::span<const std::size_t> own) {
    for (const std::size_t i : own) {
        const Stretch one = stretches[i];
        sendAlong(cascade, *emissionRuns[one.run], one.first, one.last + 1, one.firstTarget, one.endTarget);
        mark(lane);
    }
    // Then follow the events that these led to, each turn after the whole turn before it.
    std::size_t sent = 0;
    for (std::size_t number = 0; sent < lane.emissions.size();) {
        for (std::size_t k = 0; k < own.size(); ++k, ++number) {
            const std::size_t end = lane.marks[number].emissions;
            sendAlong(cascade, lane.emissions, sent, end);
            sent = end;
            mark(lane);
        }
    }
}

bool Scene::State::runRoutesBeside(Cascade& cascade, ThreadTeam& some) {
    if (!layOutStretches(some.parts())) return false;
    stretchesOf.resize(some.parts());
    for (auto& own : stretchesOf) own.clear();
    std::vector<std::size_t> numberOfOwn;
    for (std::size_t i = 0; i < stretches.size(); ++i) {
        auto& own = stretchesOf[stretches[i].part];
        numberOfOwn.push_back(own.size());
        own.push_back(i);
    }
    endPiece(*this);
    some.run([&](unsigned part) {
        if (stretchesOf[part].empty()) return;
        Lane& lane = *lanes[part];
        beginBeside(lane);
        Cascade own(owner, now, cascade.previous(), lane);
        runStretches(own, lane, stretchesOf[part]);
    });
    bool any = true;
    for (std::size_t round = 0; std::exchange(any, false); ++round)
        for (std::size_t i = 0; i < stretches.size(); ++i) {
            const unsigned part = stretches[i].part;
            const std::size_t number = round * stretchesOf[part].size() + numberOfOwn[i];
            if (number >= lanes[part]->marks.size()) continue;
            takeOver(*lanes[part], number);
            any = true;
        }
    for (unsigned part = 0; part < some.parts(); ++part)
        if (!stretchesOf[part].empty()) endBeside(*lanes[part]);
    for (std::size_t run = 1; run < emissionRuns.size(); ++run) lanes[run - 1]->ticked.clear();
    emissions.clear();
    emissionRuns.resize(1);
    return true;
}

void Scene::State::runAllRoutes(Cascade& cascade, std::size_t round) {
    const std::uint64_t before = work;
    const bool isEarly = round < roundWork.size();
    const bool any = std::ranges::any_of(emissionRuns, [](const auto* run) { return !run->empty(); });
    ThreadTeam* some = isEarly && any && mayDivide() ? teamFor(roundWork[round].routes) : nullptr;
    if (!some || !runRoutesBeside(cascade, *some)) {
        joinEmissions();
        runRoutes(cascade);
    }
    if (isEarly) roundWork[round].routes = work - before;
}

}  // namespace rtsg
