// Messages of a NATS server of any kind: what is unpacked lies within them, and is packed to the same again; records
// that come in parts are complete only with all their bytes.
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "mirror/packet.h"

namespace {

using namespace rtsg;

void expect(bool condition) {
    if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    if (const auto packet = nats::unpack(bytes)) {
        ByteBuffer again;
        nats::pack(again, packet->first, packet->second);
        expect(again.size() == size && std::memcmp(again.data(), data, size) == 0);
        ByteBuffer other;
        nats::withSession(other, packet->first, 7);
        expect(other.size() == packet->first.size());
        const std::uint64_t session = nats::sessionOf(packet->first);
        nats::withSession(other, packet->first, session);
        expect(std::memcmp(other.data(), packet->first.data(), other.size()) == 0);
    }
    // Parts: two bytes each of the size, the offset and the length, then as many.
    nats::RecordParts parts;
    const auto number = [&](std::size_t at) { return static_cast<std::uint64_t>(data[at]) << 8 | data[at + 1]; };
    for (std::size_t at = 0; at + 6 <= size;) {
        const std::uint64_t whole = number(at), offset = number(at + 2);
        const std::size_t length = std::min<std::size_t>(number(at + 4), size - at - 6);
        const auto step = parts.add(whole, offset, std::as_bytes(std::span(data + at + 6, length)));
        expect(step != nats::RecordParts::Step::complete || parts.bytes().size() == whole);
        expect(step != nats::RecordParts::Step::more || parts.bytes().size() < whole);
        expect(step != nats::RecordParts::Step::misfit || parts.bytes().size() == 0);
        at += 6 + length;
    }
    return 0;
}
