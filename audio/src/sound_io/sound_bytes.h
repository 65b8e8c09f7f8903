// SoundBytes: gives decoding libraries access to the content of a sound file, in memory or on disk.
//
// Invariant: `at` is 0 to `size`. Threading: one thread.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include <rtsg/core/resource.h>

namespace rtsg {

struct SoundBytes {
    /// Reads from an offset below `size` on; gives how much came.
    std::function<std::size_t(std::uint64_t offset, std::span<char> to)> readAt;
    std::int64_t size = 0, at = 0;

    static SoundBytes of(std::string_view bytes) {
        return {[bytes](std::uint64_t offset, std::span<char> to) { return bytes.copy(to.data(), to.size(), offset); },
                static_cast<std::int64_t>(bytes.size())};
    }
    static SoundBytes of(const Resource& file) {
        return {[&file](std::uint64_t offset, std::span<char> to) {
                    return file.readAt(offset, to.size()).copy(to.data(), to.size());
                },
                static_cast<std::int64_t>(file.size())};
    }

    std::int64_t read(void* to, std::int64_t count) {
        count = std::clamp<std::int64_t>(count, 0, size - at);
        const auto got = static_cast<std::int64_t>(
            readAt(static_cast<std::uint64_t>(at), std::span(static_cast<char*>(to), static_cast<std::size_t>(count))));
        at += got;
        return got;
    }
    /// The new position; -1, and no change, if it is outside: a file may state any numbers.
    std::int64_t seek(std::int64_t offset, int whence) {
        const std::int64_t from = whence == SEEK_CUR ? at : whence == SEEK_END ? size : 0;
        if (offset < -from || offset > size - from) return -1;
        return at = from + offset;
    }
    /// At most `count` bytes from `offset` on; leaves `at` where it is.
    std::string part(std::int64_t offset, std::int64_t count) const {
        if (offset < 0 || offset >= size) return {};
        std::string result(static_cast<std::size_t>(std::clamp<std::int64_t>(count, 0, size - offset)), '\0');
        result.resize(readAt(static_cast<std::uint64_t>(offset), result));
        return result;
    }
};

}  // namespace rtsg
