// Encodes and decodes the input of a frame, and the run state that a scene runs on from.
#include <rtsg/sync/input_codec.h>

#include <algorithm>
#include <cstring>

#include <fmt/format.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/scene.h>

#include "columns/blocks.h"
#include "columns/wire.h"
#include "type_mapping.h"

namespace rtsg {

using wire::Reader;
using wire::zigzag;

namespace {

/// Blocks of an input record beside those of a frame, in ascending order.
enum InputBlock : std::uint8_t {
    kRun = 16,
    kWoken = 17,
    kCalls = 18,
    kBehaviours = 19,
    kActive = 20,
    kSleepers = 21,
    kInputEnd = 22,
};
constexpr unsigned kSealedOnly = 1, kFirst = 2, kBehavioursOff = 4, kNextId = 8;
constexpr unsigned kRefused = 4, kAgainNow = 8, kAgainAt = 16;  // bits of a call's tag, beside its kind
constexpr unsigned kEffectElsewhere = 4;                        // a bit of an effect's tag, beside its kind
constexpr std::uint64_t kCallCost = sizeof(BehaviourCall), kEffectCost = sizeof(BehaviourEffect) + 16;  // charges
constexpr unsigned kDeterministic = 1, kHasAccepts = 2, kHasOnEvent = 4, kHasOnTime = 8, kComesLast = 16;

class BlockWriter {
  public:
    explicit BlockWriter(ByteBuffer& record) : record_(record) {}
    ByteBuffer& begin() {
        body_.clear();
        return body_;
    }
    void end(InputBlock kind, std::uint64_t count) {
        if (count == 0) return;
        record_.put(static_cast<std::uint8_t>(kind));
        record_.putVarint(count);
        record_.putVarint(body_.size());
        record_.append(body_.bytes());
    }

  private:
    ByteBuffer& record_;
    ByteBuffer body_;
};

void putNodes(BlockWriter& out, InputBlock kind, const std::vector<NodeId>& nodes) {
    ByteBuffer& body = out.begin();
    std::uint32_t last = 0;
    for (const NodeId node : nodes) body.putVarint(zigzag(node.value, std::exchange(last, node.value)));
    out.end(kind, nodes.size());
}

std::vector<NodeId> readNodes(Reader& in, std::size_t count) {
    std::vector<NodeId> nodes;
    if (!in.charge(count * sizeof(NodeId))) return nodes;
    nodes.reserve(count);
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) nodes.push_back(NodeId{last = in.delta(last)});
    return nodes;
}

void putCalls(BlockWriter& out, double now, const std::vector<BehaviourCall>& calls) {
    ByteBuffer& body = out.begin();
    std::uint32_t last = 0;
    for (const BehaviourCall& call : calls) {
        const bool timed = call.kind == BehaviourCall::Kind::onTime;
        // The cascade makes no difference between now and earlier.
        const unsigned again = !timed || call.next == kNever ? 0u : call.next <= now ? kAgainNow : kAgainAt;
        body.put(static_cast<std::uint8_t>(static_cast<unsigned>(call.kind) | (call.accepted ? 0u : kRefused) | again));
        body.putVarint(zigzag(call.node.value, std::exchange(last, call.node.value)));
        if (!timed) body.putVarint(call.field);
        if (again == kAgainAt) body.put(call.next);
        body.putVarint(call.effects.size());
        for (const BehaviourEffect& effect : call.effects) {
            const bool elsewhere = effect.node != call.node;
            body.put(
                static_cast<std::uint8_t>(static_cast<unsigned>(effect.kind) | (elsewhere ? kEffectElsewhere : 0u)));
            if (elsewhere) body.putVarint(zigzag(effect.node.value, call.node.value));
            body.putVarint(effect.field);
            body.put(static_cast<std::uint8_t>(effect.value.type()));
            wire::putValue(body, effect.value);
        }
    }
    out.end(kCalls, calls.size());
}

std::vector<BehaviourCall> readCalls(Reader& in, std::size_t count, double now) {
    std::vector<BehaviourCall> calls;
    if (!in.charge(count * kCallCost)) return calls;
    calls.reserve(count);
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        BehaviourCall& call = calls.emplace_back();
        const unsigned tag = in.number<std::uint8_t>();
        if ((tag & 3u) > 2 || tag >= 32) in.refuse("unknown kind of call");
        call.kind = static_cast<BehaviourCall::Kind>(tag & 3u);
        call.accepted = !(tag & kRefused);
        call.node = NodeId{last = in.delta(last)};
        if (call.kind != BehaviourCall::Kind::onTime) call.field = static_cast<FieldIndex>(in.bounded(0xFFFF));
        call.next = tag & kAgainAt ? in.number<double>() : tag & kAgainNow ? now : kNever;
        const std::size_t effects = in.count(3);
        if (!in.charge(effects * kEffectCost)) break;
        call.effects.reserve(effects);
        for (std::size_t k = 0; k < effects && !in.problem; ++k) {
            BehaviourEffect& effect = call.effects.emplace_back();
            const unsigned kind = in.number<std::uint8_t>();
            if ((kind & 3u) > 2 || kind >= 8) in.refuse("unknown kind of effect");
            effect.kind = static_cast<BehaviourEffect::Kind>(kind & 3u);
            effect.node = kind & kEffectElsewhere ? NodeId{in.delta(call.node.value)} : call.node;
            effect.field = static_cast<FieldIndex>(in.bounded(0xFFFF));
            effect.value = wire::readValue(in, wire::readFieldType(in));
        }
    }
    return calls;
}

