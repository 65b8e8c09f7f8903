// Records the inputs of a frame, and runs a frame from such a record (frame_input.h).
#include <algorithm>

#include <fmt/format.h>

#include "state/state.h"

namespace rtsg {

namespace {

/// Stands for a behaviour that this program lacks: it is never asked while its calls are played back.
bool acceptsAll(const Node&, FieldIndex, EventValue) {
    return true;
}
void ignoresEvents(Cascade&, const Node&, FieldIndex, EventValue) {}
double neverAgain(Cascade&, const Node&) {
    return kNever;
}

bool sameParts(const BehaviourUse& use, const Behaviour& behaviour) {
    return use.accepts == (behaviour.accepts != nullptr) && use.onEvent == (behaviour.onEvent != nullptr) &&
           use.onTime == (behaviour.onTime != nullptr);
}

}  // namespace

void FrameInput::clear() {
    complete = behavioursEnabled = true;
    ran = first = false;
    nextId = 0;
    edits.clear();
    types.clear();
    events.clear();
    woken.clear();
    calls.clear();
    behaviours.clear();
    runState.reset();
}

// ---- recording -------------------------------------------------------------------------------------------------

void Scene::setInputRecording(bool on) {
    if (state_->refuseForeign() || state_->recording == on) return;
    state_->recording = on;
    state_->input.reset();
    state_->newUses.clear();
}
bool Scene::inputRecording() const {
    return state_->recording;
}
RunState Scene::runState() const {
    return state_->runState();
}

RunState Scene::State::runState() const {
    RunState result;
    result.active = active;
    // Asked once more, they wait again; so those that wait for a place.
    result.active.insert(result.active.end(), watchers.begin(), watchers.end());
    result.active.insert(result.active.end(), woken.begin(), woken.end());
    worldTransforms.forEachAsker([&](NodeId id) { result.active.push_back(id); });
    std::ranges::sort(result.active);
    result.active.erase(std::unique(result.active.begin(), result.active.end()), result.active.end());
    for (auto copy = sleepers; !copy.empty(); copy.pop()) result.sleepers.push_back(copy.top());
    result.behaviours = uses;
    result.nextId = nextId;
    return result;
}

void Scene::State::noteUse(TypeIndex type, const Behaviour& behaviour) {
    const BehaviourUse use{type,
                           behaviour.deterministic,
                           behaviour.accepts != nullptr,
                           behaviour.onEvent != nullptr,
                           behaviour.onTime != nullptr,
                           behaviour.last};
    dormant.erase(type.value);
    const auto known = std::ranges::find(uses, type, &BehaviourUse::type);
    if (known != uses.end())
        *known = use;
    else
        uses.push_back(use);
    if (recording) newUses.push_back(use);
}

/// Records the edits that are pending now: these are the application's own. Later changes of the frame can be repeated
/// by the cascade.
void Scene::State::captureInput(bool running) {
    const auto free = std::ranges::find_if(inputPool, [](const auto& one) { return one.use_count() == 1; });
    if (free != inputPool.end()) {
        input = *free;
        input->clear();
    } else {
        constexpr std::size_t kPooled = 4;
        input = std::make_shared<FrameInput>();
        if (inputPool.size() < kPooled) inputPool.push_back(input);
    }
    FrameInput& in = *input;
    in.ran = running;
    in.first = !started;
    in.behavioursEnabled = behavioursEnabled;
    in.nextId = nextId;
    if (running) in.woken = woken;
    in.behaviours.swap(newUses);
    in.types = newTypes;
    editedWithin = false;
    currentCall = kNoCall;
    appendDefinitions(in.edits, newTypes);
    appendCreations(in.edits);
    forEachWritten([&](const WrittenField& entry) {
        const Node* node = find(entry.node);
        if (!node) return;
        Change& change = in.edits.emplace_back();
        change.node = entry.node;
        change.field = entry.field;
        change.external = entry.external;
        change.value = node->value(entry.field);
    });
    appendOtherEdits(in.edits);
}

std::shared_ptr<const FrameInput> Scene::State::finishInput(bool applied) {
    FrameInput& in = *input;
    in.complete = !applied && !editedWithin;
    if (!in.complete || sequence <= 1) in.runState = std::make_shared<const RunState>(runState());
    return std::exchange(input, nullptr);
}

std::size_t Scene::State::beginCall(BehaviourCall::Kind kind, NodeId node, FieldIndex field) {
    BehaviourCall& call = input->calls.emplace_back();
    call.kind = kind;
    call.node = node;
    call.field = field;
    return std::exchange(currentCall, input->calls.size() - 1);
}

void Scene::State::recordEffect(BehaviourEffect::Kind kind, NodeId node, FieldIndex field, const void* value) {
    const FieldType type = find(node)->type_->fields[field].type;
    input->calls[currentCall].effects.push_back({kind, node, field, Value::fromStorage(type, value)});
}

// ---- calling behaviours ------------------------------------------------------------------------------------------

bool Scene::State::accepts(const Behaviour& behaviour, const Node& node, FieldIndex field, const void* storage) {
    const EventValue value(node.type_->slot(field).type, storage);
    if (!isTraced(behaviour)) return behaviour.accepts(node, field, value);
    if (playing) {
        const BehaviourCall* call = playCall(BehaviourCall::Kind::accepts, node.id_, field);
        return !call || call->accepted;
    }
    const std::size_t outer = beginCall(BehaviourCall::Kind::accepts, node.id_, field);
    const bool accepted = behaviour.accepts(node, field, value);
    input->calls[currentCall].accepted = accepted;
    currentCall = outer;
    return accepted;
}

void Scene::State::tracedOnEvent(const Behaviour& behaviour, Cascade& cascade, const Node& node, FieldIndex field,
                                 const void* storage) {
    const EventValue value(node.type_->slot(field).type, storage);
    if (playing) {
        if (const BehaviourCall* call = playCall(BehaviourCall::Kind::onEvent, node.id_, field))
            playEffects(cascade, *call);
        return;
    }
    const std::size_t outer = beginCall(BehaviourCall::Kind::onEvent, node.id_, field);
    behaviour.onEvent(cascade, node, field, value);
    currentCall = outer;
}

double Scene::State::tracedOnTime(const Behaviour& behaviour, Cascade& cascade, const Node& node) {
    if (playing) {
        const BehaviourCall* call = playCall(BehaviourCall::Kind::onTime, node.id_, kNoField);
        if (!call) return kNever;
        playEffects(cascade, *call);
        return call->next;
    }
    const std::size_t outer = beginCall(BehaviourCall::Kind::onTime, node.id_, kNoField);
    const std::size_t own = currentCall;
    const double next = behaviour.onTime(cascade, node);
    input->calls[own].next = next;
    currentCall = outer;
    return next;
}

/// The cascades are the same as long as the states are, so the calls come in the order in which they were recorded.
const BehaviourCall* Scene::State::playCall(BehaviourCall::Kind kind, NodeId node, FieldIndex field) {
    if (nextCall < playing->calls.size()) {
        const BehaviourCall& call = playing->calls[nextCall];
        if (call.kind == kind && call.node == node && call.field == field) {
            ++nextCall;
            if (recording) input->calls.push_back(call);
            return &call;
        }
    }
    if (playProblem.empty())
        playProblem = fmt::format("{} of node {} was called, which the record does not have there",
                                  find(node)->type_->name, node.value);
    return nullptr;
}

void Scene::State::playEffects(Cascade& cascade, const BehaviourCall& call) {
    // Deliveries nest; a record that is forged shall not exhaust the stack.
    constexpr std::size_t kDeepest = 256;
    if (playDepth == kDeepest) {
        if (playProblem.empty()) playProblem = "the recorded calls nest too deeply";
        return;
    }
    ++playDepth;
    for (const BehaviourEffect& effect : call.effects) {
        Node* node = find(effect.node);
        const bool fits =
            node && effect.field < node->type_->fields.size() &&
            node->type_->fields[effect.field].holds(effect.value) &&
            (effect.kind == BehaviourEffect::Kind::deliver || node->type_->fields[effect.field].readable());
        const void* value = effect.value.storage();
        if (!fits || (sf(effect.value.type()) == FieldType::SFNode && !checkNodes(*node, effect.field, value))) {
            if (playProblem.empty())
                playProblem = fmt::format("a recorded effect on node {} does not fit it", effect.node.value);
        } else if (effect.kind == BehaviourEffect::Kind::deliver) {
            if (auto ok = cascade.deliver(effect.node, effect.field, effect.value); !ok && playProblem.empty())
                playProblem = std::move(ok.error().text);
        } else if (effect.kind == BehaviourEffect::Kind::emit) {
            cascade.emitAgain(*node, effect.field, value);
        } else {
            cascade.storeStorage(*node, effect.field, value);
        }
    }
    --playDepth;
}

// ---- running a record --------------------------------------------------------------------------------------------

Result<> Scene::State::adoptUses(std::span<const BehaviourUse> list, bool all) {
    ++linkEdits;  // the part that may run on other threads may have changed
    // A behaviour that is registered here and not there does nothing until it is registered there, too.
    for (std::size_t i = 0; all && i < uses.size();) {
        const TypeIndex type = uses[i].type;
        if (std::ranges::find(list, type, &BehaviourUse::type) != list.end()) {
            ++i;
            continue;
        }
        Behaviour& current = types[type.value].behaviour;
        dormant[type.value] = std::exchange(current, Behaviour{});
        for (const BuiltinBehaviour& builtin : builtinBehaviours())
            if (builtin.type == type) current = builtin.behaviour;
        uses.erase(uses.begin() + static_cast<std::ptrdiff_t>(i));
    }
    for (const BehaviourUse& use : list) {
        if (use.type.value >= types.size()) return fail("a behaviour of an unknown node type");
        TypeEntry& entry = types[use.type.value];
        if (const auto asleep = dormant.find(use.type.value); asleep != dormant.end()) {
            entry.behaviour = asleep->second;
            dormant.erase(asleep);
            noteUse(use.type, entry.behaviour);
        }
        const bool same = sameParts(use, entry.behaviour);
        if (use.deterministic) {
            const bool own = std::ranges::find(uses, use) != uses.end();
            if (!own || !same || !entry.behaviour.deterministic)
                return fail(
                    fmt::format("the behaviour of {} is not registered here as it is at the origin", entry.type->name));
            continue;
        }
        if (!same || entry.behaviour.deterministic) {
            entry.behaviour = {};
            if (use.accepts) entry.behaviour.accepts = acceptsAll;
            if (use.onEvent) entry.behaviour.onEvent = ignoresEvents;
            if (use.onTime) entry.behaviour.onTime = neverAgain;
            entry.behaviour.last = use.last;
        }
        noteUse(use.type, entry.behaviour);
    }
    return {};
}

void Scene::State::adoptRunState(const RunState& state) {
    active = state.active;
    std::ranges::sort(active);
    sleepers = {};
    watchers.clear();
    for (const auto& sleeper : state.sleepers)
        if (sleeper.first < kNever) sleepers.push(sleeper);
    woken.clear();
    constexpr std::uint32_t kMaximumLeap = 1u << 30;
    if (state.nextId > nextId && state.nextId - nextId <= kMaximumLeap) nextId = state.nextId;
}

Result<> Scene::resumeFrom(const RunState& state) {
    if (auto ok = state_->checkThread(); !ok) return ok;
    if (auto ok = state_->adoptUses(state.behaviours, true); !ok) return ok;
    state_->adoptRunState(state);
    return {};
}

Result<std::shared_ptr<const ChangeSet>> Scene::runInput(const FrameInput& input, double t) {
    State& s = *state_;
    if (auto ok = s.checkOutsideFrame(); !ok) return std::unexpected(ok.error());
    if (s.hasPending() || !s.inputQueue.empty()) return fail("the scene has edits of its own that are not sealed");
    if (!input.complete) return fail("the record of this frame is not complete");
    if (auto ok = s.applyChanges(input.edits, input.types, true); !ok) return std::unexpected(ok.error());
    if (input.authors) s.authors = *input.authors;
    const auto& uses = input.runState ? input.runState->behaviours : input.behaviours;
    if (auto ok = s.adoptUses(uses, input.runState != nullptr); !ok) return std::unexpected(ok.error());
    constexpr std::uint32_t kMaximumLeap = 1u << 30;
    const std::uint32_t nextId = input.nextId ? input.nextId : s.nextId;
    if (nextId < s.nextId || nextId - s.nextId > kMaximumLeap)
        return fail(fmt::format("node numbers are at {} here, at {} there", s.nextId, nextId));
    s.nextId = nextId;
    if (!input.ran) return s.seal();
    for (const Change& event : input.events)
        if (auto ok = sendEvent(event.node, event.field, event.value); !ok) return std::unexpected(ok.error());
    s.woken = input.woken;
    s.started = !input.first;
    const bool enabled = std::exchange(s.behavioursEnabled, input.behavioursEnabled);
    s.playing = &input;
    s.nextCall = 0;
    s.playProblem.clear();
    auto set = newFrame(t);
    s.playing = nullptr;
    s.behavioursEnabled = enabled;
    if (s.playProblem.empty() && s.nextCall != input.calls.size())
        s.playProblem = "a recorded call of a behaviour was not needed";
    if (!s.playProblem.empty()) s.diagnostics.warning({}, "replayed behaviours: " + s.playProblem);
    return set;
}

}  // namespace rtsg
