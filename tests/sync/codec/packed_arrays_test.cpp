// Packed arrays: bit for bit what was written, in few bytes where numbers have an order, and no trust in forged ones.
#include "columns/packed_arrays.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace rtsg {
namespace {

constexpr std::uint32_t kArraySeed = 20261121;

template <class T>
std::string bytesOf(const Array<T>& array) {
    return {reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T)};
}

ByteBuffer packed(const Value& value) {
    ByteBuffer out;
    wire::putPacked(out, value);
    return out;
}

/// Reads what is packed at the very end of its bytes, and with bytes behind it; returns how long it was.
template <class T>
std::size_t expectSameArray(const Array<T>& array) {
    ByteBuffer out = packed(Value(array));
    const std::size_t size = out.size();
    for (const std::size_t behind : {0, 1, 7, 8, 100}) {
        out.append(std::string(behind, '\xff').data(), behind);
        // A copy of just this length, so that whoever reads beyond it is found out by AddressSanitizer.
        const std::vector<std::byte> exact(out.data(), out.data() + size + behind);
        wire::Reader in(exact);
        const Value back = wire::readPacked(in, FieldTypeOf<Array<T>>::value);
        EXPECT_EQ(in.problem, nullptr) << in.problem;
        EXPECT_EQ(in.left(), behind);
        EXPECT_TRUE(bytesOf(back.as<Array<T>>()) == bytesOf(array)) << array.size() << " elements";
        out.setEnd(out.data() + size);
    }
    return size;
}

/// Numbers as fields have them: of few digits, in order, alike, without any order, and odd.
class RandomNumbers {
  public:
    explicit RandomNumbers(std::uint32_t seed) : random_(seed) {}
    std::size_t size() {
        constexpr std::size_t kSizes[] = {0, 1, 2, 3, 7, 8, 9, 100, 1023, 1024, 1025, 2050};
        return kSizes[random_() % std::size(kSizes)];
    }
    void begin() {
        kind_ = random_() % 6;
        digits_ = random_() % 9;
        pattern_ = 1 + random_() % 9;
        at_ = static_cast<float>(random_() % 1000);
    }
    float operator()() {
        ++count_;
        if (random_() % 64 == 0 && kind_ > 1) return special();
        switch (kind_) {
            case 0:
                return std::bit_cast<float>(static_cast<std::uint32_t>(random_()));
            case 1:
                return at_;
            case 2:
                return at_ += .25f;
            case 3:
                return static_cast<float>(count_ % pattern_);
            default: {
                const double scale = std::pow(10.0, digits_);
                return static_cast<float>(std::round(std::uniform_real_distribution<double>(-9, 9)(random_) * scale) /
                                          scale);
            }
        }
    }

  private:
    float special() {
        constexpr float kSpecial[] = {-0.f, 0.f,          std::numeric_limits<float>::infinity(), -1e30f, 1e-42f,
                                      3e9f, -2147483648.f};
        if (random_() % 8 == 0) return std::bit_cast<float>(0xFFC01234u);  // a NaN with a payload
        return kSpecial[random_() % std::size(kSpecial)];
    }
    std::mt19937 random_;
    unsigned kind_ = 0, digits_ = 0, pattern_ = 1, count_ = 0;
    float at_ = 0;
};

template <class T>
void expectSameOfAll(RandomNumbers& numbers) {
    for (int round = 0; round < 60; ++round) {
        SCOPED_TRACE(testing::Message() << "seed " << kArraySeed << ", round " << round);
        numbers.begin();
        Array<T> array = Array<T>::ofSize(numbers.size());
        auto* to = reinterpret_cast<float*>(array.mutableData());
        for (std::size_t i = 0; i < array.size() * sizeof(T) / sizeof(float); ++i) to[i] = numbers();
        expectSameArray(array);
    }
}

TEST(PackedArrays, FloatsComeBackBitForBit) {
    RandomNumbers numbers(kArraySeed);
    expectSameOfAll<float>(numbers);
    expectSameOfAll<Vec2f>(numbers);
    expectSameOfAll<Vec3f>(numbers);
    expectSameOfAll<Color>(numbers);
    expectSameOfAll<Vec4f>(numbers);
    expectSameOfAll<ColorRGBA>(numbers);
    expectSameOfAll<Rotation>(numbers);
}

