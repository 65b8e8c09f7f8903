// The MCAP container: compressed chunks hold what uncompressed ones do (the structure is checked by the independent
// reader in tests/app), and what cannot be written is refused.
#include <rtsg/sync/mcap.h>

#include <cstring>

#include <zstd.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Mcap = LogFolder;

template <class T>
T numberAt(std::string_view bytes, std::size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof(value));
    return value;
}

/// The records of all chunks, unpacked, one after the other.
std::string chunkContents(const std::string& file) {
    std::string result;
    for (std::size_t at = 8; at + 9 < file.size() && file[at] != 15;) {
        const auto length = numberAt<std::uint64_t>(file, at + 1);
        if (file[at] == 6) {
            const std::size_t body = at + 9;
            const auto plain = numberAt<std::uint64_t>(file, body + 16);
            const auto name = numberAt<std::uint32_t>(file, body + 28);
            const std::string_view packed(file.data() + body + 32 + name + 8,
                                          numberAt<std::uint64_t>(file, body + 32 + name));
            if (name == 0) {
                result += packed;
            } else {
                EXPECT_EQ(file.substr(body + 32, name), "zstd");
                std::string content(plain, '\0');
                EXPECT_EQ(ZSTD_decompress(content.data(), plain, packed.data(), packed.size()), plain);
                result += content;
            }
        }
        at += 9 + length;
    }
    return result;
}

TEST_F(Mcap, CompressedChunksHoldTheSameMessages) {
    std::string contents[2], files[2];
    for (const bool compress : {false, true}) {
        McapOptions options;
        options.chunkBytes = 2000;
        options.compress = compress;
        auto writer = McapWriter::create(file("a.mcap"), options);
        ASSERT_TRUE(writer);
        const auto topic = (*writer)->addTopic("/a", "a", R"({"title":"a","type":"object","properties":{}})");
        ASSERT_TRUE(topic);
        for (int i = 0; i < 300; ++i)
            ASSERT_TRUE((*writer)->write(*topic, i * .1, "{\"i\":" + std::to_string(i) + "}"));
        ASSERT_TRUE((*writer)->close());
        EXPECT_EQ((*writer)->messages(), 300u);
        files[compress] = readAll(file("a.mcap"));
        EXPECT_EQ((*writer)->bytes(), files[compress].size());
        contents[compress] = chunkContents(files[compress]);
    }
    EXPECT_EQ(contents[0], contents[1]);
    EXPECT_GT(contents[0].size(), 300u * 31);
    EXPECT_LT(files[1].size(), files[0].size());
}

TEST_F(Mcap, WhatCannotBeWrittenIsRefused) {
    EXPECT_FALSE(McapWriter::create(folder / "gone" / "a.mcap"));
    auto writer = McapWriter::create(file("a.mcap"));
    ASSERT_TRUE(writer);
    EXPECT_FALSE((*writer)->write(1, 0, "{}"));
    ASSERT_TRUE((*writer)->addTopic("/a", "a", "{}"));
    for (const double time : {-1., double(NAN), 1e30}) EXPECT_FALSE((*writer)->write(1, time, "{}"));
    EXPECT_TRUE((*writer)->close());
    EXPECT_TRUE((*writer)->close());
}

}  // namespace
}  // namespace rtsg
