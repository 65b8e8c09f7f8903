// Nodes of fetched files: what an origin publishes, a replica takes.
#include <rtsg/fetch/fetched_files.h>

#include <gmock/gmock.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>

#include "lying_server.h"

namespace rtsg {
namespace {

using test::LyingServer;
using F = x3d::FetchedFile;

std::string textAt(WebFetcher& fetcher, const std::string& address) {
    auto content = fetcher.fetch(address, 1000);
    if (!content) return "refused: " + content.error().text;
    std::string text(100, '\0');
    text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::read(content->descriptor, text.data(), text.size()))));
    ::close(content->descriptor);
    return text;
}

std::size_t filesIn(const Scene& scene) {
    std::size_t count = 0;
    scene.forEachNode([&](const Node& node) { count += node.is(F::type) ? 1 : 0; });
    return count;
}

class FetchedFilesTest : public testing::Test {
  protected:
    FetchedFilesTest() {
        for (const char* name : {"/a", "/b"}) server.file(name, std::string("content of ") + name);
        FetchSettings settings;
        settings.rules.allowed = {*WebAddress::parse(server.address("/"))};
        origin = std::make_unique<WebFetcher>(settings);
    }
    /// The bytes that a replica without permission reads from an address, once it has the origin's changes.
    static std::string replicated(const Scene& scene, const std::string& address) {
        WebFetcher fetcher(FetchSettings{});
        Scene replica;
        FetchedFilesFollower follower(fetcher);
        const Attachment attachment = replica.bus().attach(follower);
        if (!replica.apply(std::make_shared<const ChangeSet>(scene.snapshot()))) return "no replica";
        return textAt(fetcher, address);
    }

    LyingServer server;
    std::unique_ptr<WebFetcher> origin;
    Scene scene;
};

TEST_F(FetchedFilesTest, WithBytesAReplicaNeedsNothing) {
    FetchedFiles files(*origin, true);
    EXPECT_EQ(files.publish(scene), 0U);
    EXPECT_EQ(textAt(*origin, server.address("/a")), "content of /a");
    EXPECT_EQ(textAt(*origin, server.address("/a")), "content of /a");
    EXPECT_EQ(files.publish(scene), 1U);
    EXPECT_EQ(textAt(*origin, server.address("/b")), "content of /b");
    EXPECT_EQ(textAt(*origin, server.address("/a")), "content of /a");
    EXPECT_EQ(files.publish(scene), 1U);
    EXPECT_EQ(files.publish(scene), 0U);
    scene.seal();
    EXPECT_EQ(filesIn(scene), 2U);
    const int asked = server.asked();
    EXPECT_EQ(replicated(scene, server.address("/a")), "content of /a");
    EXPECT_EQ(replicated(scene, server.address("/b")), "content of /b");
    EXPECT_THAT(replicated(scene, server.address("/c")), testing::HasSubstr("--allow"));
    EXPECT_EQ(server.asked(), asked);
    // A later run of the scene makes no second node.
    WebFetcher again(FetchSettings{});
    keepFetchedFiles(scene, again);
    EXPECT_TRUE(again.hasKeptBytes());
    EXPECT_EQ(textAt(again, server.address("/a")), "content of /a");
    EXPECT_EQ(FetchedFiles(again, true).publish(scene), 0U);
}

TEST_F(FetchedFilesTest, WithoutThemItKnowsTheHash) {
    EXPECT_EQ(textAt(*origin, server.address("/a")), "content of /a");
    EXPECT_EQ(FetchedFiles(*origin, false).publish(scene), 1U);
    scene.seal();
    EXPECT_THAT(replicated(scene, server.address("/a")), testing::HasSubstr("--allow"));
    scene.forEachNode([&](const Node& node) {
        if (!node.is(F::type)) return;
        EXPECT_EQ(node.get(F::_address).str(), server.address("/a"));
        EXPECT_EQ(node.get(F::_source).str(), server.address("/a"));
        EXPECT_EQ(node.get(F::_hash).str().size(), 64U);
        EXPECT_TRUE(node.get(F::_bytes).empty());
    });
}

TEST_F(FetchedFilesTest, ForgedNodesAreIgnored) {
    const auto forge = [&](const std::string& address, Array<std::int32_t> bytes) {
        const NodeId node = scene.createNode(F::type);
        ASSERT_TRUE(scene.set(node, F::_address, String(address)));
        ASSERT_TRUE(scene.set(node, F::_source, String(address)));
        ASSERT_TRUE(scene.set(node, F::_bytes, bytes));
    };
    forge("file:///etc/passwd", {4, 0x41414141});
    forge("http://example.org/negative", {-1});
    forge("http://example.org/short", {100, 0x41414141});
    forge("http://example.org/long", {1, 1, 1});
    forge("http://example.org/good", {4, 0x41414141});
    scene.seal();
    EXPECT_EQ(replicated(scene, "http://example.org/good"), "AAAA");
    for (const char* name : {"negative", "short", "long"})
        EXPECT_THAT(replicated(scene, std::string("http://example.org/") + name), testing::HasSubstr("--allow"))
            << name;
}

}  // namespace
}  // namespace rtsg
