// The gateway for browsers: which files, pictures and connections it gives to whom, and that a client's messages pass
// both ways unchanged.
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <zlib.h>

#include <rtsg/core/x3d.h>

#include "support/stranger.h"
#include "web_line.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::Answer;
using test::eventually;
using test::helloOf;
using test::kPng;
using test::Line;
using test::ServedPage;
using test::WebSocketLine;

std::string unpacked(std::string_view gzip) {
    z_stream stream{};
    EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
    std::string text(1 << 20, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(gzip.data()));
    stream.avail_in = static_cast<uInt>(gzip.size());
    stream.next_out = reinterpret_cast<Bytef*>(text.data());
    stream.avail_out = static_cast<uInt>(text.size());
    EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
    text.resize(stream.total_out);
    inflateEnd(&stream);
    return text;
}

TEST(WebGateway, GivesThePageAndNothingElseOfTheFolder) {
    ServedPage served;
    const Answer page = served.ask("/");
    EXPECT_EQ(page.status, 200);
    EXPECT_NE(page.head.find("text/html"), std::string::npos);
    EXPECT_EQ(served.ask("/src/index.js").body, "export {};");
    EXPECT_EQ(served.ask("/src/index.js?x=1").status, 200);
    EXPECT_EQ(served.ask("/src/index.js", "HEAD").body, "");
    for (const char* target : {"/package.json", "/src/.secret.js", "/src/notes.txt", "/src/../package.json", "/src/",
                               "/src/./index.js", "/src//index.js", "/%2e%2e/package.json", "/src/index.js%00",
                               "//etc/passwd", "/scene/sign.png", "/src", "http://elsewhere/src/index.js"})
        EXPECT_EQ(served.ask(target).status, 404) << target;
    EXPECT_EQ(served.ask("/src/" + std::string(300, 'a') + ".js").status, 404);
    for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS"})
        EXPECT_EQ(served.ask("/", method).status, 405) << method;
}

TEST(WebGateway, LetsOnlyItsOwnScriptsRun) {
    ServedPage served;
    const Answer first = served.ask("/"), second = served.ask("/");
    EXPECT_EQ(first.body.find("@NONCE@"), std::string::npos);
    EXPECT_NE(first.body, second.body);
    const std::string nonce = first.body.substr(15, first.body.find('"', 15) - 15);
    EXPECT_NE(first.head.find("'nonce-" + nonce + "'"), std::string::npos) << first.head;
    EXPECT_EQ(first.head.find("unsafe-eval' "), first.head.find("wasm-unsafe-eval' ") + 5) << first.head;
    EXPECT_NE(served.ask("/src/index.js").head.find("nosniff"), std::string::npos);
}

TEST(WebGateway, WhatHasNotChangedIsNotSentAgain) {
    ServedPage served;
    const Answer first = served.ask("/src/index.js");
    const std::size_t at = first.head.find("ETag: ") + 6;
    const std::string tag = first.head.substr(at, first.head.find("\r\n", at) - at);
    EXPECT_EQ(served.ask("/src/index.js", "GET", "If-None-Match: " + tag + "\r\n").status, 304);
    served.write("src/index.js", "export const other = 1;");
    EXPECT_EQ(served.ask("/src/index.js", "GET", "If-None-Match: " + tag + "\r\n").status, 200);
}

