// The files that urls may open: core/resource.h.
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/resource.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>

#include "scene/resource_url.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

/// A folder `root` that may be opened, and one beside it.
class ResourceTest : public testing::Test {
  protected:
    ResourceTest() {
        std::filesystem::create_directories(root / "parts");
        std::filesystem::create_directories(folder / "other");
        write("other/secret.txt", "secret");
        write("root/a b.txt", "inside");
        write("root/parts/c.txt", "deeper");
    }
    void write(const std::string& name, std::string_view text) const {
        std::ofstream(folder / name, std::ios::binary) << text;
    }
    std::string read(std::string_view url) const { return read(Resources(root), url); }
    static std::string read(const Resources& resources, std::string_view url) {
        auto resource = resources.open(resources.folder(), url);
        if (!resource) return resource.error().text;
        auto text = resource->read();
        return text ? *text : text.error().text;
    }

    const test::TempFolder own;
    const std::filesystem::path folder = own.path(), root = folder / "root";
};

TEST_F(ResourceTest, FilesBelowTheRootAreOpened) {
    EXPECT_EQ(read("a%20b.txt"), "inside");
    EXPECT_EQ(read("parts/c.txt"), "deeper");
    EXPECT_EQ(read("parts/../a b.txt"), "inside");
    EXPECT_EQ(read("./parts//c.txt#part"), "deeper");
    EXPECT_EQ(read((root / "parts/c.txt").string()), "deeper");
    EXPECT_EQ(read("file://" + (root / "a%20b.txt").string()), "inside");
    EXPECT_EQ(read("FILE://localhost" + (root / "a%20b.txt").string()), "inside");
    EXPECT_EQ(Resources(root).open(root, "a%20b.txt#T%31")->fragment(), "T1");
}

TEST_F(ResourceTest, WhatIsOutsideIsRefusedWithTheOptionThatHelps) {
    for (const std::string& url : {std::string("../other/secret.txt"), std::string("parts/../../other/secret.txt"),
                                   std::string("%2e%2e/other/secret.txt"), (folder / "other/secret.txt").string(),
                                   "file://" + (folder / "other/secret.txt").string()}) {
        EXPECT_THAT(read(url), HasSubstr("outside the folders that may be opened")) << url;
        EXPECT_THAT(read(url), HasSubstr("--allow " + (folder / "other").string())) << url;
    }
    EXPECT_THAT(read("file:///etc/passwd"), HasSubstr("--allow /etc"));
    // A name that begins as the root's does is not below it.
    std::filesystem::create_directories(folder / "rootless");
    write("rootless/x.txt", "no");
    EXPECT_THAT(read((folder / "rootless/x.txt").string()), HasSubstr("outside"));
}

TEST_F(ResourceTest, AllowedFoldersAreOpenedToo) {
    ResourcePolicy policy;
    policy.roots = {root, folder / "other/"};
    const Resources both(root, policy);
    EXPECT_EQ(read(both, "../other/secret.txt"), "secret");
    EXPECT_EQ(read(both, "parts/c.txt"), "deeper");
    policy.roots = {folder / "other"};
    EXPECT_THAT(read(Resources(root, policy), "parts/c.txt"), HasSubstr("outside"));
}

TEST_F(ResourceTest, WithoutARootNothingIsOpened) {
    EXPECT_THAT(read(Resources(), "/etc/passwd"), HasSubstr("outside"));
    EXPECT_THAT(read(Resources(""), "/etc/passwd"), HasSubstr("outside"));
    EXPECT_THAT(read(Resources(), "parts/c.txt"), HasSubstr("--base"));
    EXPECT_EQ(read(Resources(), "data:text/plain,yes"), "yes");
}

TEST_F(ResourceTest, LinksAreFollowedInsideAndNotOut) {
    std::filesystem::create_symlink(root / "parts/c.txt", root / "near.txt");
    std::filesystem::create_symlink(folder / "other/secret.txt", root / "far.txt");
    std::filesystem::create_directory_symlink(folder / "other", root / "away");
    EXPECT_EQ(read("near.txt"), "deeper");
    EXPECT_THAT(read("far.txt"), HasSubstr("leads to " + (folder / "other/secret.txt").string()));
    EXPECT_THAT(read("away/secret.txt"), HasSubstr("--allow " + (folder / "other").string()));
    // The root itself may be named through a link.
    std::filesystem::create_directory_symlink(root, folder / "link");
    EXPECT_EQ(read(Resources(folder / "link"), "parts/c.txt"), "deeper");
    EXPECT_EQ(read(Resources(folder / "link"), (folder / "link/parts/c.txt").string()), "deeper");
}

