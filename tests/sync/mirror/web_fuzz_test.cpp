// Damaged conversations with the gateway for browsers, from seeds: whatever comes, in whatever pieces, ends at most its
// own connection.
#include <random>

#include <gtest/gtest.h>

#include "support/long_form.h"
#include "web_line.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::eventually;
using test::helloOf;
using test::ServedPage;
using test::WebSocketLine;

using Random = std::mt19937_64;

std::size_t below(Random& random, std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random);
}

/// One frame of RFC 6455, with a kind, flags and a length of any kind: as often as not those that it should have.
std::string webFrame(Random& random, std::string_view payload) {
    const bool right = below(random, 2) == 0;
    const char kinds[] = {'\x00', '\x01', '\x02', '\x03', '\x08', '\x09', '\x0A', '\x0F'};
    std::string frame(1, static_cast<char>(right ? 0x82 : kinds[below(random, 8)] | int(below(random, 16)) << 4));
    std::uint64_t length = payload.size();
    if (!right && below(random, 3) == 0) length = random() >> below(random, 64);
    const std::size_t bytes = length < 126 ? 0 : length < 65536 ? 2 : 8;
    const bool masked = right || below(random, 4) != 0;
    frame += static_cast<char>((masked ? 0x80 : 0) | (bytes == 0 ? int(length) : bytes == 2 ? 126 : 127));
    for (std::size_t i = bytes; i-- > 0;) frame += static_cast<char>(length >> 8 * i & 0xFF);
    if (masked) frame += std::string(4, '\0');
    return frame += payload;
}

/// A message of the gateway's: a length, a part of that many bytes, another.
std::string webMessage(Random& random, std::string_view first) {
    auto size = static_cast<std::uint32_t>(first.size());
    if (below(random, 4) == 0) size = static_cast<std::uint32_t>(random());
    std::string message(reinterpret_cast<const char*>(&size), 4);
    message += first;
    return message += std::string(below(random, 40), 'x');
}

/// Possible messages of a browser: requests of files, and a session with all kinds of messages.
std::string conversation(Random& random, const ServedPage& served) {
    const char* const targets[] = {"/", "/src/index.js", "/picture/1/0", "/sound/1/0", "/mirror", "/picture/9/", "*"};
    const char* const methods[] = {"GET", "HEAD", "POST", "OPTIONS"};
    std::string text;
    for (std::size_t requests = below(random, 3); requests > 0; --requests) {
        text += std::string(methods[below(random, 4)]) + " " + targets[below(random, 7)] +
                " HTTP/1.1\r\nHost: " + served.host + "\r\n";
        if (below(random, 3) == 0) text += "Transfer-Encoding: chunked\r\n";
        if (below(random, 3) == 0) text += "Content-Length: " + std::to_string(below(random, 100)) + "\r\n";
        text += "\r\n";
    }
    text += "GET /mirror HTTP/1.1\r\nHost: " + served.host + "\r\n" + ServedPage::upgrade() + "\r\n";
    for (std::size_t frames = below(random, 6); frames > 0; --frames)
        text += webFrame(random, below(random, 2) == 0
                                     ? webMessage(random, helloOf(random()))
                                     : std::string(below(random, 2) == 0 ? below(random, 200) : 60000, '\x07'));
    return text;
}

void damage(Random& random, std::string& text) {
    for (std::size_t times = below(random, 4); times > 0 && !text.empty(); --times) {
        const std::size_t at = below(random, text.size());
        switch (below(random, 4)) {
            case 0:
                text[at] = static_cast<char>(text[at] ^ 1 << below(random, 8));
                break;
            case 1:
                text.erase(at, 1 + below(random, 20));
                break;
            case 2:
                text.insert(at, text.substr(below(random, text.size()), below(random, 300)));
                break;
            default:
                text.resize(at);
        }
    }
}

TEST(WebGatewayFuzz, DamagedConversationsEndAtMostTheirOwnConnection) {
    ServedPage served;
    served.load(
        "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { texture ImageTexture { url "
        "\"sign.png\" } } geometry Box { } }\n");
    WebSocketLine good(served.port);
    ASSERT_EQ(served.open(good), 101);
    good.sayMessage(helloOf(5));
    ASSERT_TRUE(good.next());
    std::uint64_t followed = 0;
    const std::uint64_t seeds = test::fewOrMany(400, 40000);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Random random(seed);
        std::string text = conversation(random, served);
        if (seed % 8 != 0) damage(random, text);
        WebSocketLine line(served.port);
        while (!text.empty()) {
            const std::size_t piece = below(random, 3) == 0 ? 1 + below(random, text.size()) : text.size();
            line.say(text.substr(0, piece));
            text.erase(0, piece);
            (void)line.more(below(random, 2) == 0 ? 1ms : 0ms);
        }
        for (std::size_t reads = below(random, 4); reads > 0 && line.more(2ms); --reads) continue;
        served.gateway->service(served.scene, served.resources);
        followed += line.heard.find("101 Switching") != std::string::npos;
    }
    EXPECT_GT(followed, 40u) << "so many got as far as their WebSocket";
    EXPECT_TRUE(eventually([&] { return served.gateway->statistics().connections == 1; })) << "all have gone again";
    good.heard.clear();
    good.sayMessage(helloOf(6));  // the server forgets who is silent for long
    served.scene.newFrame(1);
    EXPECT_TRUE(good.hear([&] { return !good.heard.empty(); })) << "and who behaves is still there";
    EXPECT_EQ(served.ask("/src/index.js").status, 200);
    EXPECT_TRUE(eventually([&] { return served.server->statistics().peers == 1; }));
}

}  // namespace
}  // namespace rtsg
