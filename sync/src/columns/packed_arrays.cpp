// Packs arrays block by block: whole numbers, or decimals as whole numbers, as differences of few bits.
#include "packed_arrays.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>

#include "lanes.h"

namespace rtsg::wire {

namespace {

constexpr std::size_t kBlock = 1024;       // elements
constexpr unsigned kDecimal = 0x80;        // a bit of the form byte; the others are the bits of a difference
constexpr unsigned kMaxExponent = 10;      // of powers of ten
constexpr std::size_t kMaxOdd = 32;        // numbers in a block that are not decimals
constexpr std::size_t kSmallestLane = 10;  // bytes: form, lag, base, a number
constexpr std::array<unsigned, 7> kLags = {1, 2, 3, 4, 5, 6, 8};
constexpr unsigned kMaxLag = 8;
constexpr std::array<double, kMaxExponent + 1> kPowers = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10};

using Numbers = std::array<std::uint32_t, kBlock>;

/// A number of the block that is not a decimal with its exponent.
struct Odd {
    std::uint16_t at;
    std::uint32_t bits;
};

struct Odds {
    std::array<Odd, kMaxOdd> all;
    std::size_t count = 0;
};

float decimal(std::uint32_t number, unsigned exponent) {
    return static_cast<float>(static_cast<double>(static_cast<std::int32_t>(number)) / kPowers[exponent]);
}

/// Finds the whole number that gives this f32 when divided by the power of ten. Returns false if there is none.
bool asDecimal(std::uint32_t bits, unsigned exponent, std::uint32_t& number) {
    const double scaled = static_cast<double>(std::bit_cast<float>(bits)) * kPowers[exponent];
    if (!(std::abs(scaled) < 2147483647.0)) return false;  // also refuses values that are not finite
    number = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lrint(scaled)));
    return std::bit_cast<std::uint32_t>(decimal(number, exponent)) == bits;
}

/// Converts all numbers. Those that are not decimals are listed and repeat the one before. Returns false if there are
/// too many.
bool asDecimals(std::span<const std::uint32_t> bits, unsigned exponent, Numbers& numbers, Odds& odds) {
    const std::size_t maximum = std::min(kMaxOdd, 1 + bits.size() / 32);
    odds.count = 0;
    std::uint32_t before = 0;
    for (std::size_t i = 0; i < bits.size(); ++i) {
        if (asDecimal(bits[i], exponent, numbers[i])) {
            before = numbers[i];
            continue;
        }
        if (odds.count == maximum || odds.count * 8 > i + 8) return false;  // the second condition gives up early
        odds.all[odds.count++] = {static_cast<std::uint16_t>(i), bits[i]};
        numbers[i] = before;
    }
    return true;
}

struct Packing {
    unsigned lag = 1, bits = 0;
    std::uint32_t base = 0;
    std::size_t cost = SIZE_MAX;  // in bits
};

/// Finds base and bits: each difference to the number `lag` before is base plus a number of `bits` bits.
Packing packingBy(std::span<const std::uint32_t> numbers, unsigned lag) {
    Packing result{lag, 0, 0, 32 * std::min<std::size_t>(lag, numbers.size())};
    if (numbers.size() <= lag) return result;
    std::int32_t minimum = INT32_MAX, maximum = INT32_MIN;
    for (std::size_t i = lag; i < numbers.size(); ++i) {
        const auto difference = static_cast<std::int32_t>(numbers[i] - numbers[i - lag]);
        minimum = std::min(minimum, difference);
        maximum = std::max(maximum, difference);
    }
    result.base = static_cast<std::uint32_t>(minimum);
    result.bits = static_cast<unsigned>(
        std::bit_width(static_cast<std::uint32_t>(maximum) - static_cast<std::uint32_t>(minimum)));
    result.cost += result.bits * (numbers.size() - lag);
    return result;
}

Packing bestPacking(std::span<const std::uint32_t> numbers, bool whole) {
    Packing best = packingBy(numbers, 1);
    if (best.bits == 0) return best;
    for (const unsigned lag : kLags)
        if (lag > 1 && (whole || lag <= 2))
            if (const Packing other = packingBy(numbers, lag); other.cost < best.cost) best = other;
    return best;
}

/// Writes `bits` bits of each number, least significant first.
void putBits(ByteBuffer& out, std::span<const std::uint32_t> numbers, const Packing& f) {
    if (f.bits == 0 || numbers.size() <= f.lag) return;
    const std::size_t count = numbers.size() - f.lag, size = (count * f.bits + 7) / 8;
    std::byte* at = out.room(size + sizeof(std::uint64_t));
    std::uint64_t waiting = 0;
    unsigned filled = 0;
    for (std::size_t i = f.lag; i < numbers.size(); ++i) {
        waiting |= std::uint64_t{numbers[i] - numbers[i - f.lag] - f.base} << filled;
        filled += f.bits;
        if (filled < 32) continue;
        std::memcpy(at, &waiting, 4);
        at += 4;
        waiting >>= 32;
        filled -= 32;
    }
    std::memcpy(at, &waiting, 8);
    out.advance(size);
}