TEST_F(ResourceTest, OnlyRegularFilesAreOpened) {
    ASSERT_EQ(::mkfifo((root / "pipe").c_str(), 0600), 0);
    EXPECT_THAT(read("pipe"), HasSubstr("is a pipe, not a file"));  // opening one waits for a writer
    EXPECT_THAT(read("parts"), HasSubstr("is a folder, not a file"));
    EXPECT_THAT(read(Resources("/dev"), "/dev/zero"), HasSubstr("is a device, not a file"));
    EXPECT_THAT(read("none.txt"), HasSubstr("'none.txt' is not there"));
    EXPECT_THAT(read("parts/c.txt/d"), HasSubstr("is not there"));
    EXPECT_THAT(read("parts/c.txt%00.png"), HasSubstr("zero byte"));
    EXPECT_THAT(read(""), HasSubstr("names no file"));
    EXPECT_THAT(read("#part"), HasSubstr("names no file"));
}

TEST_F(ResourceTest, UrlsOfPackagesNameFilesInTheFoldersThatWereNamed) {
    ResourcePolicy policy;
    policy.roots = {root};
    policy.packages = {{"arm", folder / "other"}};
    const Resources resources(root, policy);
    EXPECT_EQ(read(resources, "package://arm/secret.txt"), "secret");
    EXPECT_EQ(read(resources, "PACKAGE://arm//secret.txt#part"), "secret");
    EXPECT_EQ(read(resources, "model://arm/secret.txt"), "secret");
    EXPECT_EQ(resources.folderBehind({}, "package://arm/meshes/a.dae"), folder / "other/meshes");
    EXPECT_EQ(resources.folderBehind({}, "package://leg/meshes/a.dae"), "");
    EXPECT_EQ(joinUrls("package://arm/meshes/a.dae", "b.png"), "package://arm/meshes/b.png");
    EXPECT_THAT(read(resources, "package://leg/a.stl"), HasSubstr("--package leg=FOLDER"));
    EXPECT_THAT(read(resources, "package://"), HasSubstr("nothing says where the package"));
    EXPECT_THAT(read(resources, "package://arm/../rootless/x"), HasSubstr("outside"));
    EXPECT_THAT(read(resources, "package://arm//etc/passwd"), HasSubstr("is not there"));
    EXPECT_THAT(read(resources, "package://arm"), HasSubstr("not a file"));
}

TEST_F(ResourceTest, TheNetworkIsRefused) {
    for (const char* url : {"http://example.org/a.txt", "HTTPS://example.org/", "urn:web3d:media:a", "ftp://h/a",
                            "file://server/share/a.txt"})
        EXPECT_THAT(read(url), HasSubstr("nothing is fetched from a network")) << url;
}