void putUses(BlockWriter& out, const std::vector<BehaviourUse>& uses) {
    ByteBuffer& body = out.begin();
    for (const BehaviourUse& use : uses) {
        body.putVarint(use.type.value);
        body.put(static_cast<std::uint8_t>((use.deterministic ? kDeterministic : 0u) |
                                           (use.accepts ? kHasAccepts : 0u) | (use.onEvent ? kHasOnEvent : 0u) |
                                           (use.onTime ? kHasOnTime : 0u) | (use.last ? kComesLast : 0u)));
    }
    out.end(kBehaviours, uses.size());
}

std::vector<BehaviourUse> readUses(Reader& in, std::size_t count) {
    std::vector<BehaviourUse> uses;
    if (!in.charge(count * sizeof(BehaviourUse))) return uses;
    uses.reserve(count);
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        BehaviourUse& use = uses.emplace_back();
        use.type = TypeIndex{static_cast<std::uint16_t>(in.bounded(0xFFFF))};
        const unsigned flags = in.number<std::uint8_t>();
        use.deterministic = flags & kDeterministic;
        use.accepts = flags & kHasAccepts;
        use.onEvent = flags & kHasOnEvent;
        use.onTime = flags & kHasOnTime;
        use.last = flags & kComesLast;
    }
    return uses;
}

/// The memory that decoding the input takes. A run state does not count, because it is longer encoded than decoded.
std::uint64_t costOf(const FrameInput& input) {
    // Edits and events are held twice while they are sorted in; the first copy is in the frame's own account.
    std::uint64_t cost = (input.edits.size() + input.events.size()) * wire::kChangeCost +
                         input.woken.size() * sizeof(NodeId) + input.behaviours.size() * sizeof(BehaviourUse);
    for (const BehaviourCall& call : input.calls) {
        cost += kCallCost + call.effects.size() * kEffectCost;
        for (const BehaviourEffect& effect : call.effects) cost += wire::costOf(effect.value);
    }
    return cost;
}

void seal(ByteBuffer& record, const ChangeSet& set, std::uint64_t from) {
    RecordHeader header;
    header.kind = RecordKind::input;
    header.from = from;
    header.to = set.to;
    header.time = set.time;
    header.hash = set.hash;
    sealRecord(record, header);
}

}  // namespace

bool needsState(const ChangeSet& set) {
    return set.isSnapshot() || !set.input || !set.input->complete || set.to != set.from + 1;
}

// ---- writing -----------------------------------------------------------------------------------------------------

struct InputEncoder::Parts {
    explicit Parts(TypeTable table) : types(table) { restart(); }
    void restart() { encoder = std::make_unique<ChangeEncoder>(StreamMode(), types); }

    TypeTable types;
    std::unique_ptr<ChangeEncoder> encoder;
    ChangeSet edits;
    std::uint32_t nextId = 0;  // the next id as a reader counts it
};

InputEncoder::InputEncoder(TypeTable types) : parts_(std::make_unique<Parts>(types)) {}
InputEncoder::~InputEncoder() = default;