TEST(PackedArrays, WholeNumbersComeBack) {
    std::mt19937 random(kArraySeed);
    for (int round = 0; round < 200; ++round) {
        SCOPED_TRACE(testing::Message() << "seed " << kArraySeed << ", round " << round);
        const auto range = static_cast<std::uint32_t>((std::uint64_t{1} << random() % 33) - 1);
        const unsigned lag = 1 + random() % 9;
        Array<std::int32_t> array;
        for (std::size_t i = 0, size = random() % 2100; i < size; ++i) {
            const auto before = i >= lag ? static_cast<std::uint32_t>(array[i - lag]) : 0u;
            array.push_back(static_cast<std::int32_t>(before + 5 + (random() & range)));
        }
        expectSameArray(array);
    }
    expectSameArray(Array<std::int32_t>{INT32_MIN, INT32_MAX, 0, -1, INT32_MIN, INT32_MAX});
}

TEST(PackedArrays, NumbersWithAnOrderTakeFewBytes) {
    Array<std::int32_t> triangles, polygons;
    Array<Vec3f> decimals;
    for (int i = 0; i < 4096; ++i) {
        for (const int corner : {i, i + 64, i + 1, i + 1, i + 64, i + 65}) triangles.push_back(corner);
        for (const int corner : {i, i + 1, i + 2, i + 3, -1}) polygons.push_back(corner);
        // Two decimals of a walk of at most .15 a step: 5 bits; one that stands; one that counts.
        decimals.push_back({static_cast<float>(i % 16) / 100, 7.25f, static_cast<float>(i) / 4});
    }
    // A block of 1,024 takes 10 bytes and its first numbers.
    EXPECT_LE(expectSameArray(triangles), 4096u * 6 / 1024 * (10 + 6 * 4) + 8);
    // -1 stays where others count up: 1 bit each.
    EXPECT_LE(expectSameArray(polygons), 4096u * 5 / 8 + 21 * (10 + 5 * 4));
    EXPECT_LE(expectSameArray(decimals), 4096u * 5 / 8 + 12 * 20);
    // Random numbers take their size, and 1 % more.
    std::mt19937 random(kArraySeed);
    Array<std::int32_t> noise;
    for (int i = 0; i < 4096; ++i) noise.push_back(static_cast<std::int32_t>(random()));
    EXPECT_LE(expectSameArray(noise), 4096u * 4 * 101 / 100);
}

/// Numbers near 0 are decimals of ten digits, too, which would take more bits than they have.
TEST(PackedArrays, DecimalsOfManyDigitsAreKeptAsTheyAre) {
    std::mt19937 random(kArraySeed);
    Array<float> smooth;
    for (int i = 0; i < 1024; ++i)
        smooth.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(0x3DCCCCCDu + random() % 256)));
    EXPECT_LE(expectSameArray(smooth), 1024u * 9 / 8 + 20);
}

/// The bytes of PROTOCOL.md, made by hand.
TEST(PackedArrays, TheBytesAreThoseOfTheProtocol) {
    const auto hex = [](const ByteBuffer& bytes) {
        std::string text;
        for (const std::byte b : bytes.bytes()) text += fmt::format("{:02x}", std::to_integer<unsigned>(b));
        return text;
    };
    // 4 elements; 1 bit, lag 1, base 1; the first is 5; then +1, +2, +1: bits 0, 1, 0.
    EXPECT_EQ(hex(packed(Value(Array<std::int32_t>{5, 6, 8, 9}))),
              "04"
              "01"
              "01"
              "01000000"
              "05000000"
              "02");
    // 3 elements; decimals of no bits, lag 1, base 5; exponent 2, no odd ones; the first is 25.
    EXPECT_EQ(hex(packed(Value(Array<float>{.25f, .3f, .35f}))),
              "03"
              "80"
              "01"
              "05000000"
              "02"
              "00"
              "19000000");
    // -0 is odd, at 1, and repeats the number before it: differences 0 and 2, of 2 bits.
    EXPECT_EQ(hex(packed(Value(Array<float>{1, -0.f, 3}))),
              "03"
              "82"
              "01"
              "00000000"
              "00"
              "01"
              "0100"
              "00000080"
              "01000000"
              "08");
    EXPECT_EQ(hex(packed(Value(Array<float>()))), "00");
}

