// KTX 2.0 files for tests, put together from the specification: header, level index, descriptor, keys and values,
// levels.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace rtsg::test {

struct Ktx2File {
    std::uint32_t format = 37, width = 1, height = 1, depth = 0, layers = 0, faces = 1, scheme = 0;
    int model = 1, transfer = 2, flags = 0;  // RGBSDA, sRGB
    std::vector<std::pair<std::string, std::string>> notes{};
    /// The largest first: what lies in the file, and its size unpacked (0: the same).
    std::vector<std::pair<std::string, std::uint64_t>> levels{};

    static void put32(std::string& out, std::uint32_t word) {
        for (int i = 0; i < 4; ++i) out += static_cast<char>(word >> (8 * i));
    }
    static void put64(std::string& out, std::uint64_t word) {
        put32(out, static_cast<std::uint32_t>(word)), put32(out, static_cast<std::uint32_t>(word >> 32));
    }

    std::string bytes() const {
        std::string descriptor;
        put32(descriptor, 28), put32(descriptor, 0), put32(descriptor, 24u << 16 | 2);
        for (const int byte : {model, 1, transfer, flags}) descriptor += static_cast<char>(byte);
        descriptor.append(12, '\0');
        std::string keys;
        for (const auto& [key, value] : notes) {
            put32(keys, static_cast<std::uint32_t>(key.size() + value.size() + 2));
            keys += key + '\0' + value + '\0';
            while (keys.size() % 4 != 0) keys += '\0';
        }
        const std::size_t index = 80, after = index + 24 * levels.size();
        const std::size_t head = after + descriptor.size() + keys.size();
        std::string content;
        std::vector<std::uint64_t> offsets(levels.size());
        for (std::size_t i = levels.size(); i-- > 0;) {  // the smallest lies first
            while ((head + content.size()) % 16 != 0) content += '\0';
            offsets[i] = head + content.size();
            content += levels[i].first;
        }
        std::string out("\xABKTX 20\xBB\r\n\x1A\n");
        for (const std::uint32_t word :
             {format, 1u, width, height, depth, layers, faces, static_cast<std::uint32_t>(levels.size()), scheme})
            put32(out, word);
        put32(out, static_cast<std::uint32_t>(after)), put32(out, static_cast<std::uint32_t>(descriptor.size()));
        put32(out, static_cast<std::uint32_t>(keys.empty() ? 0 : after + descriptor.size()));
        put32(out, static_cast<std::uint32_t>(keys.size()));
        put64(out, 0), put64(out, 0);
        for (std::size_t i = 0; i < levels.size(); ++i)
            put64(out, offsets[i]), put64(out, levels[i].first.size()),
                put64(out, levels[i].second != 0 ? levels[i].second : levels[i].first.size());
        return out + descriptor + keys + content;
    }
};

}  // namespace rtsg::test
