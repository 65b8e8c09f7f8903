// Range coder: an adaptive binary range coder, and the model of numbers for it (PROTOCOL.md, "Range coding").
//
// Invariant: a decoder with the encoder's bytes makes the same decisions in the same order. Past the end it reads
// zeros, so it never fails and never reads outside.
// Threading: one thread an object. Source: the range coder of LZMA (Pavlov), with probabilities that learn fast at
// first.
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include <rtsg/sync/byte_buffer.h>

#include "lanes.h"

namespace rtsg::wire {

/// The probability of a 0 in units of 2^-15, and the number of updates.
struct BitModel {
    std::uint16_t zero = 1 << 14;
    std::uint16_t seen = 0;

    void update(bool bit) {
        static constexpr std::uint8_t kRate[16] = {1, 2, 3, 3, 4, 4, 4, 4, 4, 4, 5, 5, 5, 5, 5, 5};
        const unsigned rate = kRate[seen];
        if (seen < 15) ++seen;
        if (bit)
            zero = static_cast<std::uint16_t>(zero - (zero >> rate));
        else
            zero = static_cast<std::uint16_t>(zero + ((32768u - zero) >> rate));
    }
};

class RangeEncoder {
  public:
    explicit RangeEncoder(ByteBuffer& out) : out_(out) {}
    void put(BitModel& model, bool bit) {
        const std::uint32_t bound = (range_ >> 15) * model.zero;
        if (bit) {
            low_ += bound;
            range_ -= bound;
        } else {
            range_ = bound;
        }
        model.update(bit);
        while (range_ < 1u << 24) {
            range_ <<= 8;
            shift();
        }
    }
    /// Writes the rest, without zeros at the end.
    void finish() {
        for (int i = 0; i < 5; ++i) shift();
        std::size_t size = out_.size();
        while (size > start_ && out_.data()[size - 1] == std::byte{0}) --size;
        out_.setEnd(out_.data() + size);
    }

  private:
    void shift() {
        if (static_cast<std::uint32_t>(low_) < 0xFF000000u || low_ >> 32) {
            const auto carry = static_cast<std::uint8_t>(low_ >> 32);
            if (!first_) out_.put(static_cast<std::uint8_t>(cache_ + carry));
            first_ = false;
            for (; pending_ > 0; --pending_) out_.put(static_cast<std::uint8_t>(0xFF + carry));
            cache_ = static_cast<std::uint8_t>(low_ >> 24);
        } else {
            ++pending_;
        }
        low_ = (low_ & 0x00FFFFFF) << 8;
    }

    ByteBuffer& out_;
    std::size_t start_ = out_.size();
    std::uint64_t low_ = 0, pending_ = 0;
    std::uint32_t range_ = 0xFFFFFFFF;
    std::uint8_t cache_ = 0;
    bool first_ = true;  // the byte before the first is always 0
};

class RangeDecoder {
  public:
    explicit RangeDecoder(std::span<const std::byte> bytes) : at_(bytes.data()), end_(at_ + bytes.size()) {
        for (int i = 0; i < 4; ++i) code_ = code_ << 8 | next();
    }
    bool get(BitModel& model) {
        const std::uint32_t bound = (range_ >> 15) * model.zero;
        const bool bit = code_ >= bound;
        if (bit) {
            code_ -= bound;
            range_ -= bound;
        } else {
            range_ = bound;
        }
        model.update(bit);
        while (range_ < 1u << 24) {
            range_ <<= 8;
            code_ = code_ << 8 | next();
        }
        return bit;
    }

  private:
    std::uint32_t next() { return at_ < end_ ? std::to_integer<std::uint32_t>(*at_++) : 0; }

    const std::byte *at_, *end_;
    std::uint32_t code_ = 0, range_ = 0xFFFFFFFF;
};

/// Writes plain bits, least significant first.
class BitWriter {
  public:
    explicit BitWriter(ByteBuffer& out) : out_(out) {}
    /// `count` <= 32 and `bits` < 2^count.
    void put(std::uint32_t bits, unsigned count) {
        held_ |= std::uint64_t{bits} << filled_;
        filled_ += count;
        if (filled_ >= 32) {
            out_.put(static_cast<std::uint32_t>(held_));
            held_ >>= 32;
            filled_ -= 32;
        }
    }
    void finish() {
        for (; filled_ > 0; filled_ -= filled_ < 8 ? filled_ : 8) {
            out_.put(static_cast<std::uint8_t>(held_));
            held_ >>= 8;
        }
        held_ = 0;
    }

