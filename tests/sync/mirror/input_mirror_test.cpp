// Mirrors in input mode: replicas that run the cascade themselves.
#include <chrono>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/session.h>

#include "mirror_support.h"
#include "support/log_support.h"
#include "sync/input_support.h"

namespace rtsg {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr const char* kMovingScene = R"(#X3D V4.0 utf8
DEF T TimeSensor { loop TRUE cycleInterval 2 }
DEF P PositionInterpolator { key [ 0 .5 1 ] keyValue [ -1 0 0, 1 0 0, -1 0 0 ] }
DEF M Transform { }
ROUTE T.fraction_changed TO P.set_fraction
ROUTE P.value_changed TO M.set_translation
)";

struct InputPair {
    Scene origin, replica;
    std::unique_ptr<MirrorServer> server;
    std::unique_ptr<MirrorClient> client;

    void connect(bool offered = true, bool wanted = true) {
        MirrorServerOptions options;
        if (offered) options.mode.mode = Mode::input;
        auto started = MirrorServer::start(origin, "tcp://127.0.0.1:*", options);
        ASSERT_TRUE(started) << started.error().text;
        server = std::move(*started);
        MirrorClientOptions clientOptions;
        clientOptions.inputs = wanted;
        auto connected = MirrorClient::connect(replica, server->endpoint(), clientOptions);
        ASSERT_TRUE(connected) << connected.error().text;
        client = std::move(*connected);
    }
    void follow() {
        const auto end = std::chrono::steady_clock::now() + 20s;
        while (replica.sequence() != origin.sequence() || !client->inStep() || replica.hash() != origin.hash()) {
            ASSERT_LT(std::chrono::steady_clock::now(), end)
                << "state " << replica.sequence() << " of " << origin.sequence() << ' ' << news();
            client->poll(5ms);
            server->service();
        }
    }
    std::string news() {
        std::string all;
        for (const Diagnostic& d : client->takeDiagnostics()) all += d.format() + '\n';
        for (const Diagnostic& d : server->takeDiagnostics()) all += d.format() + '\n';
        return all;
    }
};

TEST(InputMirror, WhatTheClockDoesCostsAHeaderAFrame) {
    InputPair pair;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(pair.origin, kMovingScene, diagnostics));
    pair.connect();
    pair.origin.newFrame(0);
    pair.follow();
    for (int frame = 1; frame <= 10; ++frame) {  // until the replica has got what it takes to run
        pair.origin.newFrame(frame * .01);
        pair.follow();
    }
    const MirrorStatistics before = pair.client->statistics();
    for (int frame = 11; frame <= 60; ++frame) {
        pair.origin.newFrame(frame * .01);
        pair.follow();
    }
    const MirrorStatistics& after = pair.client->statistics();
    EXPECT_EQ(after.inputs - before.inputs, 50u) << pair.news();
    EXPECT_EQ(after.bytes - before.bytes, 50u * 64);
    EXPECT_EQ(after.divergences, 0u);
}

class InputMirrorLaw : public testing::TestWithParam<std::uint64_t> {};

TEST_P(InputMirrorLaw, SameHashWhateverHappens) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    InputPair pair;
    pair.replica.registerBehaviour("Material", steady());
    pair.connect();
    int count = 0;
    live(pair.origin, GetParam(), 100, true, GetParam() % 2 == 0, [&](const ChangeSet&) {
        if (++count % 5 == 0 && !testing::Test::HasFatalFailure()) pair.follow();
    });
    pair.follow();
    EXPECT_EQ(pair.replica.dump(), pair.origin.dump());
    EXPECT_GT(pair.client->statistics().inputs, 20u) << pair.news();
    EXPECT_EQ(pair.client->statistics().divergences, 0u) << pair.news();
}

INSTANTIATE_TEST_SUITE_P(Seeds, InputMirrorLaw, testing::Range<std::uint64_t>(1, 7));