void InputEncoder::encode(const ChangeSet& set, ByteBuffer& record) {
    const FrameInput& input = *set.input;
    Parts& parts = *parts_;
    record.clear();
    if (!input.edits.empty() || !input.events.empty() || set.authors) {
        parts.edits.authors = set.authors;
        parts.edits.changes = input.edits;
        parts.edits.changes.insert(parts.edits.changes.end(), input.events.begin(), input.events.end());
        parts.edits.types = input.types;
        parts.edits.from = set.from;
        parts.edits.to = set.to;
        parts.encoder->encode(parts.edits, record);
        parts.edits.clear();  // releases the values
    } else {
        record.room(kRecordHeaderSize);
        record.advance(kRecordHeaderSize);
    }
    for (const Change& change : input.edits)
        if (change.kind == ChangeKind::createNode) parts.nextId = std::max(parts.nextId, change.node.value + 1);
    const bool leaps = input.nextId != parts.nextId;
    parts.nextId = input.nextId;

    BlockWriter out(record);
    const unsigned flags = (input.ran ? 0u : kSealedOnly) | (input.first ? kFirst : 0u) |
                           (input.behavioursEnabled ? 0u : kBehavioursOff) | (leaps ? kNextId : 0u);
    ByteBuffer& run = out.begin();
    run.put(static_cast<std::uint8_t>(flags));
    if (leaps) run.putVarint(input.nextId);
    out.end(kRun, flags ? 1 : 0);
    putNodes(out, kWoken, input.woken);
    putCalls(out, set.time, input.calls);
    putUses(out, input.behaviours);
    wire::fillUp(record, costOf(input));
    seal(record, set, set.from);
}

Result<> InputEncoder::encodeRunState(const ChangeSet& set, ByteBuffer& record) {
    if (!set.input || !set.input->runState)
        return fail(fmt::format("state {} comes without what it takes to run on from it", set.to));
    const RunState& state = *set.input->runState;
    parts_->restart();
    parts_->nextId = state.nextId;
    record.clear();
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    BlockWriter out(record);
    ByteBuffer& run = out.begin();
    run.put(static_cast<std::uint8_t>(kNextId));
    run.putVarint(state.nextId);
    out.end(kRun, 1);
    putUses(out, state.behaviours);
    putNodes(out, kActive, state.active);
    ByteBuffer& sleepers = out.begin();
    std::uint32_t last = 0;
    for (const auto& [time, node] : state.sleepers) {
        sleepers.put(time);
        sleepers.putVarint(zigzag(node.value, std::exchange(last, node.value)));
    }
    out.end(kSleepers, state.sleepers.size());
    seal(record, set, set.to);
    return {};
}

// ---- reading -----------------------------------------------------------------------------------------------------

InputDecoder::InputDecoder(const ChangeDecoder* states)
    : states_(states),
      changes_(states ? ChangeDecoder(builtinTypes(), states->localHash()) : ChangeDecoder(builtinTypes())) {
    changes_.refuseUnknown(true);
}
InputDecoder::~InputDecoder() = default;

