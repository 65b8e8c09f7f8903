// Messages of a mirror beside its records (PROTOCOL.md, "Mirror"): a prologue of 8 bytes, then fixed fields. Readers
// ignore anything after the fields they know, so that later versions can append.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <rtsg/core/change.h>
#include <rtsg/sync/byte_buffer.h>

#include "columns/wire.h"

namespace rtsg::mirror {

constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kPrologue = 8;
constexpr std::size_t kLongestName = 200;
constexpr std::size_t kMaxParts = 1024;  // subtrees that a peer may name in its hello
constexpr std::size_t kLongestControl = 200;
constexpr std::size_t kSubmitPart = 8 << 10;  // bytes of a submission in one message
constexpr std::size_t kLongestSubmission = 1 << 20;

enum class Message : std::uint8_t {
    hello = 1,     // client: session, dictionary hash, epoch, sequence, window, name, wishes
    ack = 2,       // client: session, sequence, bytes received
    ping = 3,      // either: token
    pong = 4,      // either: the same token; from servers, their clock in ns
    bye = 5,       // either
    doubt = 6,     // client: session, ranges of nodes whose hashes it wants
    inspect = 7,   // client: session, nodes whose parts' hashes it wants
    want = 8,      // client: session, parts of nodes it wants anew
    submit = 9,    // client: session, request, size, offset; second part: bytes of a record from there
    control = 10,  // client: session, command for the player of a log
    welcome = 16,  // server: session, epoch, heartbeat in ms, newest state; second part: head record
    data = 17,     // server: session, record size, offset, clock; second part: the record's bytes from there
    unknown = 18,  // server: the client is unknown and must say hello
    refused = 19,  // server: reason
    digest = 20,   // server: session, state, hashes of ranges
    anatomy = 21,  // server: session, state, hashes of the parts of nodes
    verdict = 22,  // server: session, request, state, reason of refusal, numbers of new nodes
    reply = 23,    // server: session, reply to a control
};

inline void begin(ByteBuffer& out, Message type) {
    out.clear();
    out.append("RTSG", 4);
    out.put(kVersion);
    out.put(static_cast<std::uint8_t>(type));
    out.put(std::uint16_t{0});
}

/// The type, if this is a prologue of this version; `in` then stands behind it.
inline std::optional<Message> readPrologue(wire::Reader& in) {
    if (in.left() < kPrologue || std::memcmp(in.at, "RTSG", 4) != 0) return std::nullopt;
    in.at += 4;
    const auto version = in.number<std::uint8_t>();
    const auto type = in.number<std::uint8_t>();
    const auto zero = in.number<std::uint16_t>();
    if (version != kVersion || zero != 0) return std::nullopt;
    return static_cast<Message>(type);
}

/// The version of a message of another one, if this is its prologue, which is the same in all versions.
inline std::optional<std::uint8_t> foreignVersion(std::span<const std::byte> bytes) {
    if (bytes.size() < kPrologue || std::memcmp(bytes.data(), "RTSG", 4) != 0) return std::nullopt;
    const auto version = std::to_integer<std::uint8_t>(bytes[4]);
    return version == kVersion ? std::nullopt : std::optional(version);
}
inline Message foreignType(std::span<const std::byte> bytes) {
    return static_cast<Message>(bytes[5]);
}
/// Tells a client of another version which one is spoken here, in its own: a refusal is the same in all versions.
inline void refuseVersion(ByteBuffer& out, std::uint8_t theirs) {
    begin(out, Message::refused);
    out.data()[4] = std::byte{theirs};
    wire::putText(out, "this server speaks version " + std::to_string(kVersion) +
                           " of the protocol, and this client version " + std::to_string(theirs));
    out.put(std::uint8_t{1});
}
/// The same as a client reports it.
inline std::string versionText(std::uint8_t theirs) {
    return "this server speaks version " + std::to_string(theirs) + " of the protocol, and this client version " +
           std::to_string(kVersion);
}

/// A client's wishes beyond following the scene. Each may be left out.
struct Wishes {
    std::uint64_t client = 0;       // the client's name in all its connections, for its requests
    std::uint8_t whenSlow = 0;      // 0: merged frames; 1: the scene waits; 2: a keyframe; 3: merged, near things first
    std::uint32_t milliFrames = 0;  // most frames in 1000 s; 0 for all
    std::uint32_t aspects = 0;      // bit n: aspect n; 0 for all
    std::vector<std::string> parts;  // subtrees by DEF name or #number, or one region; empty for all
    bool inputs = false;             // it runs the cascade itself and wants the input of each frame
    std::uint32_t lag = 0;           // ms by which it may lag, beside the delay; 0 for any
    std::uint64_t rate = 0;          // most bytes a second; 0 for any
    Hash128 hash;                    // of the state it is in, as the server said; 0 if unknown

