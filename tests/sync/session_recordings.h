// Recorded sessions of the conformance set (tests/sync/conformance/README.md): what a client and a server said, line by
// line.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "sockets/message.h"
#include "support/zmq_parts.h"

namespace rtsg::test {

struct Said {
    enum class By : std::uint8_t { client, server, cut } by = By::cut;
    std::string first{}, second{};  // of a cut both are empty

    mirror::Message type() const { return static_cast<mirror::Message>(first.size() > 5 ? first[5] : 0); }
    bool isBy(By who, mirror::Message what) const { return by == who && type() == what; }
};

inline std::string asHex(std::string_view bytes) {
    std::string text;
    for (const char c : bytes)
        for (const int shift : {4, 0}) text += "0123456789abcdef"[(static_cast<unsigned char>(c) >> shift) & 15];
    return text;
}

inline std::string fromHex(std::string_view text) {
    std::string bytes;
    for (std::size_t i = 0; i + 1 < text.size(); i += 2)
        bytes += static_cast<char>(std::stoi(std::string(text.substr(i, 2)), nullptr, 16));
    return bytes;
}

inline void writeSession(const std::filesystem::path& file, const std::vector<Said>& session) {
    std::ofstream out(file);
    for (const Said& said : session) {
        if (said.by == Said::By::cut) {
            out << "cut\n";
            continue;
        }
        out << (said.by == Said::By::client ? "client " : "server ") << asHex(said.first);
        if (!said.second.empty()) out << ' ' << asHex(said.second);
        out << '\n';
    }
}

inline std::vector<Said> readSession(const std::filesystem::path& file) {
    std::vector<Said> session;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        std::istringstream words(line);
        std::string who, first, second;
        words >> who >> first >> second;
        EXPECT_TRUE(who == "client" || who == "server" || who == "cut") << line.substr(0, 40);
        const Said::By by = who == "client" ? Said::By::client : who == "server" ? Said::By::server : Said::By::cut;
        session.push_back({by, fromHex(first), fromHex(second)});
    }
    return session;
}

inline std::string textOf(const ByteBuffer& bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

inline wire::Reader readerOf(const std::string& bytes) {
    return wire::Reader(std::as_bytes(std::span(bytes)));
}

}  // namespace rtsg::test