namespace {

Result<RecordHeader> headerOfInput(std::span<const std::byte> record) {
    Result<RecordHeader> header = parseRecordHeader(record);
    if (!header) return header;
    if (header->kind != RecordKind::input)
        return fail(fmt::format("record of kind {} is no input", static_cast<unsigned>(header->kind)));
    if (header->to != header->from && header->to != header->from + 1)
        return fail(fmt::format("an input leads from state {} to {}", header->from, header->to));
    return header;
}

void readRun(Reader& in, bool isRunState, FrameInput& input) {
    const unsigned flags = in.number<std::uint8_t>();
    if (!isRunState) input.ran = !(flags & kSealedOnly);
    input.first = flags & kFirst;
    input.behavioursEnabled = !(flags & kBehavioursOff);
    if (flags & kNextId) input.nextId = in.varint32();
}

void readSleepers(Reader& in, std::size_t count, RunState& state) {
    if (!in.charge(count * sizeof(state.sleepers[0]))) return;
    state.sleepers.reserve(count);
    std::uint32_t last = 0;
    for (std::size_t i = 0; i < count && !in.problem; ++i) {
        const double time = in.number<double>();
        state.sleepers.emplace_back(time, NodeId{last = in.delta(last)});
    }
}

/// `state` is null for the input of a frame, which skips blocks of a run state.
void readBlock(Reader& in, unsigned kind, std::size_t count, double time, FrameInput& input, RunState* state) {
    switch (kind) {
        case kRun:
            return readRun(in, state != nullptr, input);
        case kWoken:
            input.woken = readNodes(in, count);
            return;
        case kCalls:
            input.calls = readCalls(in, count, time);
            return;
        case kBehaviours:
            (state ? state->behaviours : input.behaviours) = readUses(in, count);
            return;
        case kActive:
            if (state) state->active = readNodes(in, count);
            return;
        case kSleepers:
            if (state) readSleepers(in, count, *state);
            return;
        default:
            return;
    }
}

/// Reads the blocks of an input. `ownBlocks` becomes the bytes of the blocks before them, whose kinds frames have too.
Result<> readBlocks(Reader& in, double time, FrameInput& input, RunState* state, std::size_t& ownBlocks) {
    unsigned previous = kRun - 1;
    while (in.left() && !in.problem) {
        const auto kind = in.number<std::uint8_t>();
        const std::uint64_t count = in.varint();
        Reader block = in.part(in.count(1));
        if (in.problem) break;
        if (kind < kRun && kind != wire::kFiller) {
            if (previous >= kRun) in.refuse("blocks out of order");
            ownBlocks = static_cast<std::size_t>(in.at - in.begin);
            continue;
        }
        if (kind == wire::kFiller || kind >= kInputEnd) continue;  // of a later format
        if (kind <= previous) block.refuse("blocks out of order");
        previous = kind;
        if (count > block.left()) block.refuse("count exceeds the bytes that follow");
        if (!block.problem) readBlock(block, kind, count, time, input, state);
        if (block.problem) return std::unexpected(wire::describe(block, "input record"));
    }
    if (in.problem) return std::unexpected(wire::describe(in, "input record"));
    return {};
}

}  // namespace

/// Decodes the edits and events, which are blocks as in a frame.
Result<> InputDecoder::decodeEdits(std::span<const std::byte> blocks, FrameInput& input, ChangeSet& set) {
    scratch_.clear();
    scratch_.append(blocks);
    RecordHeader frame;
    frame.from = 1;
    frame.to = 2;
    sealRecord(scratch_, frame);
    if (auto ok = changes_.decode(scratch_.bytes(), set); !ok) return ok;
    const auto events = static_cast<std::size_t>(std::ranges::count(set.changes, ChangeKind::event, &Change::kind));
    input.events.reserve(events);
    input.edits.reserve(set.changes.size() - events);
    for (Change& change : set.changes)
        (change.kind == ChangeKind::event ? input.events : input.edits).push_back(std::move(change));
    input.types = std::move(set.types);
    input.authors = std::move(set.authors);
    return {};
}

Result<> InputDecoder::decode(std::span<const std::byte> record, ChangeSet& set) {
    const Result<RecordHeader> header = headerOfInput(record);
    if (!header) return std::unexpected(header.error());
    const bool isRunState = header->from == header->to;
    auto input = std::make_shared<FrameInput>();
    auto state = isRunState ? std::make_shared<RunState>() : nullptr;
    input->ran = !isRunState;
    input->complete = !isRunState;
    if (states_) changes_.mapping_ = states_->mapping_;
    wire::Budget budget(header->size());
    Reader in(record.subspan(kRecordHeaderSize, header->length), kRecordHeaderSize);
    in.budget = &budget;
    std::size_t ownBlocks = 0;
    if (auto ok = readBlocks(in, header->time, *input, state.get(), ownBlocks); !ok) return ok;
    if (ownBlocks > 0)
        if (auto ok = decodeEdits(record.subspan(0, kRecordHeaderSize + ownBlocks), *input, set); !ok) return ok;
    if (changes_.mapping_)
        if (auto ok = changes_.mapping_->toLocal(*input, state.get()); !ok) return ok;
    set.clear();
    set.from = header->from;
    set.to = header->to;
    set.time = header->time;
    set.hash = header->hash;
    if (state) state->nextId = input->nextId;
    input->runState = std::move(state);
    set.authors = input->authors;
    set.input = std::move(input);
    return {};
}

}  // namespace rtsg