TEST_F(ResourceTest, DataUrls) {
    EXPECT_EQ(read("data:text/plain,a%20b#c"), "a b#c");
    EXPECT_EQ(read("data:text/plain;base64,aGVsbG8="), "hello");
    EXPECT_EQ(read("data:;base64,aGVs\nbG8h"), "hello!");
    EXPECT_EQ(read("Data:,x"), "x");
    EXPECT_EQ(Resources().open({}, "data:image/png;x=y;base64,AAAA")->mediaType(), "image/png");
    EXPECT_THAT(read("data:text/plain;base64,a?b"), HasSubstr("well-formed"));
    EXPECT_THAT(read("data:nothing"), HasSubstr("well-formed"));
    const std::string message = read("data:" + std::string(100'000, 'x'));
    EXPECT_LT(message.size(), 400u) << "a long url is not repeated";
}

TEST_F(ResourceTest, LargeFilesAreRefused) {
    ResourcePolicy policy;
    policy.roots = {root};
    policy.maximumBytes = 5;
    const Resources resources(root, policy);
    EXPECT_THAT(read(resources, "parts/c.txt"), HasSubstr("--limit bytes=N"));
    EXPECT_THAT(read(resources, "data:,123456"), HasSubstr("--limit bytes=N"));
    write("root/five.txt", "12345");
    EXPECT_EQ(read(resources, "five.txt"), "12345");
    // One that grows after it was opened.
    auto resource = resources.open(root, "five.txt");
    ASSERT_TRUE(resource);
    write("root/five.txt", "123456");
    EXPECT_THAT(resource->read().error().text, HasSubstr("more than 5 bytes"));
}

TEST_F(ResourceTest, WhatWasCheckedIsWhatIsRead) {
    auto resource = Resources(root).open(root, "parts/c.txt");
    ASSERT_TRUE(resource);
    std::filesystem::remove(root / "parts/c.txt");
    std::filesystem::create_symlink(folder / "other/secret.txt", root / "parts/c.txt");
    EXPECT_EQ(*resource->read(), "deeper");
    EXPECT_THAT(read("parts/c.txt"), HasSubstr("outside"));
}

TEST_F(ResourceTest, AFileThatIsCutShortWhileItIsReadEndsThere) {
    write("root/long.txt", std::string(1 << 20, 'x'));
    auto resource = Resources(root).open(root, "long.txt");
    ASSERT_TRUE(resource);
    std::filesystem::resize_file(root / "long.txt", 10);
    EXPECT_EQ(resource->read()->size(), 10u);
}

TEST_F(ResourceTest, GivesPartsBeforeTheWhole) {
    write("root/six.txt", "123456");
    for (const char* url : {"six.txt", "data:,123456"}) {
        auto resource = Resources(root).open(root, url);
        ASSERT_TRUE(resource) << url;
        EXPECT_EQ(resource->size(), 6u);
        EXPECT_EQ(resource->readAt(2, 3), "345");
        EXPECT_EQ(resource->readAt(0, 0), "");
        EXPECT_EQ(resource->readAt(4, 100), "56");
        EXPECT_EQ(resource->readAt(6, 1), "");
        EXPECT_EQ(resource->readAt(UINT64_MAX, 1), "");
        EXPECT_EQ(*resource->read(), "123456") << "from its beginning, whatever was read before";
        EXPECT_EQ(resource->size(), 0u);
        EXPECT_EQ(resource->readAt(0, 1), "");
    }
}

TEST_F(ResourceTest, UrlsJoinAsFoldersDo) {
    EXPECT_EQ(joinUrls("parts/a.x3d#P", "b.x3d#Q"), "parts/b.x3d");
    EXPECT_EQ(joinUrls("a.x3d", "b.x3d"), "b.x3d");
    EXPECT_EQ(joinUrls("parts/a.x3d", "/b.x3d"), "/b.x3d");
    EXPECT_EQ(joinUrls("", "parts/b%20.x3d#P"), "parts/b%20.x3d");
    EXPECT_EQ(joinUrls("parts/a.x3d", "data:model/x3d+xml,..."), "data:");
}

TEST_F(ResourceTest, ARootThatCannotBeFoundOpensNothing) {
    std::filesystem::create_symlink(folder / "b", folder / "a");
    std::filesystem::create_symlink(folder / "a", folder / "b");
    ResourcePolicy policy;
    policy.roots = {folder / "a"};
    EXPECT_THAT(read(Resources(root, policy), "parts/c.txt"), HasSubstr("outside"));
}

TEST_F(ResourceTest, OfAFileOpensItsFolderAndTheWorkingFolder) {
    EXPECT_EQ(Resources::ofFile("scene.x3dv").folder(), std::filesystem::current_path());
    const std::filesystem::path here = std::filesystem::current_path();
    std::filesystem::current_path(folder / "other");
    const Resources resources = Resources::ofFile(root / "scene.x3dv");
    std::filesystem::current_path(here);
    EXPECT_EQ(read(resources, "parts/c.txt"), "deeper");
    EXPECT_EQ(read(resources, "../other/secret.txt"), "secret");
    std::filesystem::create_directories(folder / "third");
    write("third/x.txt", "no");
    EXPECT_THAT(read(resources, "../third/x.txt"), HasSubstr("outside"));
}

TEST_F(ResourceTest, OneThatIsAssignedIsTheOther) {
    const Resources resources(root);
    auto a = resources.open(root, "a b.txt"), b = resources.open(root, "parts/c.txt");
    ASSERT_TRUE(a && b);
    *a = std::move(*b);
    EXPECT_EQ(a->path().filename(), "c.txt");
    EXPECT_EQ(*a->read(), "deeper");
}

TEST(ResourceUrl, PartsAreWhatTheyLookLike) {
    using Kind = detail::UrlParts::Kind;
    EXPECT_EQ(detail::percentDecoded("%4a%4A%4G%4"), "JJ%4G%4");
    EXPECT_EQ(detail::splitUrl("c:/a.png").kind, Kind::file) << "a drive, not a scheme";
    EXPECT_EQ(detail::splitUrl("my room: hall.png").path, "my room: hall.png") << "no scheme has a blank";
    EXPECT_EQ(detail::splitUrl("web+x3d:a").kind, Kind::other);
    EXPECT_EQ(detail::decodeDataUrl("data:;base64,-_8=")->bytes, "\xfb\xff");
    EXPECT_EQ(detail::decodeDataUrl("data:;base64,+/8=")->bytes, "\xfb\xff");
    EXPECT_FALSE(detail::decodeDataUrl("data,a:b"));
    EXPECT_EQ(urlForMessage(std::string(200, 'x')), std::string(200, 'x'));
    EXPECT_EQ(urlForMessage(std::string(201, 'x')), std::string(200, 'x') + "...");
}

TEST(ResourceUrl, FoldersBehindUrls) {
    EXPECT_EQ(Resources().folderBehind("/at", "parts/a.x3d"), "/at/parts");
    EXPECT_EQ(Resources().folderBehind({}, "/far/a.x3d"), "/far");
    EXPECT_EQ(Resources().folderBehind({}, "parts/a.x3d"), "");
    EXPECT_EQ(Resources().folderBehind("/at", "http://example.org/parts/a.x3d"), "http://example.org/parts");
}

// ---- which folder a node's urls start from -----------------------------------------------------------------------

class ResourceFolders : public ResourceTest {
  protected:
    void document(const std::string& name, std::string_view text) const {
        std::filesystem::create_directories((root / name).parent_path());
        std::ofstream(root / name) << "#X3D V4.0 utf8\nPROFILE Full\n" << text;
    }
    /// The folders of the url of the only node of that type, relative to `base`.
    static std::string foldersOf(const Scene& scene, std::string_view type, const std::filesystem::path& base) {
        std::string text;
        const Resources resources(base);
        scene.forEachNode([&](const Node& node) {
            if (node.type().name != type) return;
            for (const auto& one : resources.foldersOf(scene, node, node.type().findExact("url")))
                text += one.lexically_relative(resources.folder()).lexically_normal().string() + ";";
        });
        return text;
    }
    /// The folders in the scene that loaded the files; a replica elsewhere must agree.
    std::string foldersOf(std::string_view type) {
        Diagnostics diagnostics;
        Scene scene, replica;
        EXPECT_TRUE(loadFile(scene, root / "main.x3dv", diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        scene.seal();
        EXPECT_TRUE(replica.apply(std::make_shared<const ChangeSet>(scene.snapshot())));
        const std::string here = foldersOf(scene, type, root);
        EXPECT_EQ(foldersOf(replica, type, "/somewhere/else"), here);
        return here;
    }
};

TEST_F(ResourceFolders, OfTheDocumentItself) {
    document("main.x3dv", "Shape { appearance Appearance { texture ImageTexture { url \"a.png\" } } }");
    EXPECT_EQ(foldersOf("ImageTexture"), ".;");
}

TEST_F(ResourceFolders, OfInlinesWithinInlines) {
    document("main.x3dv", "Inline { url [ \"gone/a.x3dv\" \"one/a.x3dv\" ] }");
    document("one/a.x3dv", "Group { children Inline { url \"two%20/b.x3dv\" } }");
    document("one/two /b.x3dv", "Sound { source AudioClip { url \"a.wav\" } }");
    EXPECT_EQ(foldersOf("AudioClip"), "one/two ;") << "the url that was loaded counts, not the first";
}

TEST_F(ResourceFolders, OfAnExternProtosBody) {
    document("main.x3dv", "EXTERNPROTO P [ ] \"libs/all.x3dv#P\" Group { children P { } }");
    document("libs/all.x3dv", "EXTERNPROTO P [ ] \"deep/real.x3dv#Q\"");
    document("libs/deep/real.x3dv", "PROTO Q [ ] { Group { children Sound { source AudioClip { url \"a.wav\" } } } }");
    EXPECT_EQ(foldersOf("AudioClip"), "libs/deep;");
}

TEST_F(ResourceFolders, OfAUrlThatCameByIs) {
    document("main.x3dv", "EXTERNPROTO P [ inputOutput MFString file ] \"libs/p.x3dv#P\" P { file \"mine.wav\" }");
    document("libs/p.x3dv", "PROTO P [ inputOutput MFString file [ ] ] { Sound { source AudioClip { url IS file } } }");
    EXPECT_EQ(foldersOf("AudioClip"), ".;libs;") << "first where the url was written";
}

TEST_F(ResourceFolders, OfAUrlInABodyWhoseOtherFieldsCameByIs) {
    document("main.x3dv", "EXTERNPROTO P [ inputOutput SFFloat gain ] \"libs/p.x3dv#P\" P { gain 2 }");
    document("libs/p.x3dv",
             "PROTO P [ inputOutput SFFloat gain 1 ] { Sound { source AudioClip { gain IS gain url \"a.wav\" } } }");
    EXPECT_EQ(foldersOf("AudioClip"), "libs;");
}

TEST_F(ResourceFolders, OfAUrlThatCameByIsThroughMany) {
    document("main.x3dv", "EXTERNPROTO P [ inputOutput MFString file ] \"a/p.x3dv#P\" P { file \"mine.wav\" }");
    document("a/p.x3dv",
             "EXTERNPROTO Q [ inputOutput MFString file ] \"b/q.x3dv#Q\"\n"
             "PROTO P [ inputOutput MFString file [ ] ] { Group { children Q { file IS file } } }");
    document("a/b/q.x3dv",
             "EXTERNPROTO R [ inputOutput MFString file ] \"c/r.x3dv#R\"\n"
             "PROTO Q [ inputOutput MFString file [ ] ] { Group { children R { file IS file } } }");
    document("a/b/c/r.x3dv",
             "PROTO R [ inputOutput MFString file [ ] ] { Sound { source AudioClip { url IS file } } }");
    EXPECT_EQ(foldersOf("AudioClip"), ".;a;a/b;a/b/c;");
}

TEST_F(ResourceFolders, WhatIsNowhereIsReportedWhereItWasWritten) {
    document("main.x3dv", "EXTERNPROTO P [ inputOutput MFString file ] \"libs/p.x3dv#P\" P { file \"gone.wav\" }");
    document("libs/p.x3dv", "PROTO P [ inputOutput MFString file [ ] ] { Sound { source AudioClip { url IS file } } }");
    Diagnostics diagnostics;
    Scene scene;
    ASSERT_TRUE(loadFile(scene, root / "main.x3dv", diagnostics));
    const Resources resources(root);
    scene.forEachNode([&](const Node& node) {
        if (node.type().name != "AudioClip") return;
        const auto opened = resources.open(scene, node, node.type().findExact("url"), "gone.wav");
        ASSERT_FALSE(opened);
        EXPECT_THAT(opened.error().text, HasSubstr((root / "gone.wav").string()));
    });
}

TEST_F(ResourceFolders, InlinesThatAreUnloadedForgetThem) {
    document("main.x3dv", "DEF I Inline { url \"one/a.x3dv\" }");
    document("one/a.x3dv", "Group { }");
    Diagnostics diagnostics;
    Scene scene;
    ASSERT_TRUE(loadFile(scene, root / "main.x3dv", diagnostics));
    const Node& node = scene.node(scene.findName("I"));
    const FieldIndex loaded = node.type().findExact("loadedUrl");
    EXPECT_EQ(node.value(loaded).as<String>().view(), "one/a.x3dv");
    BuildOptions options;
    options.file = root / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    ASSERT_TRUE(scene.sendEvent(node.id(), node.type().findExact("load"), Value(false)));
    scene.newFrame(1);
    EXPECT_EQ(loader.update(), 1u);
    EXPECT_EQ(node.value(loaded).as<String>().view(), "");
}

}  // namespace
}  // namespace rtsg
