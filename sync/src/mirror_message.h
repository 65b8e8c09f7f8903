// The messages of a mirror besides its records (PROTOCOL.md, "Mirror"): a prologue of 8 bytes, then fixed fields.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include <rtsg/sync/byte_buffer.h>

#include "wire.h"

namespace rtsg::mirror {

constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kPrologue = 8;
constexpr std::size_t kLongestName = 200;

enum class Message : std::uint8_t {
    hello = 1,     // client: session, dictionary hash, epoch, sequence, window, name
    ack = 2,       // client: session, sequence, bytes received
    ping = 3,      // either: token
    pong = 4,      // either: the same token
    bye = 5,       // either
    welcome = 16,  // server: session, epoch, heartbeat in ms; second part: head record
    data = 17,     // server: session, record size, offset; second part: the record's bytes from there
    unknown = 18,  // server: I do not know you, say hello
    refused = 19,  // server: reason
};

inline void begin(ByteBuffer& out, Message type) {
    out.clear();
    out.append("RTSG", 4);
    out.put(kVersion);
    out.put(static_cast<std::uint8_t>(type));
    out.put(std::uint16_t{0});
}

/// The type, if the prologue is one of this version; `in` then stands behind it.
inline std::optional<Message> readPrologue(wire::Reader& in) {
    if (in.left() < kPrologue || std::memcmp(in.at, "RTSG", 4) != 0) return std::nullopt;
    in.at += 4;
    const auto version = in.number<std::uint8_t>();
    const auto type = in.number<std::uint8_t>();
    const auto zero = in.number<std::uint16_t>();
    if (version != kVersion || zero != 0) return std::nullopt;
    return static_cast<Message>(type);
}

struct Hello {
    std::uint64_t session = 0, dictionaryHash = 0, epoch = 0, sequence = 0, window = 0;
    std::string name;

    void write(ByteBuffer& out) const {
        begin(out, Message::hello);
        for (const std::uint64_t number : {session, dictionaryHash, epoch, sequence, window}) out.put(number);
        wire::putText(out, name);
    }
    bool read(wire::Reader& in) {
        for (std::uint64_t* number : {&session, &dictionaryHash, &epoch, &sequence, &window})
            *number = in.number<std::uint64_t>();
        name = in.text();
        return !in.problem && !in.left() && name.size() <= kLongestName;
    }
};

/// Messages that are a prologue and numbers.
template <std::size_t N>
void write(ByteBuffer& out, Message type, const std::uint64_t (&numbers)[N]) {
    begin(out, type);
    for (const std::uint64_t number : numbers) out.put(number);
}
template <std::size_t N>
bool read(wire::Reader& in, std::uint64_t (&numbers)[N]) {
    for (std::uint64_t& number : numbers) number = in.number<std::uint64_t>();
    return !in.problem && !in.left();
}

}  // namespace rtsg::mirror
