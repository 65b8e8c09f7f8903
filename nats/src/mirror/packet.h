// Packets: a mirror's message of one or two parts as one NATS message (PROTOCOL.md, "NATS"), and its session.
//
// Threading: free functions without state.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include <rtsg/sync/byte_buffer.h>

#include "sockets/message.h"

namespace rtsg::nats {

struct Packet {
    mirror::Message type{};
    std::span<const std::byte> first, second;
    wire::Reader fields() const { return wire::Reader(first.subspan(mirror::kPrologue)); }
};

/// `out` becomes the length of the first part (u32), that part, and the second one.
void pack(ByteBuffer& out, std::span<const std::byte> first, std::span<const std::byte> second = {});
/// The parts of a message of any type. Nothing if it is no packet.
std::optional<Packet> split(std::string_view bytes);
/// Nothing if it is no packet with a message of this protocol.
std::optional<Packet> unpack(std::string_view bytes);

/// The version of a message of another one, with its first part.
struct Foreign {
    std::uint8_t version = 0;
    std::span<const std::byte> first;
};
std::optional<Foreign> foreign(std::string_view bytes);

/// The number behind the prologue, which in most messages is the session; 0 if there is none.
std::uint64_t sessionOf(std::span<const std::byte> first);
/// `out` becomes the message with another session. Precondition: it has one.
void withSession(ByteBuffer& out, std::span<const std::byte> first, std::uint64_t session);

}  // namespace rtsg::nats
