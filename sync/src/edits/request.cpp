// Writes and reads requests.
#include "request.h"

#include <algorithm>

#include <fmt/format.h>

#include "columns/blocks.h"
#include "columns/wire.h"

namespace rtsg::mirror {

namespace {

/// True if the record begins with descriptions of types.
bool describes(std::span<const std::byte> record) {
    return record.size() > kRecordHeaderSize &&
           std::to_integer<unsigned>(record[kRecordHeaderSize]) == wire::kDescriptions;
}

Result<MirrorRequest> readOther(std::span<const std::byte> record) {
    wire::Reader in(record.subspan(kRecordHeaderSize), kRecordHeaderSize);
    MirrorRequest request;
    const unsigned kind = in.number<std::uint8_t>();
    if (kind < static_cast<unsigned>(MirrorRequest::Kind::undo) ||
        kind > static_cast<unsigned>(MirrorRequest::Kind::lock))
        in.refuse("an unknown kind of request");
    request.kind = static_cast<MirrorRequest::Kind>(kind);
    if (request.kind == MirrorRequest::Kind::lock) {
        const std::uint64_t lease = in.varint();
        if (lease > static_cast<std::uint64_t>(MirrorRequest::kLongestLease.count()))
            in.refuse("a lease longer than may be given");
        request.lease = std::chrono::milliseconds(lease);
        const std::size_t count = in.count(1);
        if (count > MirrorRequest::kMaxLocked) in.refuse("too many nodes in one request");
        std::uint32_t last = 0;
        for (std::size_t i = 0; i < count && !in.problem; ++i) request.nodes.push_back(NodeId{last = in.delta(last)});
    }
    if (in.problem) return std::unexpected(wire::describe(in, "request"));
    return request;
}

}  // namespace

void writeRequest(ChangeEncoder& encoder, MirrorRequest request, std::uint64_t state, ByteBuffer& record) {
    if (request.kind == MirrorRequest::Kind::changes) {
        ChangeSet set;
        set.from = set.to = state;
        set.changes = std::move(request.changes);
        return encoder.encode(set, record);
    }
    record.clear();
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.put(static_cast<std::uint8_t>(request.kind));
    if (request.kind == MirrorRequest::Kind::lock) {
        record.putVarint(static_cast<std::uint64_t>(request.lease.count()));
        record.putVarint(request.nodes.size());
        std::uint32_t last = 0;
        for (const NodeId node : request.nodes)
            record.putVarint(wire::zigzag(node.value, std::exchange(last, node.value)));
    }
    RecordHeader header;
    header.kind = RecordKind::request;
    header.from = header.to = state;
    sealRecord(record, header);
}

Result<MirrorRequest> readRequest(std::span<const std::byte> record, bool describesTypes) {
    if (const auto intact = checkRecord(record); !intact) return std::unexpected(intact.error());
    const Result<RecordHeader> header = parseRecordHeader(record);
    if (!header) return std::unexpected(header.error());
    if (header->kind == RecordKind::request) return readOther(record);
    ChangeDecoder decoder(builtinTypes(), 0);
    if (describesTypes && describes(record)) {
        StreamHead theirs;
        theirs.dictionaryHash = 1;  // any hash but ours: types are then mapped by name as they are described
        theirs.builtinTypes = 0xFFFF;
        if (auto ok = decoder.setHead(theirs); !ok) return std::unexpected(ok.error());
    }
    ChangeSet set;
    if (auto ok = decoder.decode(record, set); !ok) return std::unexpected(ok.error());
    MirrorRequest request;
    request.changes = std::move(set.changes);
    return request;
}

}  // namespace rtsg::mirror