/// One lane of a block, ready to be written.
struct Lane {
    Numbers numbers;
    Packing packing;
    bool isDecimal = false;
    unsigned exponent = 0;
    Odds odds;
};

/// Chooses decimals if they take fewer bits than the floats. `guess` is the exponent of the block before, because
/// numbers of one field have similar digits.
void chooseDecimals(std::span<const std::uint32_t> bits, unsigned& guess, Lane& lane) {
    constexpr unsigned kFew = 8;  // bits; other ways are unlikely to take fewer
    std::size_t size = bits.size();
    bool found = asDecimals(bits, lane.exponent = guess, lane.numbers, lane.odds);
    for (unsigned e = 0; e <= kMaxExponent && !found; ++e)
        found = e != guess && asDecimals(bits, lane.exponent = e, lane.numbers, lane.odds);
    if (found) {
        guess = lane.exponent;
        lane.packing = bestPacking({lane.numbers.data(), size}, false);
        lane.isDecimal = true;
        if (lane.packing.bits <= kFew) return;
    }
    Numbers plain;
    for (std::size_t i = 0; i < size; ++i) plain[i] = static_cast<std::uint32_t>(fromFloatBits(bits[i]));
    const Packing f = bestPacking({plain.data(), size}, false);
    constexpr std::size_t kOddBits = 48;
    if (found && lane.packing.cost + lane.odds.count * kOddBits <= f.cost) return;
    lane.isDecimal = false;
    lane.packing = f;
    std::copy_n(plain.begin(), size, lane.numbers.begin());
}

/// With `isFloat` the numbers are bits of f32, otherwise whole numbers.
void putLane(ByteBuffer& out, std::span<const std::uint32_t> bits, bool isFloat, unsigned& guess) {
    Lane lane;
    if (isFloat) {
        chooseDecimals(bits, guess, lane);
    } else {
        std::ranges::copy(bits, lane.numbers.begin());
        lane.packing = bestPacking(bits, true);
    }
    const std::span<const std::uint32_t> numbers(lane.numbers.data(), bits.size());
    const Packing& f = lane.packing;
    out.put(static_cast<std::uint8_t>(f.bits | (lane.isDecimal ? kDecimal : 0)));
    out.put(static_cast<std::uint8_t>(f.lag));
    out.put(f.base);
    if (lane.isDecimal) {
        out.put(static_cast<std::uint8_t>(lane.exponent));
        out.put(static_cast<std::uint8_t>(lane.odds.count));
        for (std::size_t i = 0; i < lane.odds.count; ++i) {
            out.put(lane.odds.all[i].at);
            out.put(lane.odds.all[i].bits);
        }
    }
    for (std::size_t i = 0; i < std::min<std::size_t>(f.lag, numbers.size()); ++i) out.put(numbers[i]);
    putBits(out, numbers, f);
}

/// Reads `count` numbers of `bits` bits each into `to`.
void unpack(const std::byte* from, std::size_t count, unsigned bits, std::uint32_t* to) {
    const std::uint32_t mask = bits == 32 ? ~std::uint32_t{0} : (std::uint32_t{1} << bits) - 1;
    for (std::size_t i = 0, at = 0; i < count; ++i, at += bits) {
        std::uint64_t word = 0;
        std::memcpy(&word, from + (at >> 3), sizeof(word));
        to[i] = static_cast<std::uint32_t>(word >> (at & 7)) & mask;
    }
}

/// Computes `numbers` from the differences of a block. Returns false after a problem.
bool readNumbers(Reader& in, unsigned bits, unsigned lag, std::uint32_t base, std::span<std::uint32_t> numbers) {
    const std::size_t first = std::min<std::size_t>(lag, numbers.size());
    for (std::size_t i = 0; i < first; ++i) numbers[i] = in.number<std::uint32_t>();
    const std::size_t count = numbers.size() - first, size = (count * bits + 7) / 8;
    if (in.problem || in.left() < size) return in.refuse("packed numbers cut short"), false;
    std::uint32_t* at = numbers.data() + first;
    if (bits == 0) {
        std::fill_n(at, count, 0u);
    } else if (in.left() >= size + sizeof(std::uint64_t)) {
        unpack(in.at, count, bits, at);
    } else {  // near the record's end, so it must not read beyond
        std::array<std::byte, 4 * kBlock + sizeof(std::uint64_t)> padded{};
        std::memcpy(padded.data(), in.at, size);
        unpack(padded.data(), count, bits, at);
    }
    in.at += size;
    if (lag == 1) {
        std::uint32_t before = numbers[0];
        for (std::size_t i = 0; i < count; ++i) at[i] = before += at[i] + base;
    } else {
        for (std::size_t i = first; i < numbers.size(); ++i) numbers[i] += numbers[i - lag] + base;
    }
    return true;
}

