// The memory of decoded records, counted on the heap: at most 4 times their length and 64 MiB, whatever they state; and
// writers make sure that their records are never refused for that.
#include <algorithm>
#include <functional>

#include <gtest/gtest.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/input_codec.h>

#include "sync/heap.h"

namespace rtsg {
namespace {

using test::HeapCount;

constexpr std::size_t kSmall = 300000, kLarge = std::size_t{12} << 20;  // bytes of payload
constexpr std::uint64_t kFree = std::uint64_t{64} << 20, kBookkeeping = 1 << 20;

struct Adversary {
    std::string_view name;
    RecordKind kind;
    /// A payload of about so many bytes that becomes as much as it can.
    std::function<void(ByteBuffer&, std::size_t)> payload;
};

void block(ByteBuffer& out, unsigned kind, std::uint64_t count, const ByteBuffer& body) {
    out.put(static_cast<std::uint8_t>(kind));
    out.putVarint(count);
    out.putVarint(body.size());
    out.append(body.bytes());
}

/// `row` again and again, `head` in front.
std::function<void(ByteBuffer&, std::size_t)> rows(unsigned kind, std::vector<int> row, std::vector<int> head = {}) {
    return [=](ByteBuffer& out, std::size_t size) {
        ByteBuffer body;
        for (const int byte : head) body.put(static_cast<std::uint8_t>(byte));
        std::uint64_t count = 0;
        for (; body.size() < size; ++count)
            for (const int byte : row) body.put(static_cast<std::uint8_t>(byte));
        block(out, kind, count, body);
    };
}

/// A column of fixed size: all nodes, then all values.
std::function<void(ByteBuffer&, std::size_t)> column(int type, std::size_t valueSize) {
    return [=](ByteBuffer& out, std::size_t size) {
        ByteBuffer body;
        for (const int byte : {0, 1, type, 0}) body.put(static_cast<std::uint8_t>(byte));
        const std::size_t count = size / (1 + valueSize);
        for (std::size_t i = 0; i < count; ++i) body.put(std::uint8_t{2});
        for (std::size_t i = 0; i < count * valueSize; ++i) body.put(std::uint8_t{0});
        block(out, 4, count, body);
    };
}

/// One value of many elements, in an event.
std::function<void(ByteBuffer&, std::size_t)> elements(int type, std::vector<int> element) {
    return [=](ByteBuffer& out, std::size_t size) {
        ByteBuffer body, many;
        std::uint64_t count = 0;
        for (; many.size() < size; ++count)
            for (const int byte : element) many.put(static_cast<std::uint8_t>(byte));
        for (const int byte : {4, 0, type}) body.put(static_cast<std::uint8_t>(byte));
        body.putVarint(count);
        body.append(many.bytes());
        block(out, 8, 1, body);
    };
}

/// Types of one field each, or one type of many, the shortest there are.
std::function<void(ByteBuffer&, std::size_t)> types(unsigned kind, std::size_t fields) {
    return [=](ByteBuffer& out, std::size_t size) {
        ByteBuffer body;
        std::uint64_t count = 0;
        for (; body.size() < size; ++count) {
            ByteBuffer type;
            const std::string name = std::to_string(count);
            type.putVarint(name.size());
            type.append(name.data(), name.size());
            for (const int byte : {0, 0, 1, 0, 0, 0}) type.put(static_cast<std::uint8_t>(byte));
            const std::size_t maximum = std::min<std::size_t>(fields, 60000);
            type.putVarint(maximum);
            for (std::size_t f = 0; f < maximum; ++f) {
                const std::string field = std::to_string(f);
                type.putVarint(field.size() + 4);
                type.putVarint(field.size());
                type.append(field.data(), field.size());
                for (const int byte : {0, 3, 0}) type.put(static_cast<std::uint8_t>(byte));
            }
            body.putVarint(count % 60000 * (kind == 1 ? 2 : 1));
            body.putVarint(type.size());
            body.append(type.bytes());
        }
        block(out, kind, count, body);
    };
}

const Adversary kAdversaries[] = {
    {"destroyed nodes", RecordKind::frame, rows(7, {4})},
    {"created nodes", RecordKind::keyframe, rows(2, {4, 1, 0})},
    {"names of a letter", RecordKind::frame, rows(5, {4, 1, 'x'})},
    {"routes", RecordKind::frame, rows(6, {0, 2, 0, 2, 0})},
    {"single children", RecordKind::frame, rows(3, {0, 2, 0, 2})},
    {"lists of one child", RecordKind::frame, rows(3, {1, 2, 0, 1, 2})},
    {"booleans", RecordKind::frame, column(0, 1)},
    {"numbers", RecordKind::frame, column(2, 4)},
    {"matrices", RecordKind::frame, column(40, 128)},
    {"empty lists", RecordKind::frame, column(1, 1)},
    {"texts of a letter", RecordKind::frame, elements(11, {1, 'x'})},
    {"empty texts", RecordKind::frame, elements(11, {0})},
    {"texts of nine letters", RecordKind::frame, elements(11, {9, 1, 2, 3, 4, 5, 6, 7, 8, 9})},
    {"images of a word", RecordKind::frame, elements(19, {1, 0, 0, 0, 0})},
    {"events of a letter", RecordKind::frame, rows(8, {4, 0, 10, 1, 'x'})},
    {"events with a list of one", RecordKind::frame, rows(8, {4, 0, 1, 1, 1})},
    {"types of a field", RecordKind::frame, types(1, 1)},
    {"types of many fields", RecordKind::frame, types(1, 3000)},
    {"descriptions", RecordKind::frame, types(0, 3)},
    {"woken nodes", RecordKind::input, rows(17, {2})},
    {"calls", RecordKind::input, rows(18, {2, 2, 0})},
    {"calls with an effect", RecordKind::input, rows(18, {2, 2, 1, 0, 0, 10, 1, 'x'})},
    {"behaviours", RecordKind::input, rows(19, {1, 1})},
    {"edits and events", RecordKind::input, rows(8, {4, 0, 0, 1})},
};

ByteBuffer recordOf(const Adversary& adversary, std::size_t size) {
    ByteBuffer record;
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    adversary.payload(record, size);
    RecordHeader header;
    header.kind = adversary.kind;
    header.from = adversary.kind == RecordKind::keyframe ? 0 : 1;
    header.to = 2;
    sealRecord(record, header);
    return record;
}

/// Bytes at the peak of decoding it, and what became of it.
std::pair<std::size_t, Result<>> decoded(const Adversary& adversary, const ByteBuffer& record, bool foreign) {
    StreamHead head;
    head.dictionaryHash = 1;
    head.builtinTypes = 60000;
    if (adversary.kind == RecordKind::input) {
        InputDecoder decoder;
        const HeapCount heap;
        ChangeSet set;
        Result<> ok = decoder.decode(record.bytes(), set);
        return {heap.peak(), ok};
    }
    ChangeDecoder decoder(builtinTypes());
    if (foreign) {
        EXPECT_TRUE(decoder.setHead(head));
    }
    const HeapCount heap;
    ChangeSet set;
    Result<> ok = decoder.decode(record.bytes(), set);
    return {heap.peak(), ok};
}

TEST(DecodedMemory, IsAtMostFourTimesTheRecordAndAConstant) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer has the heap";
    for (const Adversary& adversary : kAdversaries) {
        SCOPED_TRACE(adversary.name);
        const ByteBuffer small = recordOf(adversary, kSmall), large = recordOf(adversary, kLarge);
        const auto [some, ok] = decoded(adversary, small, false);
        EXPECT_TRUE(ok) << ok.error().text << ": the test itself is wrong";
        for (const bool foreign : {false, true}) {
            const auto [maximum, result] = decoded(adversary, large, foreign);
            // Edits of an input are a record of their own, with an account of its own.
            const std::uint64_t accounts = adversary.kind == RecordKind::input ? 2 : 1;
            EXPECT_LE(maximum, accounts * (4 * large.size() + kFree) + kBookkeeping)
                << large.size() << " bytes; " << (result ? "taken" : result.error().text);
        }
    }
}

/// Without the limit these would not be worth refusing.
TEST(DecodedMemory, WhatWouldTakeMoreIsRefusedBeforeItIsTaken) {
    if (!RTSG_HEAP_IS_OURS) GTEST_SKIP() << "the sanitizer has the heap";
    for (const char* name : {"destroyed nodes", "booleans", "texts of a letter", "calls"}) {
        const auto adversary = std::ranges::find(kAdversaries, std::string_view(name), &Adversary::name);
        const auto [maximum, result] = decoded(*adversary, recordOf(*adversary, kLarge), false);
        ASSERT_FALSE(result) << name;
        EXPECT_NE(result.error().text.find("more memory than a record of this length may"), std::string::npos)
            << result.error().text;
    }
}

TEST(DecodedMemory, HonestRecordsAreLongEnoughForWhatTheyBecome) {
    Change boolean;
    boolean.value = true;
    Change text;
    text.value = String("x");
    Change destroyed;
    destroyed.kind = ChangeKind::destroyNode;
    for (const Change& change : {boolean, text, destroyed}) {
        ChangeSet set, found;
        set.from = 1;
        set.to = 2;
        for (std::uint32_t i = 1; i <= 3000000; ++i) {
            set.changes.push_back(change);
            set.changes.back().node = NodeId{i};
            if (change.kind == ChangeKind::setField) set.changes.back().field = 0;
        }
        ByteBuffer record;
        ChangeEncoder({}, {}).encode(set, record);
        const Result<> ok = ChangeDecoder({}).decode(record.bytes(), found);
        ASSERT_TRUE(ok) << ok.error().text;
        EXPECT_EQ(found.changes, set.changes);
        // No longer than that: a seventh of what it becomes, say, is not added to a record that needs no more.
        EXPECT_LE(record.size(), (set.changes.size() * (sizeof(Change) + 72) - kFree) / 4 + 100);
    }
    // Where nothing is needed nothing is added.
    ChangeSet few;
    few.from = 1;
    few.to = 2;
    few.changes.assign(100000, boolean);
    ByteBuffer record;
    ChangeEncoder({}, {}).encode(few, record);
    EXPECT_LT(record.size(), 220000u);
}

}  // namespace
}  // namespace rtsg