TEST(PackedArrays, ForgedOnesAreRefusedOrRead) {
    RandomNumbers numbers(kArraySeed);
    std::mt19937 random(kArraySeed);
    int refused = 0;
    for (int round = 0; round < 3000; ++round) {
        SCOPED_TRACE(testing::Message() << "seed " << kArraySeed << ", round " << round);
        numbers.begin();
        Array<Vec2f> array = Array<Vec2f>::ofSize(random() % 40);
        for (std::size_t i = 0; i < array.size(); ++i) array.mutableData()[i] = {numbers(), numbers()};
        const ByteBuffer good = packed(Value(array));
        std::vector<std::byte> bytes(good.data(), good.data() + good.size());
        for (unsigned i = 0; i < 1 + random() % 3; ++i) bytes[random() % bytes.size()] ^= std::byte(1u << random() % 8);
        if (random() % 4 == 0) bytes.resize(random() % bytes.size());
        wire::Reader in(bytes);
        wire::Budget budget(bytes.size());
        in.budget = &budget;
        (void)wire::readPacked(in, FieldType::MFVec2f);
        refused += in.problem != nullptr;
    }
    EXPECT_GT(refused, 500);
}

TEST(PackedArrays, WhatCannotBeIsRefusedBeforeMemoryIsTaken) {
    const auto problem = [](const std::string& bytes, FieldType type) -> std::string {
        wire::Reader in(std::as_bytes(std::span(bytes)));
        wire::Budget budget(bytes.size());
        in.budget = &budget;
        (void)wire::readPacked(in, type);
        return in.problem ? in.problem : "";
    };
    const std::string lane("\x01\x01\x01\0\0\0\x05\0\0\0\x02", 11);
    EXPECT_EQ(problem("\x04" + lane, FieldType::MFInt32), "");
    EXPECT_EQ(problem("\xff\xff\xff\xff\x7f" + lane, FieldType::MFInt32), "count exceeds the bytes that follow");
    // 2^15 blocks of no bits: 134 MB from 330 kB.
    std::string large("\x80\x80\x80\x10");
    for (int i = 0; i < 32768; ++i) large += std::string("\0\x01\x01\0\0\0\x05\0\0\0", 10);
    EXPECT_EQ(problem(large, FieldType::MFInt32), "takes more memory than a record of this length may");
    EXPECT_EQ(problem(std::string("\x04\x21", 2) + lane.substr(1), FieldType::MFInt32), "unknown packing");
    EXPECT_EQ(problem(std::string("\x04\x01\x00", 3) + lane.substr(2), FieldType::MFInt32), "unknown packing");
    EXPECT_EQ(problem(std::string("\x04\x01\x09", 3) + lane.substr(2), FieldType::MFInt32), "unknown packing");
    EXPECT_EQ(problem(std::string("\x04\x81", 2) + lane.substr(1), FieldType::MFInt32), "unknown packing");
    EXPECT_EQ(problem("\x04" + lane.substr(0, 10), FieldType::MFInt32), "packed numbers cut short");
    EXPECT_EQ(problem(std::string("\x03\x80\x01\x05\0\0\0\x0b\0\x19\0\0\0", 13), FieldType::MFFloat),
              "unknown packing");
    EXPECT_EQ(problem(std::string("\x03\x82\x01\0\0\0\0\0\x01\x03\0\0\0\0\x80\x01\0\0\0\x08", 20), FieldType::MFFloat),
              "a number beyond its block");
    EXPECT_EQ(problem("\x04" + lane, FieldType::MFDouble), "a type that is not packed");
}

}  // namespace
}  // namespace rtsg