/// Reads one lane of a block into every `stride`-th number.
void readLane(Reader& in, std::size_t size, bool isFloat, std::uint32_t* to, std::size_t stride) {
    const unsigned form = in.number<std::uint8_t>(), lag = in.number<std::uint8_t>();
    const auto base = in.number<std::uint32_t>();
    const unsigned bits = form & ~kDecimal;
    const bool isDecimal = form & kDecimal;
    if (bits > 32 || lag == 0 || lag > kMaxLag || (isDecimal && !isFloat)) return in.refuse("unknown packing");
    unsigned exponent = 0;
    Odds odds;
    if (isDecimal) {
        exponent = in.number<std::uint8_t>();
        odds.count = in.number<std::uint8_t>();
        if (exponent > kMaxExponent || odds.count > kMaxOdd) return in.refuse("unknown packing");
        for (std::size_t i = 0; i < odds.count; ++i) {
            odds.all[i].at = in.number<std::uint16_t>();
            odds.all[i].bits = in.number<std::uint32_t>();
            if (odds.all[i].at >= size) return in.refuse("a number beyond its block");
        }
    }
    Numbers numbers;
    if (!readNumbers(in, bits, lag, base, {numbers.data(), size})) return;
    if (isDecimal)
        for (std::size_t i = 0; i < size; ++i) numbers[i] = std::bit_cast<std::uint32_t>(decimal(numbers[i], exponent));
    else if (isFloat)
        for (std::size_t i = 0; i < size; ++i) numbers[i] = toFloatBits(static_cast<std::int32_t>(numbers[i]));
    for (std::size_t i = 0; i < odds.count; ++i) numbers[odds.all[i].at] = odds.all[i].bits;
    for (std::size_t i = 0; i < size; ++i) to[i * stride] = numbers[i];
}

template <class T>
Value readArray(Reader& in) {
    constexpr std::size_t lanes = sizeof(T) / sizeof(std::uint32_t);
    constexpr bool isFloat = !std::is_same_v<T, std::int32_t>;
    const std::uint64_t size = in.varint();
    if (size == 0 || in.problem) return Array<T>();
    if ((size + kBlock - 1) / kBlock > in.left() / (lanes * kSmallestLane)) {
        in.refuse("count exceeds the bytes that follow");
        return Array<T>();
    }
    if (!in.charge(kArrayCost + size * sizeof(T))) return Array<T>();
    Array<T> result = Array<T>::ofSize(size);
    auto* to = reinterpret_cast<std::uint32_t*>(result.mutableData());
    for (std::size_t i = 0; i < size && !in.problem; i += kBlock)
        for (std::size_t lane = 0; lane < lanes && !in.problem; ++lane)
            readLane(in, std::min(kBlock, size - i), isFloat, to + i * lanes + lane, lanes);
    return in.problem ? Array<T>() : result;
}

template <class T>
void putArray(ByteBuffer& out, const Array<T>& array) {
    constexpr std::size_t lanes = sizeof(T) / sizeof(std::uint32_t);
    constexpr bool isFloat = !std::is_same_v<T, std::int32_t>;
    out.putVarint(array.size());
    const auto* from = reinterpret_cast<const std::byte*>(array.data());
    std::array<unsigned, lanes> guesses{};
    Numbers bits;
    for (std::size_t i = 0; i < array.size(); i += kBlock) {
        const std::size_t size = std::min(kBlock, array.size() - i);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            for (std::size_t k = 0; k < size; ++k)
                std::memcpy(&bits[k], from + ((i + k) * lanes + lane) * sizeof(std::uint32_t), sizeof(std::uint32_t));
            putLane(out, {bits.data(), size}, isFloat, guesses[lane]);
        }
    }
}

}  // namespace

void putPacked(ByteBuffer& out, const Value& value) {
    switch (value.type()) {
#define RTSG_X(type, T)       \
    case FieldType::MF##type: \
        return putArray(out, value.as<Array<T>>());
        RTSG_PACKED_TYPES(RTSG_X)
#undef RTSG_X
        default:
            return;
    }
}

Value readPacked(Reader& in, FieldType type) {
    switch (type) {
#define RTSG_X(name, T)       \
    case FieldType::MF##name: \
        return readArray<T>(in);
        RTSG_PACKED_TYPES(RTSG_X)
#undef RTSG_X
        default:
            in.refuse("a type that is not packed");
            return {};
    }
}

}  // namespace rtsg::wire
