// LaneQueue: rows of numbers that wait to be processed, stored by column, so that eight rows at a time are read and
// written with vector instructions.
//
// Numbers are 32 bits wide: floats, or integers by their bits. Invariant: reading and writing eight rows from any one
// that is there, or from the end, stays within the memory. Threading: one of a tile.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <rtsg/core/value.h>

#include "mesh/simd8.h"

namespace rtsg::trace {

/// For each set of eight lanes their numbers, a byte each.
struct LaneOrders {
    std::array<std::uint64_t, 256> of{};
    constexpr LaneOrders() {
        for (std::uint32_t lanes = 0; lanes < 256; ++lanes) {
            unsigned to = 0;
            for (std::uint64_t lane = 0; lane < 8; ++lane)
                if (lanes >> lane & 1u) of[lanes] |= lane << (8 * to++);
        }
    }
};

/// Moves some of eight lanes to the front.
class Packing {
  public:
    /// `lanes`: a bit each.
    explicit Packing(std::uint32_t lanes) {
        static constexpr LaneOrders orders;
#ifdef __AVX2__
        const __m256i wide = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(orders.of[lanes])));
        std::memcpy(&order_, &wide, sizeof order_);
#else
        for (int i = 0; i < 8; ++i) order_[i] = static_cast<std::int32_t>(orders.of[lanes] >> (8 * i) & 7u);
#endif
    }
    simd::F8 operator()(simd::F8 v) const {
#ifdef __AVX2__
        __m256 values;
        __m256i order;
        std::memcpy(&values, &v, sizeof values), std::memcpy(&order, &order_, sizeof order);
        values = _mm256_permutevar8x32_ps(values, order);
        std::memcpy(&v, &values, sizeof v);
        return v;
#else
        simd::F8 r{};
        for (int i = 0; i < 8; ++i) r[i] = v[order_[i]];
        return r;
#endif
    }

  private:
    simd::I8 order_{};
};

class LaneQueue {
  public:
    LaneQueue() = default;
    explicit LaneQueue(std::size_t columns) : columns_(columns) { reserve(0); }

    std::size_t columns() const { return columns_; }
    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    void clear() { size_ = 0; }
    /// Takes away the last rows, which stay readable until others are added.
    void drop(std::size_t rows) { size_ -= rows; }

    /// Room for so many rows more.
    void reserve(std::size_t more) {
        const std::size_t needed = size_ + more + kSlack;
        if (needed <= stride_) return;
        // A line of the cache more than a round number, or all columns would have the same few of its places.
        const std::size_t stride = (std::max(needed, 2 * stride_) | 63u) + 1 + 16;
        std::vector<float> data(columns_ * stride);
        for (std::size_t c = 0; c < columns_; ++c)
            for (std::size_t row = 0; row < size_; ++row) data[c * stride + row] = data_[c * stride_ + row];
        data_ = std::move(data), stride_ = stride;
    }

    const float* at(std::size_t column, std::size_t row) const { return &data_[column * stride_ + row]; }
    simd::F8 load(std::size_t column, std::size_t row) const { return simd::load(at(column, row)); }
    simd::V8 loadV(std::size_t column, std::size_t row) const {
        return {load(column, row), load(column + 1, row), load(column + 2, row)};
    }
    float number(std::size_t column, std::size_t row) const { return *at(column, row); }
    std::uint32_t bits(std::size_t column, std::size_t row) const {
        return std::bit_cast<std::uint32_t>(number(column, row));
    }
    Vec3f vector(std::size_t column, std::size_t row) const {
        return {number(column, row), number(column + 1, row), number(column + 2, row)};
    }

    /// New rows, whose numbers put() is told column by column.
    class Rows {
      public:
        Rows(float* to, std::size_t stride, std::uint32_t lanes) : to_(to), stride_(stride), packing_(lanes) {}
        void put(std::size_t column, simd::F8 v) const { simd::store(to_ + column * stride_, packing_(v)); }
        void put(std::size_t column, simd::I8 v) const { put(column, simd::fromBits(v)); }
        void put(std::size_t column, const simd::V8& v) const {
            put(column, v.x), put(column + 1, v.y), put(column + 2, v.z);
        }

      private:
        float* to_;
        std::size_t stride_;
        Packing packing_;
    };
    /// For some of eight lanes, a bit each. Precondition: reserve().
    Rows add(std::uint32_t lanes) {
        float* const to = &data_[size_];
        size_ += static_cast<std::size_t>(std::popcount(lanes));
        return {to, stride_, lanes};
    }
    /// A row of one lane, to be filled by set(). Precondition: reserve().
    std::size_t addOne() { return size_++; }
    void set(std::size_t column, std::size_t row, float number) { data_[column * stride_ + row] = number; }
    void set(std::size_t column, std::size_t row, std::uint32_t bits) { set(column, row, std::bit_cast<float>(bits)); }
    void set(std::size_t column, std::size_t row, const Vec3f& v) {
        set(column, row, v.x), set(column + 1, row, v.y), set(column + 2, row, v.z);
    }

  private:
    static constexpr std::size_t kSlack = 16;
    std::size_t columns_ = 0, stride_ = 0, size_ = 0;
    std::vector<float> data_;
};

}  // namespace rtsg::trace
