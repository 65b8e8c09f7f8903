// The end of a program, for every reason: a new url, a scene that starts over or ends, a node that is destroyed.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/scripts/run_scripts.h>

#include "script_scene.h"

namespace rtsg {
namespace {

using test::ScriptScene;

TEST(ScriptShutdown, ShutdownIsCalledWheneverAProgramEnds) {
    const std::string program = "function shutdown() { print('bye'); }";
    std::string printed;
    {
        ScriptOptions options;
        options.print = [&](std::string_view text) { printed += text; };
        Scene scene;
        runScripts(scene, options);
        Diagnostics diagnostics;
        const std::string text = "#X3D V4.0 utf8\nDEF S Script { url \"ecmascript:" + program + "\" }";
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        scene.newFrame(0);
        EXPECT_EQ(printed, "");
        ASSERT_TRUE(scene.sendEvent(scene.findName("S"), x3d::Script::url.index,
                                    Value(Array<String>{String("ecmascript:" + program)})));
        scene.newFrame(1);
        EXPECT_EQ(printed, "bye\n") << "the url has changed";
        ASSERT_TRUE(scene.reset());
        EXPECT_EQ(printed, "bye\nbye\n") << "the scene starts over";
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        scene.newFrame(2);
    }
    EXPECT_EQ(printed, "bye\nbye\nbye\n") << "the scene is gone";
}

TEST(ScriptShutdown, ADestroyedScriptShutsDownWithoutTouchingTheScene) {
    ScriptScene s("outputOnly SFInt32 n", "function shutdown() { print('bye'); n = 3; }");
    s.frame();
    ASSERT_TRUE(s.scene.destroyNode(s.script()));
    s.frame();
    EXPECT_EQ(s.printed, "bye\n");
}

TEST(ScriptShutdown, WhatFailsInShutdownIsTold) {
    const std::string fails = "function shutdown() { throw new Error('too late'); }";
    ScriptScene destroyed("", fails);
    destroyed.frame();
    ASSERT_TRUE(destroyed.scene.destroyNode(destroyed.script()));
    EXPECT_THAT(destroyed.problems(), testing::HasSubstr("too late"));

    ScriptScene changed("", fails);
    changed.frame();
    ASSERT_TRUE(changed.scene.sendEvent(changed.script(), x3d::Script::url.index, Value(Array<String>{})));
    changed.frame();
    EXPECT_THAT(changed.problems(), testing::HasSubstr("too late"));

    ScriptScene ended("", "function shutdown() { for (;;) ; }");
    ended.frame();
    ScriptOptions none;
    none.enabled = false;
    ended.scene.setScriptOptions(none);
    EXPECT_THAT(ended.problems(), testing::HasSubstr("it ran longer than"));
}

}  // namespace
}  // namespace rtsg
