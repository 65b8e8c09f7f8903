// Packs messages of mirrors for NATS, and unpacks untrusted ones.
#include "packet.h"

#include <cstring>

#include <rtsg/sync/record.h>

namespace rtsg::nats {

namespace {

constexpr std::size_t kLength = sizeof(std::uint32_t);

bool split(std::string_view bytes, Packet& packet) {
    std::uint32_t length = 0;
    if (bytes.size() < kLength) return false;
    std::memcpy(&length, bytes.data(), kLength);
    bytes.remove_prefix(kLength);
    if (length > bytes.size()) return false;
    packet.first = std::as_bytes(std::span(bytes.data(), length));
    packet.second = std::as_bytes(std::span(bytes.data() + length, bytes.size() - length));
    return true;
}

}  // namespace

void pack(ByteBuffer& out, std::span<const std::byte> first, std::span<const std::byte> second) {
    out.clear();
    out.put(static_cast<std::uint32_t>(first.size()));
    out.append(first);
    out.append(second);
}

std::optional<Packet> unpack(std::string_view bytes) {
    Packet packet;
    if (!split(bytes, packet)) return std::nullopt;
    wire::Reader in(packet.first);
    const auto type = mirror::readPrologue(in);
    if (!type) return std::nullopt;
    packet.type = *type;
    return packet;
}

std::optional<Foreign> foreign(std::string_view bytes) {
    Packet packet;
    if (!split(bytes, packet)) return std::nullopt;
    const auto version = mirror::foreignVersion(packet.first);
    return version ? std::optional(Foreign{*version, packet.first}) : std::nullopt;
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

RecordParts::Step RecordParts::add(std::uint64_t size, std::uint64_t offset, std::span<const std::byte> part) {
    if (offset == 0) {
        bytes_.clear();
        size_ = size;
    }
    if (part.empty() || size != size_ || size > kRecordHeaderSize + kMaxPayload || offset != bytes_.size() ||
        part.size() > size - offset) {
        bytes_.clear();
        size_ = 0;
        return Step::misfit;
    }
    bytes_.append(part);
    return bytes_.size() == size ? Step::complete : Step::more;
}

}  // namespace rtsg::nats
