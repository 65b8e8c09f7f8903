// Numbers and texts of a file's head, wherever the file is; what lies behind its end is zero.
//
// Threading: one thread.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "image_files.h"

namespace rtsg {

class HeadBytes {
  public:
    explicit HeadBytes(const ByteSource& source) : source_(&source) {}

    std::uint64_t size() const { return source_->size; }
    /// Fewer bytes than asked for at the end.
    std::string text(std::uint64_t at, std::size_t length) const;
    unsigned byte(std::uint64_t at) const { return static_cast<unsigned>(big(at, 1)); }
    std::uint64_t little(std::uint64_t at, std::size_t bytes) const;
    std::uint64_t big(std::uint64_t at, std::size_t bytes) const;
    void setBigEndian(bool big) { isBig_ = big; }
    /// By setBigEndian().
    std::uint64_t number(std::uint64_t at, std::size_t bytes) const {
        return isBig_ ? big(at, bytes) : little(at, bytes);
    }

  private:
    std::array<unsigned char, 8> read(std::uint64_t at, std::size_t bytes) const;

    const ByteSource* source_;
    bool isBig_ = false;
};

constexpr std::uint64_t kLargestSide = std::uint64_t{1} << 20;

/// The size of the pixels for which a reader takes memory.
struct HeadSize {
    std::uint64_t width = 0, height = 0, layers = 1;
    std::uint64_t bits = 8;         // a pixel
    std::uint64_t bytesOfByte = 1;  // of pixels, that a byte of the file may hold
};
/// A sentence if the file is too short for it.
std::string whyTooLarge(const HeadSize& size, std::uint64_t fileSize);

/// The first `count` whole numbers of a text, comments from # to the line's end left out.
std::vector<std::uint64_t> numbersIn(std::string_view text, std::size_t count);

}  // namespace rtsg
