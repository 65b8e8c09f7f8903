// Feeds arbitrary bytes to every decoder of rtsg::sync: as they come, behind a valid header and checksum (what a
// hostile peer would send), and as changed columns and flipped bits in a stream that was honest so far, in every
// coding. What is accepted survives another round, and a scene takes it or refuses it: after either, the scene's
// snapshot leads to the same state hash, also by way of a scene file's record. A change set made from the bytes comes
// back as it went in.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <ranges>
#include <span>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>

namespace {

using namespace rtsg;

ByteBuffer withHeader(std::span<const std::byte> payload, RecordKind kind, std::uint8_t flags = 0) {
    ByteBuffer record;
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.append(payload);
    RecordHeader header;
    header.kind = kind;
    header.flags = flags;
    header.from = kind == RecordKind::frame ? 1 : 0;
    header.to = 2;
    sealRecord(record, header);
    return record;
}

void decodeChanges(std::span<const std::byte> record) {
    if (parseRecordHeader(record)->kind == RecordKind::scene) return;  // whose types would come back as definitions
    ChangeDecoder decoder({});
    ChangeSet set;
    if (!decoder.decode(record, set)) return;
    ByteBuffer first, second;
    ChangeEncoder encoder({}, {});
    encoder.encode(set, first);
    if (!checkRecord(first.bytes()) || !decoder.decode(first.bytes(), set)) std::abort();
    encoder.encode(set, second);
    if (!std::ranges::equal(first.bytes(), second.bytes())) std::abort();
}

/// A scene for frames to apply to, in state 1: what they may refer to are nodes 2 to 12 or so.
constexpr const char* kScene = R"(#X3D V4.0 utf8
PROTO Knob [ inputOutput SFVec3f at 0 0 0 ] { Transform { translation IS at } }
DEF T TimeSensor { loop TRUE }
DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1 ] }
DEF M Transform { children [ DEF B BooleanToggle { }, Shape { geometry Box { } } ] }
DEF K Knob { }
ROUTE T.fraction_changed TO P.set_fraction
ROUTE P.value_changed TO M.set_translation
)";

void expectLaw(const Scene& scene) {
    Scene other;
    other.setBehavioursEnabled(false);
    if (!other.apply(std::make_shared<const ChangeSet>(scene.snapshot()))) std::abort();
    if (other.hash() != scene.hash() || other.nodeCount() != scene.nodeCount()) std::abort();
    ByteBuffer record;
    Scene read;
    read.setBehavioursEnabled(false);
    auto set = std::make_shared<ChangeSet>();
    ChangeDecoder decoder(builtinTypes(), 0);
    if (!ChangeEncoder().encodeScene(scene.snapshot(), record) || !decoder.decode(record.bytes(), *set)) std::abort();
    if (!read.apply(std::move(set)) || read.hash() != scene.hash()) std::abort();
}

void apply(std::span<const std::byte> record) {
    static const std::shared_ptr<const ChangeSet> start = [] {
        Scene scene;
        Diagnostics diagnostics;
        (void)loadText(scene, kScene, diagnostics);
        scene.seal();
        auto set = std::make_shared<ChangeSet>(scene.snapshot());
        set->to = 1;
        return set;
    }();
    ChangeDecoder decoder(builtinTypes(), 0);
    auto set = std::make_shared<ChangeSet>();
    if (!decoder.decode(record, *set)) return;
    Scene scene;
    scene.setBehavioursEnabled(false);
    if (!set->isSnapshot() && !scene.apply(start)) std::abort();
    if (scene.apply(set)) expectLaw(scene);
}

/// Bytes as numbers, then zeros.
struct Source {
    std::span<const std::byte> bytes;
    std::uint32_t next() {
        if (bytes.empty()) return 0;
        const auto value = std::to_integer<std::uint32_t>(bytes.front());
        bytes = bytes.subspan(1);
        return value;
    }
    float real() {
        std::uint32_t bits = 0;
        for (int i = 0; i < 4; ++i) bits = bits << 8 | next();
        float result;
        std::memcpy(&result, &bits, 4);
        return next() & 1 ? result : static_cast<float>(bits & 0xFFFF) * 1e-3f;
    }
};

