// Feeds arbitrary bytes to every decoder of rtsg::sync, once as they come and once behind a valid header and checksum
// (what a hostile peer would send), and checks that whatever is accepted survives another round unchanged.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <ranges>
#include <span>

#include <rtsg/sync/change_codec.h>

namespace {

rtsg::ByteBuffer withHeader(std::span<const std::byte> payload, rtsg::RecordKind kind) {
    rtsg::ByteBuffer record;
    record.room(rtsg::kRecordHeaderSize);
    record.advance(rtsg::kRecordHeaderSize);
    record.append(payload);
    rtsg::RecordHeader header;
    header.kind = kind;
    header.from = kind == rtsg::RecordKind::frame ? 1 : 0;
    header.to = 2;
    rtsg::sealRecord(record, header);
    return record;
}

void decodeChanges(std::span<const std::byte> record) {
    rtsg::ChangeDecoder decoder({});
    rtsg::ChangeSet set;
    if (!decoder.decode(record, set)) return;
    rtsg::ByteBuffer first, second;
    rtsg::ChangeEncoder encoder({}, {});
    encoder.encode(set, first);
    if (!rtsg::checkRecord(first.bytes()) || !decoder.decode(first.bytes(), set)) std::abort();
    encoder.encode(set, second);
    if (!std::ranges::equal(first.bytes(), second.bytes())) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::span bytes(reinterpret_cast<const std::byte*>(data), size);
    if (rtsg::checkRecord(bytes)) decodeChanges(bytes);
    decodeChanges(withHeader(bytes, rtsg::RecordKind::frame).bytes());
    decodeChanges(withHeader(bytes, rtsg::RecordKind::keyframe).bytes());
    (void)rtsg::decodeHead(withHeader(bytes, rtsg::RecordKind::head).bytes());
    return 0;
}
