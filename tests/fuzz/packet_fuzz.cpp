// Messages of a NATS server of any kind: what is unpacked lies within them, and is packed to the same again.
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
    return 0;
}
