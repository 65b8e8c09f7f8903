// Packs messages of mirrors for NATS, and unpacks untrusted ones.
#include "packet.h"

#include <cstring>

namespace rtsg::nats {

void pack(ByteBuffer& out, std::span<const std::byte> first, std::span<const std::byte> second) {
    out.clear();
    out.put(static_cast<std::uint32_t>(first.size()));
    out.append(first);
    out.append(second);
}

std::optional<Packet> split(std::string_view bytes) {
    std::uint32_t length = 0;
    if (bytes.size() < sizeof(length)) return std::nullopt;
    std::memcpy(&length, bytes.data(), sizeof(length));
    const auto parts = std::as_bytes(std::span(bytes)).subspan(sizeof(length));
    if (length > parts.size()) return std::nullopt;
    return Packet{{}, parts.first(length), parts.subspan(length)};
}

std::optional<Packet> unpack(std::string_view bytes) {
    auto packet = split(bytes);
    if (!packet) return std::nullopt;
    wire::Reader in(packet->first);
    const auto type = mirror::readPrologue(in);
    if (!type) return std::nullopt;
    packet->type = *type;
    return packet;
}

std::optional<Foreign> foreign(std::string_view bytes) {
    const auto packet = split(bytes);
    const auto version = packet ? mirror::foreignVersion(packet->first) : std::nullopt;
    return version ? std::optional(Foreign{*version, packet->first}) : std::nullopt;
}

std::uint64_t sessionOf(std::span<const std::byte> first) {
    std::uint64_t session = 0;
    if (first.size() >= mirror::kPrologue + sizeof(session))
        std::memcpy(&session, first.data() + mirror::kPrologue, sizeof(session));
    return session;
}

void withSession(ByteBuffer& out, std::span<const std::byte> first, std::uint64_t session) {
    out.clear();
    out.append(first);
    if (first.size() >= mirror::kPrologue + sizeof(session))
        std::memcpy(out.data() + mirror::kPrologue, &session, sizeof(session));
}

}  // namespace rtsg::nats
