// What peers ask of an origin, from arbitrary bytes: records of both kinds as they come, and requests made of the bytes
// by three authors, undo, redo and locks among them. Whatever is asked, the scene's snapshot leads to the same state,
// every answer is a verdict, and what one author alone has done can be taken back to the last request.
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "edits/request.h"
#include "edits/upstream.h"

namespace {

using namespace rtsg;

void expect(bool condition) {
    if (!condition) std::abort();
}

constexpr const char* kScene = R"(#X3D V4.0 utf8
PROTO Knob [ inputOutput SFVec3f at 0 0 0 ] { Transform { translation IS at } }
DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1 ] }
DEF M Transform { children [ DEF B BooleanToggle { }, DEF G Group { children Shape { geometry Box { } } } ] }
DEF K Knob { }
DEF S Script { field SFString x "a" url "javascript:" }
ROUTE P.value_changed TO M.set_translation
)";

struct Source {
    std::span<const std::byte> bytes;
    std::uint32_t next(std::uint32_t below = 256) {
        if (bytes.empty()) return 0;
        const auto value = std::to_integer<std::uint32_t>(bytes.front());
        bytes = bytes.subspan(1);
        return value % below;
    }
};

NodeId nodeFrom(Source& source) {
    const std::uint32_t which = source.next(40);
    return NodeId{which < 32 ? which : mirror::kFirstProvisional + which};
}

Value valueFrom(Source& source, FieldType type) {
    const auto number = static_cast<float>(source.next());
    switch (type) {
        case FieldType::SFBool:
            return source.next(2) == 1;
        case FieldType::SFFloat:
            return number;
        case FieldType::SFVec3f:
            return Vec3f(number, 0, 1);
        case FieldType::SFString:
            return String(std::to_string(number));
        case FieldType::SFNode:
            return nodeFrom(source);
        case FieldType::MFNode: {
            Array<NodeId> nodes;
            for (std::uint32_t n = source.next(4); n > 0; --n) nodes.push_back(nodeFrom(source));
            return nodes;
        }
        default:
            return Value::zero(type);
    }
}

Change changeFrom(Source& source, const Scene& scene) {
    Change c;
    c.kind = static_cast<ChangeKind>(source.next(10));
    c.node = nodeFrom(source);
    c.field = static_cast<FieldIndex>(source.next(24));
    c.other = nodeFrom(source);
    c.index = source.next(24);
    const Node* node = scene.find(c.node);
    if (c.kind == ChangeKind::createNode) {
        constexpr TypeIndex kTypes[] = {x3d::Transform::type, x3d::Group::type, x3d::Shape::type, x3d::Script::type,
                                        x3d::PositionInterpolator::type};
        c.index = kTypes[source.next(5)].value;
        c.other = {};
    }
    if (c.kind == ChangeKind::setName) c.value = String(source.next(3) ? "N" + std::to_string(source.next(4)) : "");
    if (c.kind == ChangeKind::setField || c.kind == ChangeKind::event)
        c.value = valueFrom(source, node && c.field < node->type().fields.size() ? node->type().fields[c.field].type
                                                                                 : FieldType::SFFloat);
    return c;
}

struct Origin {
    Scene scene;
    mirror::Writers writers;
    ChangeEncoder encoder;
    std::uint64_t requests = 0;
    double time = 0;

    Origin() {
        Diagnostics diagnostics;
        (void)loadText(scene, kScene, diagnostics);
        scene.newFrame(0);
    }
    mirror::Verdict ask(std::span<const std::byte> record, MirrorUpstream permission, std::string author) {
        mirror::Submission submission{1, ++requests, permission, {}, false, std::move(author)};
        submission.record.assign(record.begin(), record.end());
        const mirror::Verdict verdict = carryOut(scene, submission, writers);
        expect(verdict.request == requests && verdict.refusal.size() <= 300 && verdict.kept.size() <= 300);
        return verdict;
    }
    mirror::Verdict ask(MirrorRequest request, MirrorUpstream permission, std::string author) {
        ByteBuffer record;
        mirror::writeRequest(encoder, std::move(request), 1, record);
        return ask(record.bytes(), permission, std::move(author));
    }
    void expectLaw() {
        scene.seal();
        Scene other;
        other.setBehavioursEnabled(false);
        expect(other.apply(std::make_shared<const ChangeSet>(scene.snapshot())).has_value());
        expect(other.hash() == scene.hash());
    }
};

void asTheyCome(std::span<const std::byte> bytes) {
    Origin origin;
    for (const RecordKind kind : {RecordKind::frame, RecordKind::request}) {
        ByteBuffer record;
        record.room(kRecordHeaderSize);
        record.advance(kRecordHeaderSize);
        record.append(bytes);
        RecordHeader header;
        header.kind = kind;
        header.from = header.to = 1;
        sealRecord(record, header);
        (void)origin.ask(record.bytes(), MirrorUpstream::code, "a");
        (void)origin.ask({.kind = MirrorRequest::Kind::undo, .changes = {}, .nodes = {}}, MirrorUpstream::code, "a");
    }
    origin.expectLaw();
}

MirrorRequest requestFrom(Source& source, const Scene& scene) {
    MirrorRequest request;
    request.kind = static_cast<MirrorRequest::Kind>(source.next(8) < 4 ? 0 : source.next(4));
    if (request.kind == MirrorRequest::Kind::changes)
        for (std::uint32_t n = source.next(4) + 1; n > 0; --n) request.changes.push_back(changeFrom(source, scene));
    if (request.kind == MirrorRequest::Kind::lock) {
        for (std::uint32_t n = source.next(3); n > 0; --n) request.nodes.push_back(nodeFrom(source));
        request.lease = std::chrono::milliseconds(source.next(2) * 1000);
    }
    return request;
}

void ofThree(Source source) {
    Origin origin;
    for (int i = 0; i < 40 && !source.bytes.empty(); ++i) {
        const std::string author(1, static_cast<char>('a' + source.next(3)));
        const auto permission = static_cast<MirrorUpstream>(source.next(4));
        (void)origin.ask(requestFrom(source, origin.scene), permission, author);
        if (source.next(4) == 0) origin.scene.newFrame(origin.time += 1);
    }
    origin.expectLaw();
}

/// Nothing stands in the way of one alone, but what follows from events.
void ofOne(Source source) {
    Origin origin;
    for (int i = 0; i < 20 && !source.bytes.empty(); ++i) {
        MirrorRequest request;
        for (std::uint32_t n = source.next(3) + 1; n > 0; --n) {
            request.changes.push_back(changeFrom(source, origin.scene));
            if (request.changes.back().kind == ChangeKind::event) request.changes.pop_back();
        }
        (void)origin.ask(std::move(request), MirrorUpstream::code, "a");
    }
    for (int steps = 0;; ++steps) {
        expect(steps <= 40);
        const mirror::Verdict verdict =
            origin.ask({.kind = MirrorRequest::Kind::undo, .changes = {}, .nodes = {}}, MirrorUpstream::code, "a");
        if (verdict.refusal == "there is nothing to take back") break;
        expect(verdict.kept.empty() && verdict.refusal.empty());
    }
    origin.expectLaw();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto bytes = std::as_bytes(std::span(data, size));
    if (bytes.empty()) return 0;
    if (data[0] % 3 == 0) asTheyCome(bytes.subspan(1));
    if (data[0] % 3 == 1) ofThree({bytes.subspan(1)});
    if (data[0] % 3 == 2) ofOne({bytes.subspan(1)});
    return 0;
}