ChangeSet setFrom(Source& source, std::uint64_t frame) {
    constexpr FieldType kTypes[] = {FieldType::SFVec3f, FieldType::SFRotation, FieldType::SFFloat, FieldType::SFVec2f,
                                    FieldType::SFColorRGBA};
    ChangeSet set;
    set.from = frame;
    set.to = frame + 1;
    for (std::uint32_t n = source.next() % 24; n > 0; --n) {
        const std::uint32_t which = source.next();
        float values[4];
        for (float& value : values) value = source.real();
        Change change;
        change.node = NodeId{1 + which / 5};
        change.field = static_cast<FieldIndex>(which % 5);
        change.external = which & 64;
        change.value = Value::fromStorage(kTypes[which % 5], values);
        set.changes.push_back(std::move(change));
    }
    return set;
}

std::vector<Change> sorted(std::vector<Change> changes) {
    std::ranges::stable_sort(changes, {}, [](const Change& c) { return std::pair(c.node.value, c.field); });
    return changes;
}

/// An honest stream made of the first bytes; the rest then comes as its next record.
void decodeStream(std::span<const std::byte> bytes, const StreamMode& mode) {
    Source source{bytes};
    ChangeEncoder encoder(mode, {});
    ChangeDecoder decoder({});
    ByteBuffer record;
    ChangeSet found;
    for (std::uint64_t frame = 1; frame <= 4; ++frame) {
        const ChangeSet set = setFrom(source, frame);
        encoder.encode(set, record);
        if (!decoder.decode(record.bytes(), found)) std::abort();
        if (sorted(set.changes) != sorted(found.changes)) std::abort();
    }
    ChangeDecoder twin({});
    twin.goOnFrom(decoder);
    (void)decoder.decode(withHeader(source.bytes, RecordKind::frame, kRemember).bytes(), found);
    if (record.size() == kRecordHeaderSize) return;
    const RecordHeader header = *parseRecordHeader(record.bytes());
    while (!source.bytes.empty()) {
        const std::uint32_t at = source.next() << 8 | source.next();
        record.data()[kRecordHeaderSize + at % (record.size() - kRecordHeaderSize)] ^=
            static_cast<std::byte>(source.next());
    }
    RecordHeader next = header;
    next.flags = kRemember;
    sealRecord(record, next);
    (void)twin.decode(record.bytes(), found);
}

template <class T>
Value arrayOf(std::span<const std::byte> bytes) {
    Array<T> array = Array<T>::ofSize(bytes.size() / sizeof(T));
    if (!array.empty()) std::memcpy(static_cast<void*>(array.mutableData()), bytes.data(), array.size() * sizeof(T));
    return array;
}

/// The bytes as arrays come back from a scene file's record.
void decodeArrays(std::span<const std::byte> bytes) {
    ChangeSet set, found;
    set.to = 1;
    for (Value value :
         {arrayOf<std::int32_t>(bytes), arrayOf<float>(bytes), arrayOf<Vec3f>(bytes), arrayOf<Rotation>(bytes)}) {
        Change change;
        change.node = NodeId{static_cast<std::uint32_t>(2 + set.changes.size())};
        change.field = static_cast<FieldIndex>(set.changes.size());
        change.value = std::move(value);
        set.changes.push_back(std::move(change));
    }
    ChangeEncoder encoder({}, {});
    encoder.makeSmall();
    ByteBuffer record;
    encoder.encode(set, record);
    ChangeDecoder decoder({});
    if (!decoder.decode(record.bytes(), found) || found.changes.size() != set.changes.size()) std::abort();
    for (std::size_t i = 0; i < set.changes.size(); ++i)
        if (set.changes[i].value != found.changes[i].value) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
    if (checkRecord(bytes)) {
        decodeChanges(bytes);
        apply(bytes);
    }
    const ByteBuffer records[] = {withHeader(bytes, RecordKind::frame),
                                  withHeader(bytes, RecordKind::frame, kRemember | kForget),
                                  withHeader(bytes, RecordKind::keyframe)};
    for (const ByteBuffer& record : records) {
        decodeChanges(record.bytes());
        apply(record.bytes());
    }
    apply(withHeader(bytes, RecordKind::scene).bytes());
    decodeArrays(bytes);
    (void)decodeHead(withHeader(bytes, RecordKind::head).bytes());
    for (const Coding coding : {Coding::compact, Coding::smallest}) {
        decodeStream(bytes, {Mode::state, coding, 0});
        decodeStream(bytes, {Mode::lossy, coding, 1e-3});
    }
    return 0;
}