    bool partial() const { return aspects != 0 || !parts.empty(); }
    void write(ByteBuffer& out) const {
        out.put(client);
        out.put(whenSlow);
        out.put(milliFrames);
        out.put(aspects);
        wire::putTexts(out, parts);
        out.put(static_cast<std::uint8_t>(inputs));
        out.put(lag);
        out.put(rate);
        out.put(hash.low);
        out.put(hash.high);
    }
    void read(wire::Reader& in) {
        client = in.number<std::uint64_t>();
        whenSlow = in.number<std::uint8_t>();
        milliFrames = in.number<std::uint32_t>();
        aspects = in.number<std::uint32_t>();
        const std::size_t count = in.count(1);
        if (count > kMaxParts) in.refuse("too many parts");
        for (std::size_t i = 0; i < count && !in.problem; ++i) parts.emplace_back(in.text());
        if (in.left() && !in.problem) inputs = in.number<std::uint8_t>() & 1u;
        if (in.left() < sizeof(lag) + sizeof(rate) || in.problem) return;
        lag = in.number<std::uint32_t>();
        rate = in.number<std::uint64_t>();
        if (in.left() < sizeof(hash) || in.problem) return;
        hash.low = in.number<std::uint64_t>();
        hash.high = in.number<std::uint64_t>();
    }
};

struct Hello {
    std::uint64_t session = 0, dictionaryHash = 0, epoch = 0, sequence = 0, window = 0;
    std::string name;
    Wishes wishes;

    void write(ByteBuffer& out) const {
        begin(out, Message::hello);
        for (const std::uint64_t number : {session, dictionaryHash, epoch, sequence, window}) out.put(number);
        wire::putText(out, name);
        wishes.write(out);
    }
    bool read(wire::Reader& in) {
        for (std::uint64_t* number : {&session, &dictionaryHash, &epoch, &sequence, &window})
            *number = in.number<std::uint64_t>();
        name = in.text();
        if (in.left()) wishes.read(in);
        return !in.problem && name.size() <= kLongestName;
    }
};

/// Messages that begin with a prologue and numbers.
template <std::size_t N>
void write(ByteBuffer& out, Message type, const std::uint64_t (&numbers)[N]) {
    begin(out, type);
    for (const std::uint64_t number : numbers) out.put(number);
}
template <std::size_t N>
bool read(wire::Reader& in, std::uint64_t (&numbers)[N]) {
    for (std::uint64_t& number : numbers) number = in.number<std::uint64_t>();
    return !in.problem;
}

/// Session and text: a command for the player of a log, or its reply.
struct Words {
    std::uint64_t session = 0;
    std::string text;

    void write(ByteBuffer& out, Message type) const {
        begin(out, type);
        out.put(session);
        wire::putText(out, text);
    }
    bool read(wire::Reader& in) {
        session = in.number<std::uint64_t>();
        text = in.text();
        return !in.problem;
    }
    /// Reads a command. The server checks it before anything else.
    bool readControl(wire::Reader& in) { return read(in) && text.size() <= kLongestControl; }
};

}  // namespace rtsg::mirror
