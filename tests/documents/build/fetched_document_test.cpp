// Documents and files at addresses: where their urls start, what waits for them, and who is told. The fetcher here has
// no network.
#include <fstream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <sys/mman.h>
#include <unistd.h>

#include <rtsg/core/url_fetcher.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/world.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// Has what a test says, once it says so.
class FakeFetcher final : public UrlFetcher {
  public:
    Result<FetchedContent> fetch(const std::string& address, std::uint64_t) override {
        asked.push_back(address);
        const auto moved = redirects.find(address);
        const std::string at = moved == redirects.end() ? address : moved->second;
        const auto found = files.find(at);
        if (found == files.end()) return fail("the server answers 404");
        const int descriptor = ::memfd_create("made up", MFD_CLOEXEC);
        EXPECT_EQ(::write(descriptor, found->second.data(), found->second.size()),
                  static_cast<ssize_t>(found->second.size()));
        ::lseek(descriptor, 0, SEEK_SET);
        return FetchedContent{at, {}, descriptor};
    }
    bool awaits(const std::string& address, std::uint64_t) override { return awaited.contains(address); }

    std::map<std::string, std::string> files, redirects;
    std::set<std::string> awaited;
    std::vector<std::string> asked;
};

class FetchedDocuments : public testing::Test {
  protected:
    FetchedDocuments() { policy.fetcher = fetcher; }
    void file(const std::string& path, const std::string& text) {
        fetcher->files["https://h/" + path] = "#X3D V4.0 utf8\n" + text;
    }
    bool load(const std::string& name) {
        LoadOptions options;
        options.resources = Resources::ofFile(name, policy);
        return loadFile(scene, name, diagnostics, options);
    }
    bool loadText(std::string_view text) {
        LoadOptions options;
        options.resources = Resources({}, policy);
        return rtsg::loadText(scene, text, diagnostics, {}, options);
    }
    std::string problems() const { return test::allText(diagnostics); }
    NodeId at(std::initializer_list<const char*> path) const {
        NodeId id;
        for (const char* name : path) id = scene.findName(name, id);
        return id;
    }

    std::shared_ptr<FakeFetcher> fetcher = std::make_shared<FakeFetcher>();
    ResourcePolicy policy;
    Scene scene;
    Diagnostics diagnostics;
};

TEST_F(FetchedDocuments, RelativeUrlsStartAtTheirDocument) {
    file("a/main.x3dv", "DEF I Inline { url \"parts/b.x3dv?v=/1\" }");
    file("a/parts/b.x3dv?v=/1", "DEF J Inline { url \"../../c.x3dv\" } DEF K Inline { url \"/d.x3dv\" }");
    file("c.x3dv", "DEF T Transform { translation 1 2 3 }");
    file("d.x3dv", "DEF T Transform { translation 4 5 6 }");
    ASSERT_TRUE(load("https://h/a/main.x3dv"));
    EXPECT_EQ(problems(), "");
    EXPECT_TRUE(at({"I", "J", "T"}));
    EXPECT_TRUE(at({"I", "K", "T"}));
    EXPECT_EQ(scene.node(at({"I", "J"})).get(x3d::Inline::loadedUrl).str(), "https://h/c.x3dv");
    EXPECT_EQ(scene.node(scene.root()).get(x3d::RtsgScene::loadedUrl).str(), "https://h/a/main.x3dv");
    // So a replica, which has no folder, finds the same.
    EXPECT_EQ(Resources({}, policy).folderOf(scene, {}), "https://h/a");
    EXPECT_EQ(Resources("/elsewhere", policy).folderOf(scene, at({"I"})), "https://h/a/parts");
}

TEST_F(FetchedDocuments, RedirectsMoveTheStart) {
    fetcher->redirects = {{"https://h/main", "https://h/deep/main.x3dv"}, {"https://h/deep/p", "https://h/far/p.x3dv"}};
    file("deep/main.x3dv", "DEF I Inline { url \"p\" }");
    file("far/p.x3dv", "DEF J Inline { url \"q.x3dv\" } EXTERNPROTO Q [ ] \"r.x3dv\" Q { }");
    file("far/q.x3dv", "DEF T Transform { }");
    file("far/r.x3dv", "PROTO Q [ ] { DEF L Inline { url \"q.x3dv\" } }");
    ASSERT_TRUE(load("https://h/main"));
    EXPECT_EQ(problems(), "");
    EXPECT_TRUE(at({"I", "J", "T"}));
}

