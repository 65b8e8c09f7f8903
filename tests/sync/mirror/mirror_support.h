// Helpers of the mirror's tests: waiting for conditions, and heads of other versions.
#pragma once

#include <chrono>
#include <cstring>
#include <functional>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <zmq.h>

#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record.h>

#include "support/middleman.h"

namespace rtsg::test {

using namespace std::chrono_literals;

/// Generous: only a failing test ever waits this long.
constexpr auto kPatience = 60s;
constexpr const char* kAnyPort = "tcp://127.0.0.1:*";

inline bool eventually(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(1ms);
    }
    return true;
}

inline bool pollUntil(MirrorClient& client, const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
        if (std::chrono::steady_clock::now() > end) return false;
        client.poll(5ms);
    }
    return true;
}

inline bool pollUntilAt(MirrorClient& client, const Scene& origin) {
    return pollUntil(client, [&] { return client.inStep() && client.statistics().sequence == origin.sequence(); });
}

/// The same head with another dictionary hash, as of another version of the program.
inline std::string withOtherTypes(const std::string& head) {
    const auto bytes = std::as_bytes(std::span(head));
    const RecordHeader header = *parseRecordHeader(bytes);
    ByteBuffer record;
    std::memcpy(record.room(head.size()), head.data(), head.size());
    record.advance(head.size());
    StreamHead parsed = *decodeHead(bytes);
    const std::string_view hash(reinterpret_cast<const char*>(&parsed.dictionaryHash), 8);
    const std::size_t at = head.find(hash, kRecordHeaderSize);
    EXPECT_NE(at, std::string::npos);
    record.data()[at] ^= std::byte{1};
    sealRecord(record, header);
    return {reinterpret_cast<const char*>(record.data()), record.size()};
}

}  // namespace rtsg::test