/// DNS rebinding, and pages of other sites that are open in the same browser.
TEST(WebGateway, OnLoopbackOtherNamesAndOtherSitesAreRefused) {
    ServedPage served;
    const std::string port = ":" + std::to_string(served.port);
    for (const char* name : {"localhost", "127.0.0.1", "[::1]"})
        EXPECT_EQ(served.ask("/", "GET", {}, name + port).status, 200) << name;
    for (const char* name :
         {"evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "[2001:db8::1]", "evil.example."})
        EXPECT_EQ(served.ask("/", "GET", {}, name + port).status, 403) << name;
    for (const std::string& origin : {std::string(), "http://" + served.host}) {
        WebSocketLine line(served.port);
        EXPECT_EQ(served.open(line, "/mirror", origin), 101) << origin;
    }
    for (const std::string& origin : {std::string("http://evil.example"), std::string("null"),
                                      std::string("http://127.0.0.1"), "http://" + served.host + ".evil.example"}) {
        WebSocketLine line(served.port);
        EXPECT_EQ(served.open(line, "/mirror", origin), 403) << origin;
    }
    WebSocketLine elsewhere(served.port), other(served.port);
    EXPECT_EQ(served.open(elsewhere, "/other"), 403);
    EXPECT_EQ(served.open(other, "/mirror", {}, "evil.example"), 403);
    EXPECT_GE(served.gateway->statistics().refused, 10u);
    EXPECT_FALSE(served.gateway->takeDiagnostics().empty());
}

/// RFC 9112: 3.2 (one Host field, of a host and a port), 2.2 and 3 (the form of a request).
TEST(WebGateway, WhatIsNoRequestGetsTheStatusThatSaysSo) {
    ServedPage served;
    for (const char* host : {"127.0.0.1:80@evil.example", "evil.example@127.0.0.1", "127.0.0.1:80:80", "127.0.0.1:8x",
                             "127.0.0.1/", "[::1].evil.example", "[::1", ":80", "127.0.0.1 evil", "127.0.0.1, evil"})
        EXPECT_EQ(served.ask("/", "GET", {}, host).status, 400) << host;
    EXPECT_EQ(served.ask("/", "GET", "Host: evil.example\r\n").status, 400) << "two of them";
    const auto statusOf = [&](const std::string& request) {
        Line line(served.port);
        line.say(request);
        EXPECT_TRUE(line.ended()) << request.substr(0, 40);
        return line.heard.size() > 12 ? std::stoi(line.heard.substr(9, 3)) : 0;
    };
    const std::string host = "Host: " + served.host + "\r\n";
    EXPECT_EQ(statusOf("GET / HTTP/1.1\r\n\r\n"), 400) << "no Host";
    for (const std::string& request :
         {std::string("nonsense\r\n\r\n"), std::string("\x16\x03\x01\x02\0\x01\0\x01\xFC\x03\x03\r\n\r\n", 15),
          "GET /\r\n" + host + "\r\n", "GET / HTTP/3.7\r\n" + host + "\r\n",
          "GET / HTTP/1.1\r\n" + host + "no colon\r\n\r\n", "GET / HTTP/1.1\r\n" + host + "Content-Length: x\r\n\r\n",
          "G\tT / HTTP/1.1\r\n" + host + "\r\n"})
        EXPECT_EQ(statusOf(request), 400) << request;
    EXPECT_EQ(statusOf("GET / HTTP/1.1\r\n" + host + "X: " + std::string(9000, 'x') + "\r\n\r\n"), 431);
    EXPECT_EQ(statusOf("POST / HTTP/1.1\r\n" + host + "Content-Length: 5000\r\n\r\n"), 413);
    EXPECT_EQ(served.ask("/").status, 200);
}

// Nobody keeps others out by saying nothing: the oldest of those that do make way.
TEST(WebGateway, TheSilentMakeWay) {
    ServedPage served;
    std::vector<std::unique_ptr<Line>> silent;
    for (int i = 0; i < 300; ++i) silent.push_back(std::make_unique<Line>(served.port));
    silent.front()->say("GET / HTTP/1.1\r\nHost: ");
    for (int i = 0; i < 5; ++i) EXPECT_EQ(served.ask("/").status, 200) << i;
    EXPECT_GE(served.gateway->statistics().refused, 40u);
    EXPECT_TRUE(silent.front()->ended()) << "the oldest";
    EXPECT_TRUE(silent.back()->more(1ms)) << "the newest";
    // Those whose browser may want more are next.
    silent.clear();
    std::vector<std::unique_ptr<Line>> idle;
    for (int i = 0; i < 260; ++i) {
        idle.push_back(std::make_unique<Line>(served.port));
        idle.back()->say("GET /src/index.js HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n");
        ASSERT_TRUE(idle.back()->hear([&] { return idle.back()->heard.ends_with("export {};"); })) << i;
    }
    EXPECT_EQ(served.ask("/").status, 200);
    EXPECT_TRUE(idle.front()->ended());
    idle.back()->heard.clear();
    idle.back()->say("GET /src/index.js HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n");
    EXPECT_TRUE(idle.back()->hear([&] { return idle.back()->heard.ends_with("export {};"); }));
}

TEST(WebGateway, AWebSocketThatSaysNothingMakesWay) {
    WebGatewayOptions options;
    options.maximumConnections = 2;
    ServedPage served(options);
    WebSocketLine silent(served.port), speaks(served.port), next(served.port), tooMany(served.port);
    ASSERT_EQ(served.open(silent), 101);
    ASSERT_EQ(served.open(speaks), 101);
    speaks.sayMessage(helloOf(5));
    ASSERT_TRUE(speaks.next());
    // A browser may take a moment.
    EXPECT_EQ(served.open(tooMany), 403);
    std::this_thread::sleep_for(2500ms);
    EXPECT_EQ(served.open(next), 101);
    EXPECT_TRUE(silent.ended());
    next.sayMessage(helloOf(6));
    ASSERT_TRUE(next.next());
    std::this_thread::sleep_for(2500ms);
    WebSocketLine last(served.port);
    EXPECT_EQ(served.open(last), 403) << "both speak";
}

TEST(WebGateway, ManyRefusalsAreToldByTheirNumber) {
    ServedPage served;
    for (int i = 0; i < 70; ++i) EXPECT_EQ(served.ask("/", "GET", {}, "evil.example").status, 403);
    EXPECT_EQ(served.gateway->statistics().refused, 70u);
    const std::vector<Diagnostic> reported = served.gateway->takeDiagnostics();
    ASSERT_EQ(reported.size(), 8u + 3u);  // all of the first, then the 16th, 32nd and 64th
    EXPECT_TRUE(reported.back().text.ends_with("; 64 such things by now")) << reported.back().text;
}

// Clients that do not finish a request, and browsers whose page is not visible, give their place to others.
TEST(WebGateway, ARequestThatTakesTooLongEnds) {
    WebGatewayOptions options;
    options.requestTimeout = 100ms;
    ServedPage served(options);
    served.load("DEF T ImageTexture { url \"sign.png\" }");
    Line half(served.port), silent(served.port), picture(served.port);
    half.say("GET / HTTP/1.1\r\nHost: " + served.host + "\r\nX: ");
    picture.say("GET /picture/" + std::to_string(served.scene.findName("T").value) +
                "/0 HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n");
    EXPECT_TRUE(half.ended());
    EXPECT_TRUE(silent.ended());
    EXPECT_TRUE(picture.ended());  // the scene's thread never came
    EXPECT_EQ(half.heard + silent.heard + picture.heard, "");
    EXPECT_EQ(served.ask("/").status, 200);
}

// X_ITE has 1.4 MB, which take three minutes at 64 kbit/s.
TEST(WebGateway, WhoReadsSlowlyGetsAllOfALongFile) {
    WebGatewayOptions options;
    options.requestTimeout = 200ms;
    ServedPage served(options);
    std::string text;
    for (int i = 0; text.size() < (std::size_t{24} << 20); ++i) text += std::to_string(i);
    served.write("src/long.js", text);
    Line slow(served.port);
    slow.say("GET /src/long.js HTTP/1.1\r\nHost: " + served.host + "\r\nConnection: close\r\n\r\n");
    ASSERT_TRUE(slow.hear([&] { return slow.heard.size() > 1000; }));
    std::this_thread::sleep_for(3 * options.requestTimeout);
    EXPECT_TRUE(slow.ended());
    EXPECT_EQ(slow.heard.size() - slow.heard.find("\r\n\r\n") - 4, text.size());
    EXPECT_TRUE(slow.heard.ends_with(text.substr(text.size() - 1000)));
}

/// On loopback packing costs time and saves none.
TEST(WebGateway, TextGoesPackedBeyondThisMachine) {
    const std::string text(5000, 'x'), packs = "Accept-Encoding: br, gzip\r\n";
    WebGatewayOptions options;
    ServedPage here(options);
    options.listen = "0.0.0.0:0";
    ServedPage beyond(options);
    for (ServedPage* served : {&here, &beyond})
        for (const char* name : {"src/long.js", "page/sign.png"}) served->write(name, text);
    EXPECT_EQ(here.ask("/src/long.js", "GET", packs).body, text);
    const Answer packed = beyond.ask("/src/long.js", "GET", packs);
    EXPECT_NE(packed.head.find("Content-Encoding: gzip\r\n"), std::string::npos) << packed.head;
    EXPECT_NE(packed.head.find("Vary: Accept-Encoding\r\n"), std::string::npos) << packed.head;
    EXPECT_LT(packed.body.size(), 500u);
    EXPECT_EQ(unpacked(packed.body), text);
    for (const char* takes : {"", "Accept-Encoding: br\r\n", "Accept-Encoding: gzip;q=0\r\n"})
        EXPECT_EQ(beyond.ask("/src/long.js", "GET", takes).body, text) << takes;
    EXPECT_EQ(beyond.ask("/page/sign.png", "GET", packs).body, text);
    const std::size_t at = packed.head.find("ETag: ") + 6;
    const std::string tag = packed.head.substr(at, packed.head.find("\r\n", at) - at);
    EXPECT_EQ(beyond.ask("/src/long.js", "GET", packs + "If-None-Match: " + tag + "\r\n").status, 304);
    EXPECT_EQ(beyond.ask("/src/long.js").head.find(tag), std::string::npos) << "another representation";
    beyond.write("src/long.js", text + "y");
    const Answer changed = beyond.ask("/src/long.js", "GET", packs + "If-None-Match: " + tag + "\r\n");
    EXPECT_EQ(changed.status, 200);
    EXPECT_NE(changed.body, packed.body);
}

TEST(WebGateway, ATokenIsAskedForWhereThereIsOne) {
    WebGatewayOptions options;
    options.token = "open-Sesame_1-234";
    ServedPage served(options);
    EXPECT_TRUE(served.gateway->url().ends_with("/#token=open-Sesame_1-234")) << served.gateway->url();
    for (const char* target : {"/mirror", "/mirror?token=", "/mirror?token=open", "/mirror?token=open-Sesame_1-2345",
                               "/mirror?x=open-Sesame_1-234", "/mirror?nottoken=open-Sesame_1-234"}) {
        WebSocketLine line(served.port);
        EXPECT_EQ(served.open(line, target), 403) << target;
    }
    for (const char* target : {"/mirror?token=open-Sesame_1-234", "/mirror?x=1&token=open-Sesame_1-234"}) {
        WebSocketLine line(served.port);
        EXPECT_EQ(served.open(line, target), 101) << target;
    }
    EXPECT_EQ(served.ask("/picture/1/0").status, 403);
    EXPECT_EQ(served.ask("/sound/1/0").status, 403);
    EXPECT_EQ(served.ask("/picture/1/0?token=open-Sesame_1-234").status, 404);
    EXPECT_EQ(served.ask("/").status, 200);  // the page itself is no secret
    // Where diagnostics go, others may read.
    const std::vector<Diagnostic> reported = served.gateway->takeDiagnostics();
    ASSERT_FALSE(reported.empty());
    for (const Diagnostic& d : reported) {
        EXPECT_TRUE(d.format().contains("http://127.0.0.1:")) << d.format();
        EXPECT_FALSE(d.format().contains("Sesame")) << d.format();
    }
}

TEST(WebGateway, BeyondThisMachineATokenIsMadeUp) {
    WebGatewayOptions options;
    options.listen = "0.0.0.0:0";
    Scene scene;
    const auto server = *MirrorServer::start(scene, test::kAnyPort);
    test::TempFolder folder;
    std::filesystem::create_directory(folder.path() / "page");
    std::ofstream(folder / "page/index.html") << "page";
    options.folder = folder.path();
    const auto first = WebGateway::start(*server, options), second = WebGateway::start(*server, options);
    ASSERT_TRUE(first) << first.error().text;
    const auto token = [](const WebGateway& gateway) { return gateway.url().substr(gateway.url().find('#')); };
    EXPECT_EQ(token(**first).size(), 7u + 32u);
    // An address that others reach it by, if this machine has one.
    const std::string host = (*first)->url().substr(7, (*first)->url().rfind(':') - 7);
    EXPECT_TRUE(host == "localhost" || (host != "0.0.0.0" && !host.starts_with("127."))) << host;
    EXPECT_NE(token(**first), token(**second));
    for (const char* bad : {"", "x", "80x", "1.2.3:80", "70000", "-1", "host:80", ":80"}) {
        options.listen = bad;
        EXPECT_FALSE(WebGateway::start(*server, options)) << bad;
    }
    options.listen = "0";
    for (const char* bad : {"no spaces in a token", "a", "fifteen-letters"}) {
        options.token = bad;
        EXPECT_FALSE(WebGateway::start(*server, options)) << bad;
    }
    options.token.clear();
    options.folder = folder.path() / "page";
    const auto without = WebGateway::start(*server, options);
    ASSERT_FALSE(without);
    EXPECT_NE(without.error().text.find("no page"), std::string::npos);
}

TEST(WebGateway, PicturesAreThoseThatTexturesOfTheSceneNameWithinTheirFolder) {
    ServedPage served;
    served.load(R"(#X3D V4.0 utf8
Shape { appearance Appearance { texture DEF GOOD ImageTexture { url [ "missing.png" "sign.png" ] } } geometry Box { } }
Shape { appearance Appearance { texture DEF BAD ImageTexture { url [ "../outside.png" "sign.txt" ] } } geometry Box { } }
DEF SOUND AudioClip { url "sign.png" }
)");
    const auto target = [&](const char* name, const std::string& index) {
        return "/picture/" + std::to_string(served.scene.findName(name).value) + "/" + index;
    };
    const Answer good = served.ask(target("GOOD", "1") + "?state=3");
    EXPECT_EQ(good.status, 200);
    EXPECT_EQ(good.body, kPng);
    EXPECT_NE(good.head.find("image/png"), std::string::npos);
    for (const std::string& none :
         {target("GOOD", "0"), target("GOOD", "2"), target("GOOD", "-1"), target("GOOD", ""), target("GOOD", "1x"),
          target("GOOD", "99999999999"), target("BAD", "0"), target("BAD", "1"), target("SOUND", "0"),
          std::string("/picture/1/0"), std::string("/picture/77777/0"), std::string("/picture/"),
          std::string("/picture//")})
        EXPECT_EQ(served.ask(none).status, 404) << none;
}

// The content of a file tells its type, never its name; a browser can only name a node.
TEST(WebGateway, SoundsAreThoseThatSourcesOfTheSceneNameWithinTheirFolder) {
    ServedPage served;
    const std::string wave("RIFF\x24\0\0\0WAVEfmt and so on", 24);
    served.write("scene/a.wav", wave);
    served.write("outside.wav", wave);
    served.load(R"(#X3D V4.0 utf8
Sound { source DEF GOOD AudioClip { url [ "missing.wav" "a.wav" ] } }
Sound { source DEF BAD AudioClip { url [ "../outside.wav" "sign.png" "sign.txt" ] } }
SpatialSound { children DEF BUFFER BufferAudioSource { url "a.wav" } }
DEF PICTURE ImageTexture { url "a.wav" }
DEF FILM MovieTexture { url "a.wav" }
)");
    const auto target = [&](const char* name, const std::string& index) {
        return "/sound/" + std::to_string(served.scene.findName(name).value) + "/" + index;
    };
    for (const std::string& there : {target("GOOD", "1?state=3"), target("BUFFER", "0")}) {
        const Answer good = served.ask(there);
        EXPECT_EQ(good.status, 200) << there;
        EXPECT_EQ(good.body, wave);
        EXPECT_NE(good.head.find("audio/wav"), std::string::npos);
    }
    for (const std::string& none :
         {target("GOOD", "0"), target("GOOD", "2"), target("GOOD", "x"), target("BAD", "0"), target("BAD", "1"),
          target("BAD", "2"), target("PICTURE", "0"), target("FILM", "0"), std::string("/sound/1/0"),
          std::string("/sound/"), "/picture/" + target("GOOD", "1").substr(7)})
        EXPECT_EQ(served.ask(none).status, 404) << none;
    for (const auto& [head, type] :
         std::initializer_list<std::pair<std::string, const char*>>{{"OggS and so on", "audio/ogg"},
                                                                    {"fLaC and so on", "audio/flac"},
                                                                    {"ID3\x04 and so on", "audio/mpeg"},
                                                                    {"\xFF\xFB\x90 and so on", "audio/mpeg"},
                                                                    {std::string("\0\0\0\x1C"
                                                                                 "ftypM4A and",
                                                                                 15),
                                                                     "audio/mp4"},
                                                                    {"\xFF\xD8\xFF and so on", nullptr},
                                                                    {"RIFF but WAVY so", nullptr}}) {
        served.write("scene/a.wav", head);
        const Answer answer = served.ask(target("GOOD", "1"));
        EXPECT_EQ(answer.status, type ? 200 : 404) << head;
        EXPECT_TRUE(!type || answer.head.find(type) != std::string::npos) << answer.head;
    }
}

TEST(WebGateway, AClientsMessagesPassBothWays) {
    ServedPage served;
    const NodeId node = served.scene.createNode(x3d::Transform::type);
    served.scene.newFrame(0);
    WebSocketLine line(served.port);
    ASSERT_EQ(served.open(line), 101);
    line.sayMessage(helloOf(5));
    const auto welcome = line.next();
    ASSERT_TRUE(welcome);
    EXPECT_EQ(welcome->first, 16);
    EXPECT_TRUE(welcome->second.starts_with("RTSGrec1"));
    const auto keyframe = line.next();
    ASSERT_TRUE(keyframe);
    EXPECT_EQ(keyframe->first, 17);
    ASSERT_TRUE(served.scene.set(node, x3d::Transform::translation, Vec3f(1)));
    served.scene.newFrame(1);
    auto frame = line.next();
    while (frame && frame->first != 17) frame = line.next();  // pings
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->second[16], 2) << "a frame";
    EXPECT_EQ(served.server->statistics().peers, 1u);
    EXPECT_EQ(served.gateway->statistics().connections, 1u);
    // The end of one is told to the other, both ways.
    line.say(std::string("\x88\x80\0\0\0\0", 6));
    EXPECT_TRUE(eventually([&] { return served.server->statistics().peers == 0; }));
    EXPECT_TRUE(eventually([&] { return served.gateway->statistics().connections == 0; }));
    WebSocketLine last(served.port);
    ASSERT_EQ(served.open(last), 101);
    last.sayMessage(helloOf(6));
    while (last.next()->first != 17) continue;
    std::thread leaving([&] { served.server.reset(); });
    int type = 0;
    while (type != 5) {
        const auto said = last.next();
        ASSERT_TRUE(said);
        type = said->first;
    }
    leaving.join();
    served.gateway.reset();
    EXPECT_TRUE(last.ended());
}

TEST(WebGateway, WhatMakesNoSenseEndsOnlyItsOwnConnection) {
    ServedPage served;
    served.scene.newFrame(0);
    WebSocketLine good(served.port);
    ASSERT_EQ(served.open(good), 101);
    good.sayMessage(helloOf(5));
    ASSERT_TRUE(good.next());
    const std::string huge(60000, 'x');
    for (const std::string& bad : {std::string("\0\0\0\0", 4),
                                   std::string("\xFF\xFF\xFF\xFF"
                                               "abc",
                                               7),
                                   std::string("ab"), huge, std::string()}) {
        WebSocketLine line(served.port);
        ASSERT_EQ(served.open(line), 101);
        line.sayFrame(bad);
        EXPECT_TRUE(line.ended()) << bad.size();
    }
    for (const std::string& bad :
         {std::string("\x81\x80\0\0\0\0", 6), std::string("\x82\x05hello", 7), std::string("\xF2\x80\0\0\0\0", 6)}) {
        WebSocketLine line(served.port);
        ASSERT_EQ(served.open(line), 101);
        line.say(bad);
        EXPECT_TRUE(line.ended());
    }
    for (const std::string& bad : {std::string("\x16\x03\x01\x02\0\x01\0\x01\xFC\x03\x03", 11),
                                   "GET / HTTP/1.1\r\nX: " + huge, std::string("GET / HTTP/9.9\r\n\r\n"),
                                   std::string("POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")}) {
        Line line(served.port);
        line.say(bad);
        EXPECT_TRUE(line.ended());
    }
    good.heard.clear();
    served.scene.newFrame(1);
    EXPECT_TRUE(good.hear([&] { return !good.heard.empty(); }));
    EXPECT_EQ(served.gateway->statistics().connections, 1u);
}

TEST(WebGateway, NoMoreBrowsersThanMay) {
    WebGatewayOptions options;
    options.maximumConnections = 2;
    ServedPage served(options);
    {
        WebSocketLine first(served.port), second(served.port), third(served.port);
        EXPECT_EQ(served.open(first), 101);
        EXPECT_EQ(served.open(second), 101);
        EXPECT_EQ(served.open(third), 403);
    }
    EXPECT_TRUE(eventually([&] { return served.gateway->statistics().connections == 0; }));
    WebSocketLine again(served.port);
    EXPECT_EQ(served.open(again), 101);
    EXPECT_EQ(served.gateway->statistics().opened, 3u);
}

/// Connections that have not become browsers yet: 256 at once, whatever they wait for.
TEST(WebGateway, NoMoreConnectionsThanFitAreHeldOpen) {
    ServedPage served;
    {
        std::vector<std::unique_ptr<Line>> idle;
        for (int i = 0; i < 256; ++i) idle.push_back(std::make_unique<Line>(served.port));
        Line one(served.port);
        EXPECT_TRUE(one.ended());
        EXPECT_EQ(served.gateway->statistics().refused, 1U);
    }
    EXPECT_TRUE(eventually([&] {
        Line late(served.port);
        late.say("GET / HTTP/1.1\r\nHost: " + served.host + "\r\n\r\n");
        return late.hear([&] { return late.heard.starts_with("HTTP/1.1 200"); });
    })) << "there is room again";
}

}  // namespace
}  // namespace rtsg
