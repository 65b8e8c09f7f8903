// Sessions in JetStream: each record once and in order, whatever happens.
#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/nats/nats_log.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include "link/open_nats.h"
#include "nats/nats_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using test::NatsServer;

std::string contentOf(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// A scene whose log grows, as a verb writes it.
struct GrowingSession {
    Scene scene;
    NodeId cloud;
    std::unique_ptr<LogWriter> writer;
    Attachment attachment;
    int frame = 0;

    explicit GrowingSession(const std::filesystem::path& file, std::size_t points = 100) {
        cloud = scene.createNode(x3d::Coordinate::type);
        EXPECT_TRUE(scene.setName(cloud, "CLOUD"));
        EXPECT_TRUE(scene.set(cloud, x3d::Coordinate::point, Array<Vec3f>(std::vector<Vec3f>(points, Vec3f(1, 2, 3)))));
        writer = *LogWriter::create(file, builtinTypes());
        attachment = scene.bus().attach(*writer);
    }
    void run(int frames, std::size_t points = 100) {
        for (const int end = frame + frames; frame < end; ++frame) {
            EXPECT_TRUE(scene.set(cloud, x3d::Coordinate::point,
                                  Array<Vec3f>(std::vector<Vec3f>(points, Vec3f(float(frame), 0, 0)))));
            scene.newFrame(frame * .1);
        }
    }
    void close() {
        attachment.detach();
        EXPECT_TRUE(writer->close());
    }
};

std::uint64_t recordsIn(const std::filesystem::path& file) {
    auto reader = LogReader::open(file);
    std::uint64_t count = 0;
    while (reader && reader->next()) ++count;
    return count;
}

class NatsStore : public test::WithNats {
  protected:
    /// The stored bytes are those in the file.
    void expectStored(const NatsServer& nats, const std::string& file) {
        const std::string copy = folder_ / "copy.rlog";
        std::filesystem::remove(copy);
        const auto fetched = NatsLog::fetch(nats.address(), copy);
        ASSERT_TRUE(fetched) << fetched.error().format();
        EXPECT_EQ(contentOf(copy), contentOf(file));
    }
    test::TempFolder folder_;
};

TEST_F(NatsStore, AMessageIsARecord) {
    NatsServer nats;
    const std::string file = folder_ / "a.rlog";
    const auto log = NatsLog::start(nats.address(), file, NatsLog::Begin::fresh);
    ASSERT_TRUE(log) << log.error().format();
    GrowingSession session(file);
    session.run(50);
    session.close();
    ASSERT_TRUE((*log)->finish());
    EXPECT_EQ((*log)->storedMessages(), recordsIn(file));
    expectStored(nats, file);
    const auto taken = NatsLog::start(nats.address(), folder_ / "b.rlog", NatsLog::Begin::fresh);
    ASSERT_FALSE(taken) << "a session that is there is not overwritten unasked";
    EXPECT_NE(taken.error().format().find("--force"), std::string::npos);
}

TEST_F(NatsStore, ALongRecordTakesSeveralMessages) {
    NatsServer nats("max_payload: 65536");
    const std::string file = folder_ / "a.rlog";
    const auto log = NatsLog::start(nats.address(), file, NatsLog::Begin::fresh);
    GrowingSession session(file, 50'000);
    session.run(3, 30'000);
    session.close();
    ASSERT_TRUE((*log)->finish());
    EXPECT_GT((*log)->storedMessages(), recordsIn(file) + 20);
    expectStored(nats, file);
}

TEST_F(NatsStore, ANatsServerThatIsKilledLosesAndDoublesNothing) {
    NatsServer nats;
    const std::string file = folder_ / "a.rlog";
    const auto log = NatsLog::start(nats.address(), file, NatsLog::Begin::fresh);
    ASSERT_TRUE(log);
    GrowingSession session(file);
    for (int kill = 0; kill < 3; ++kill) {
        session.run(200);
        std::this_thread::sleep_for(5ms);  // so that it is killed between two records, or within one
        nats.stop(SIGKILL);
        session.run(50);
        nats.start();
    }
    session.close();
    const auto finished = (*log)->finish(30s);
    ASSERT_TRUE(finished) << finished.error().format();
    EXPECT_EQ((*log)->storedMessages(), recordsIn(file));
    expectStored(nats, file);
}

TEST_F(NatsStore, ASessionGoesOnBehindWhatIsStored) {
    NatsServer nats;
    const std::string first = folder_ / "a.rlog", second = folder_ / "b.rlog";
    std::uint64_t stored = 0;
    {
        auto log = NatsLog::start(nats.address(), first, NatsLog::Begin::fresh);
        ASSERT_TRUE(log);
        GrowingSession session(first);
        session.run(40);
        ASSERT_TRUE((*log)->finish());
        session.run(40);
        log->reset();  // as a killed process leaves it: some records are stored, and some are not
        session.attachment.detach();
        session.writer->abandon();
    }
    auto log = NatsLog::start(nats.address(), second, NatsLog::Begin::goOn);
    ASSERT_TRUE(log) << log.error().format();
    stored = (*log)->storedMessages();
    EXPECT_GE(stored, 41u);
    const std::string before = contentOf(second);
    EXPECT_EQ(contentOf(first).substr(0, before.size()), before);
    LogOptions options;
    options.append = true;
    auto replayer = Replayer::open(second);
    ASSERT_TRUE(replayer);
    while (const auto more = (*replayer)->step())
        if (!*more) break;
    Scene& scene = (*replayer)->scene();
    auto writer = LogWriter::create(second, builtinTypes(), options);
    ASSERT_TRUE(writer);
    {
        const Attachment attachment = scene.bus().attach(**writer);
        const double end = scene.now();
        for (int i = 1; i <= 20; ++i) scene.newFrame(end + i);
    }
    ASSERT_TRUE((*writer)->close());
    ASSERT_TRUE((*log)->finish());
    EXPECT_GT((*log)->storedMessages(), stored + 19);
    expectStored(nats, second);
}

TEST_F(NatsStore, AFullStoreIsSaidAndHoldsWholeRecords) {
    NatsServer nats({}, "max_file_store: 100000");
    const std::string file = folder_ / "a.rlog";
    const auto log = NatsLog::start(nats.address(), file, NatsLog::Begin::fresh);
    ASSERT_TRUE(log) << log.error().format();
    GrowingSession session(file);
    session.run(200);  // 250 kB
    session.close();
    const auto finished = (*log)->finish(1s);
    ASSERT_FALSE(finished);
    EXPECT_NE(finished.error().format().find("only the first"), std::string::npos);
    EXPECT_NE((*log)->failure(), "");
    const std::string copy = folder_ / "copy.rlog";
    ASSERT_TRUE(NatsLog::fetch(nats.address(), copy));
    const std::string stored = contentOf(copy);
    EXPECT_GT(stored.size(), 20'000u);
    EXPECT_EQ(contentOf(file).substr(0, stored.size()), stored);
    EXPECT_EQ(recordsIn(copy), (*log)->storedMessages());
}

TEST_F(NatsStore, SomebodyElsesMessagesEndTheStoring) {
    NatsServer nats;
    const std::string file = folder_ / "a.rlog";
    const auto log = NatsLog::start(nats.address(), file, NatsLog::Begin::fresh);
    ASSERT_TRUE(log);
    GrowingSession session(file);
    session.run(5);
    while ((*log)->storedMessages() < 5) std::this_thread::sleep_for(5ms);
    const auto link = openNatsLink(*NatsAddress::parse(nats.address()), "stranger");
    ASSERT_TRUE(link);
    (*link)->publish(NatsSubjects("hall").log, "", std::as_bytes(std::span("stranger", 8)));
    (void)(*link)->flush(2s);
    session.run(5);
    session.close();
    const auto finished = (*log)->finish(10s);
    ASSERT_FALSE(finished);
    EXPECT_NE(finished.error().format().find("somebody else"), std::string::npos) << finished.error().format();
}

TEST_F(NatsStore, NothingStoredIsSaid) {
    NatsServer nats;
    const auto none = NatsLog::fetch(nats.address(), folder_ / "a.rlog");
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().format().find("no session is stored there"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "a.rlog"));
}

}  // namespace
}  // namespace rtsg