TEST_F(FetchedDocuments, DocumentsOfTheNetworkNameNoFiles) {
    policy.roots = {"/"};
    file("main.x3dv", "Inline { url \"file:///etc/hostname\" } Inline { url \"/etc/hostname\" }");
    ASSERT_TRUE(load("https://h/main.x3dv"));
    EXPECT_THAT(problems(), HasSubstr("'file:///etc/hostname' is a file, and the document that names it is on the"));
    EXPECT_THAT(fetcher->asked, testing::Contains("https://h/etc/hostname"));
}

TEST_F(FetchedDocuments, WhatDoesNotComeIsReported) {
    EXPECT_FALSE(load("https://h/none.x3dv"));
    EXPECT_THAT(problems(), HasSubstr("'https://h/none.x3dv': the server answers 404"));
    ASSERT_TRUE(loadText("#X3D V4.0 utf8\nInline { url [ \"https://h/no.x3dv\" \"https://h/yes.x3dv\" ] }"));
    EXPECT_THAT(problems(), HasSubstr("Inline: 'https://h/no.x3dv': the server answers 404"));
    EXPECT_THAT(problems(), HasSubstr("'https://h/yes.x3dv'"));
}

TEST_F(FetchedDocuments, AnotherWorldStartsElsewhere) {
    file("a/main.x3dv", "Group { }");
    file("b/next.x3dv", "DEF I Inline { url \"part.x3dv\" }");
    file("b/part.x3dv", "DEF T Transform { }");
    ASSERT_TRUE(load("https://h/a/main.x3dv"));
    LoadOptions options;
    options.resources = Resources({}, policy);
    ASSERT_TRUE(loadWorld(scene, "https://h/b/next.x3dv", diagnostics, options)) << problems();
    EXPECT_TRUE(at({"I", "T"}));
    EXPECT_EQ(scene.node(scene.root()).get(x3d::RtsgScene::loadedUrl).str(), "https://h/b/next.x3dv");
    const test::TempFolder own;
    std::ofstream(own.path() / "local.x3dv") << "#X3D V4.0 utf8\nGroup { }\n";
    ASSERT_TRUE(loadWorld(scene, own.path() / "local.x3dv", diagnostics, options)) << problems();
    EXPECT_EQ(scene.node(scene.root()).get(x3d::RtsgScene::loadedUrl).str(), "");
}

TEST_F(FetchedDocuments, AnInlineIsFilledOnceItHasCome) {
    ASSERT_TRUE(loadText("#X3D V4.0 utf8\nDEF I Inline { load FALSE url \"https://h/a.x3dv\" }"));
    file("a.x3dv", "DEF J Inline { url \"b.x3dv\" }");
    file("b.x3dv", "DEF T Transform { }");
    fetcher->awaited = {"https://h/a.x3dv", "https://h/b.x3dv"};
    BuildOptions options;
    options.resources = Resources({}, policy);
    InlineLoader loader(scene, diagnostics, options);
    loader.update();
    EXPECT_FALSE(loader.awaits());
    ASSERT_TRUE(scene.set(at({"I"}), x3d::Inline::load, true));
    scene.newFrame(1);
    EXPECT_EQ(loader.update(), 0U);
    EXPECT_TRUE(loader.awaits());
    EXPECT_THAT(fetcher->asked, IsEmpty()) << "it would have waited";
    EXPECT_EQ(problems(), "");
    fetcher->awaited.erase("https://h/a.x3dv");
    EXPECT_EQ(loader.update(), 1U);
    scene.newFrame(2);
    EXPECT_TRUE(at({"I", "J"}));
    EXPECT_FALSE(at({"I", "J", "T"})) << "the inner one waits in turn";
    EXPECT_EQ(loader.update(), 0U);
    EXPECT_TRUE(loader.awaits());
    fetcher->awaited.clear();
    EXPECT_EQ(loader.update(), 1U);
    EXPECT_TRUE(at({"I", "J", "T"}));
    scene.newFrame(3);
    loader.update();
    EXPECT_FALSE(loader.awaits());
    EXPECT_EQ(problems(), "");
}