  private:
    ByteBuffer& out_;
    std::uint64_t held_ = 0;
    unsigned filled_ = 0;
};

class BitReader {
  public:
    explicit BitReader(std::span<const std::byte> bytes) : at_(bytes.data()), end_(at_ + bytes.size()) {}
    /// Returns zeros past the end; overrun() tells.
    std::uint32_t get(unsigned count) {
        while (filled_ < count) {
            if (end_ - at_ >= 4) {
                std::uint32_t word;
                std::memcpy(&word, at_, 4);
                at_ += 4;
                held_ |= std::uint64_t{word} << filled_;
                filled_ += 32;
            } else {
                if (at_ == end_) {
                    overrun_ = true;
                } else {
                    held_ |= std::to_integer<std::uint64_t>(*at_++) << filled_;
                }
                filled_ += 8;
            }
        }
        const auto result = static_cast<std::uint32_t>(held_ & ((std::uint64_t{1} << count) - 1));
        held_ >>= count;
        filled_ -= count;
        return result;
    }
    bool overrun() const { return overrun_; }
    /// Number of whole bytes that were not read.
    std::size_t left() const { return static_cast<std::size_t>(end_ - at_) + filled_ / 8; }

  private:
    const std::byte *at_, *end_;
    std::uint64_t held_ = 0;
    unsigned filled_ = 0;
    bool overrun_ = false;
};

/// Models for a stream of signed numbers, chosen by expected size.
struct NumberModel {
    static constexpr int kClasses = 10;
    BitModel zero[kClasses], sign[kClasses], size[kClasses][32], top[33];
};
constexpr std::uint8_t kUnknownSize = 33;

/// `size` is the number of bits of the last number's magnitude, or kUnknownSize.
inline int classOf(unsigned size) {
    static constexpr std::uint8_t kClass[34] = {1, 2, 3, 4, 4, 5, 5, 6, 6, 6, 7, 7, 7, 7, 8, 8, 8,
                                                8, 8, 8, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 0};
    return kClass[size];
}

/// Returns the number of bits of its magnitude.
inline unsigned putNumber(RangeEncoder& range, BitWriter& bits, NumberModel& model, unsigned expected,
                          std::int32_t number) {
    const int c = classOf(expected);
    const std::uint32_t size = magnitude(number);
    const auto length = static_cast<unsigned>(std::bit_width(size));
    range.put(model.zero[c], length != 0);
    if (length == 0) return 0;
    unsigned node = 1;
    for (int i = 4; i >= 0; --i) {
        const bool bit = (length - 1) >> i & 1u;
        range.put(model.size[c][node & 31], bit);
        node = node << 1 | bit;
    }
    range.put(model.sign[c], number < 0);
    if (length >= 2) range.put(model.top[length], size >> (length - 2) & 1u);
    if (length >= 3) bits.put(size & ((1u << (length - 2)) - 1), length - 2);
    return length;
}

inline std::int32_t getNumber(RangeDecoder& range, BitReader& bits, NumberModel& model, unsigned expected,
                              unsigned& length) {
    const int c = classOf(expected);
    length = 0;
    if (!range.get(model.zero[c])) return 0;
    unsigned node = 1;
    for (int i = 0; i < 5; ++i) node = node << 1 | range.get(model.size[c][node & 31]);
    length = (node & 31) + 1;
    const bool negative = range.get(model.sign[c]);
    std::uint32_t size = 1;
    if (length >= 2) size = 2 | range.get(model.top[length]);
    if (length >= 3) size = size << (length - 2) | bits.get(length - 2);
    return static_cast<std::int32_t>(negative ? 0u - size : size);
}

}  // namespace rtsg::wire