TEST(InputMirror, WithoutTheBehaviourChangesWillDo) {
    InputPair pair;  // the origin has a behaviour that the replica lacks
    pair.connect();
    live(pair.origin, 3, 40, true, false, [](const ChangeSet&) {});
    pair.follow();
    for (int frame = 0; frame < 20; ++frame) {
        pair.origin.newFrame(pair.origin.now() + .01);
        pair.follow();
    }
    EXPECT_EQ(pair.client->statistics().inputs, 0u);
    EXPECT_NE(pair.news().find("Material is not registered here"), std::string::npos);
}

TEST(InputMirror, AnEditedReplicaIsPutRightAndRunsOn) {
    InputPair pair;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(pair.origin, kMovingScene, diagnostics));
    pair.connect();
    for (int frame = 0; frame <= 10; ++frame) {
        pair.origin.newFrame(frame * .01);
        pair.follow();
    }
    const std::uint64_t before = pair.client->statistics().inputs;
    EXPECT_GT(before, 0u);
    ASSERT_TRUE(pair.replica.set(pair.replica.findName("M"), x3d::Transform::translation, Vec3f(7, 7, 7)));
    for (int frame = 11; frame <= 40; ++frame) {
        pair.origin.newFrame(frame * .01);
        pair.follow();
    }
    EXPECT_GE(pair.client->statistics().divergences, 1u);
    EXPECT_GT(pair.client->statistics().inputs, before + 5);
}

TEST(InputMirror, BothSidesHaveToWantIt) {
    for (const bool offered : {false, true}) {
        InputPair pair;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(pair.origin, kMovingScene, diagnostics));
        pair.connect(offered, !offered);
        for (int frame = 0; frame <= 10; ++frame) {
            pair.origin.newFrame(frame * .01);
            pair.follow();
        }
        EXPECT_EQ(pair.client->statistics().inputs, 0u);
    }
}

class InputMirrorLog : public LogFolder {};

/// The server is killed while its replica runs the scene itself: the one that goes on from the log sends the changes of
/// what was missed, and then inputs again.
TEST_F(InputMirrorLog, GoesOnWithoutASnapshot) {
    Scene first, second, replica;
    MirrorServerOptions options;
    LogOptions logOptions;
    options.mode.mode = logOptions.mode.mode = Mode::input;
    first.setInputRecording(true);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(first, kMovingScene, diagnostics));
    auto log = LogWriter::create(file(), builtinTypes(), logOptions);
    ASSERT_TRUE(log);
    Attachment attachment = first.bus().attach(**log);
    options.epoch = (*log)->epoch();
    auto server = *MirrorServer::start(first, kAnyPort, options);
    const std::string endpoint = server->endpoint();
    MirrorClientOptions clientOptions;
    clientOptions.inputs = true;
    const auto client = *MirrorClient::connect(replica, endpoint, clientOptions);
    for (int frame = 0; frame < 20; ++frame) {
        first.newFrame(frame * .01);
        ASSERT_TRUE(pollUntilAt(*client, first)) << frame;
    }
    EXPECT_GT(client->statistics().inputs, 5u);
    server.reset();
    for (int frame = 20; frame < 25; ++frame) first.newFrame(frame * .01);
    attachment.detach();
    (*log)->abandon();

    const auto session = resumeSession(file(), second);
    ASSERT_TRUE(session) << session.error().format();
    options.epoch = session->epoch, options.before = session->before;
    server = *MirrorServer::start(second, endpoint, options);
    ASSERT_TRUE(pollUntilAt(*client, second));
    const std::uint64_t before = client->statistics().inputs;
    for (int frame = 25; frame < 50; ++frame) {
        second.newFrame(frame * .01);
        ASSERT_TRUE(pollUntilAt(*client, second)) << frame;
    }
    EXPECT_EQ(client->statistics().snapshots, 1u);
    EXPECT_GT(client->statistics().inputs, before + 10);
    EXPECT_EQ(client->statistics().divergences, 0u);
}

}  // namespace
}  // namespace rtsg