TEST_F(FetchedDocuments, WhatWasThereStaysUntilThen) {
    ASSERT_TRUE(loadText("#X3D V4.0 utf8\nDEF I Inline { url \"https://h/a.x3dv\" }"));
    EXPECT_THAT(problems(), HasSubstr("404"));
    file("a.x3dv", "DEF A Transform { }");
    file("b.x3dv", "DEF B Transform { }");
    BuildOptions options;
    options.resources = Resources({}, policy);
    InlineLoader loader(scene, diagnostics, options);
    ASSERT_TRUE(scene.set(at({"I"}), x3d::Inline::url, Array<String>{String("https://h/a.x3dv"), String("x")}));
    scene.newFrame(1);
    loader.update();
    EXPECT_TRUE(at({"I", "A"}));
    scene.newFrame(2);
    loader.update();
    fetcher->awaited = {"https://h/b.x3dv"};
    ASSERT_TRUE(scene.set(at({"I"}), x3d::Inline::url, Array<String>{String("https://h/b.x3dv")}));
    scene.newFrame(3);
    loader.update();
    EXPECT_TRUE(at({"I", "A"}));
    fetcher->awaited.clear();
    loader.update();
    EXPECT_FALSE(at({"I", "A"}));
    EXPECT_TRUE(at({"I", "B"}));
}

TEST_F(FetchedDocuments, ALoadSensorTellsOfEachThatComes) {
    using S = x3d::LoadSensor;
    file("a.x3dv", "Group { }");
    fetcher->files["https://h/p.png"] = "picture";
    fetcher->awaited = {"https://h/a.x3dv", "https://h/p.png"};
    ASSERT_TRUE(loadText(
        "#X3D V4.0 utf8\nDEF S LoadSensor { children [ DEF I Inline { load FALSE url \"https://h/a.x3dv\" }"
        " DEF P ImageTexture { url \"https://h/p.png\" } ] }\nShape { appearance Appearance { texture USE P } }"));
    BuildOptions options;
    options.resources = Resources({}, policy);
    InlineLoader loader(scene, diagnostics, options);
    ASSERT_TRUE(scene.set(at({"I"}), x3d::Inline::load, true));
    double t = 0;
    const auto frame = [&] {
        scene.newFrame(t += 0.1);
        loader.update();
        scene.newFrame(t += 0.1);
        return scene.node(at({"S"})).get(S::progress);
    };
    const auto isActive = [&] { return scene.node(at({"S"})).get(S::isActive); };
    EXPECT_EQ(frame(), 0);
    EXPECT_EQ(frame(), 0);
    EXPECT_TRUE(isActive());
    EXPECT_THAT(fetcher->asked, IsEmpty());
    fetcher->awaited.erase("https://h/p.png");
    frame();
    EXPECT_EQ(frame(), 0.5F);
    EXPECT_TRUE(isActive());
    fetcher->awaited.clear();
    frame();
    EXPECT_EQ(frame(), 1);
    EXPECT_FALSE(isActive());
    EXPECT_TRUE(scene.node(at({"S"})).get(S::isLoaded));
}

TEST_F(FetchedDocuments, WhoeverServesMayWaitForAllThatIsNamed) {
    fetcher->files["https://h/p.png"] = "x";
    fetcher->awaited = {"https://h/p.png"};
    ASSERT_TRUE(
        loadText("#X3D V4.0 utf8\nShape { appearance Appearance { texture ImageTexture { url "
                 "\"https://h/p.png\" } } }"));
    BuildOptions options;
    options.resources = Resources({}, policy);
    InlineLoader loader(scene, diagnostics, options);
    EXPECT_TRUE(loader.fetchAhead());
    EXPECT_TRUE(loader.fetchAhead());
    fetcher->awaited.clear();
    EXPECT_FALSE(loader.fetchAhead());
    EXPECT_FALSE(loader.awaits());
}

TEST_F(FetchedDocuments, WhatNodesNameIsFetchedAhead) {
    for (const char* name : {"p.png", "s.wav", "sky.png"}) fetcher->files[std::string("https://h/") + name] = "x";
    ASSERT_TRUE(
        loadText("#X3D V4.0 utf8\nShape { appearance Appearance { texture ImageTexture { url [ \"none.png\" "
                 "\"https://h/p.png\" \"https://h/other.png\" ] } } }\nBackground { frontUrl \"https://h/sky.png\" }\n"
                 "Anchor { url \"https://h/elsewhere.x3d\" }\nShape { appearance Appearance { texture ImageTexture { "
                 "load FALSE url \"https://h/later.png\" } } }"));
    BuildOptions options;
    options.resources = Resources({}, policy);
    InlineLoader loader(scene, diagnostics, options);
    scene.newFrame(1);
    loader.update();
    EXPECT_THAT(fetcher->asked, testing::UnorderedElementsAre("https://h/p.png", "https://h/sky.png"));
    fetcher->asked.clear();
    scene.newFrame(2);
    loader.update();
    EXPECT_THAT(fetcher->asked, IsEmpty());
}

}  // namespace
}  // namespace rtsg
