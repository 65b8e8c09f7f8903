// Where a Script's program comes from: its url, files that are read again, and what is said where there is none.
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/web_address.h>
#include <rtsg/documents/world.h>

#include "script_scene.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

class ScriptUrl : public testing::Test {
  protected:
    void file(const std::string& name, const std::string& text) const { std::ofstream(folder_.path() / name) << text; }
    /// A world with a Script S.
    void start(const std::string& fields) {
        ScriptOptions options;
        options.print = [this](std::string_view text) { printed_ += text; };
        runScripts(scene_, options);
        file("start.x3dv", "#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { " + fields + " }\n");
        Diagnostics diagnostics;
        ASSERT_TRUE(loadWorld(scene_, folder_.path() / "start.x3dv", diagnostics));
        scene_.newFrame(0);
    }
    /// The output from now on, in frames of a quarter of a second up to `end`.
    std::string until(double end) {
        printed_.clear();
        while (scene_.now() < end) scene_.newFrame(scene_.now() + 0.25);
        return printed_;
    }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene_.diagnostics().all()) text += d.text + '\n';
        return text;
    }

    test::TempFolder folder_;
    std::string printed_;  // outlives the scene
    Scene scene_;
};

const char* const kSays = "function initialize() { print('one'); } function shutdown() { print('over'); }";

TEST_F(ScriptUrl, AFileIsReadAgainAsOftenAsItsScriptSays) {
    file("a.js", kSays);
    start("autoRefresh 1 autoRefreshTimeLimit 4 url \"a.js\"");
    EXPECT_EQ(printed_, "one\n");
    EXPECT_EQ(until(0.75), "");
    file("a.js", "function initialize() { print('two'); }");
    EXPECT_EQ(until(1), "over\ntwo\n");
    EXPECT_EQ(until(1.75), "");
    std::filesystem::remove(folder_.path() / "a.js");
    EXPECT_EQ(until(2.5), "") << "what cannot be read goes on";
    file("a.js", kSays);
    EXPECT_EQ(until(3), "one\n");
    EXPECT_EQ(until(9), "over\none\n") << "only up to the limit";
    EXPECT_EQ(problems(), "");
}

TEST_F(ScriptUrl, RefreshingBeginsAndEndsWithItsField) {
    file("a.js", kSays);
    start("url \"a.js\"");
    EXPECT_EQ(until(3), "");
    ASSERT_TRUE(sendFieldText(scene_, "S.autoRefresh", "1"));
    EXPECT_EQ(until(5.25), "over\none\nover\none\n");
    ASSERT_TRUE(sendFieldText(scene_, "S.autoRefresh", "0"));
    EXPECT_EQ(until(9), "");
    ASSERT_TRUE(setFieldText(scene_, "S.autoRefresh", "2"));  // an edit
    EXPECT_EQ(until(11), "");
    EXPECT_EQ(until(11.25), "over\none\n");
}

TEST_F(ScriptUrl, AProgramInItsUrlIsNeverReadAgain) {
    start(std::string("autoRefresh 1 url \"ecmascript:") + kSays + "\"");
    EXPECT_EQ(until(3), "");
}

TEST_F(ScriptUrl, AFileThatComesLaterIsReadThen) {
    start("autoRefresh 1 url \"a.js\"");
    EXPECT_THAT(problems(), testing::HasSubstr("'a.js' is not there"));
    EXPECT_EQ(until(1.5), "");
    file("a.js", kSays);
    EXPECT_EQ(until(2), "one\n");
}

TEST_F(ScriptUrl, LoadSaysWhetherThereIsAProgram) {
    start(std::string("load FALSE url \"ecmascript:") + kSays + "\"");
    EXPECT_EQ(printed_, "");
    ASSERT_TRUE(sendFieldText(scene_, "S.load", "TRUE"));
    EXPECT_EQ(until(0.5), "one\n");
    ASSERT_TRUE(sendFieldText(scene_, "S.load", "FALSE"));
    EXPECT_EQ(until(1), "over\n");
    EXPECT_EQ(problems(), "");
}

TEST_F(ScriptUrl, AProgramWithoutItsSchemeIsNamed) {
    start("url \"function initialize() { print('one'); }\"");
    EXPECT_EQ(printed_, "");
    EXPECT_THAT(problems(), testing::HasSubstr("(a program in an url begins with ecmascript:)"));
}

TEST(ScriptUrls, ProgramsAndHints) {
    EXPECT_EQ(programInUrl("ecmascript: a"), " a");
    EXPECT_EQ(programInUrl(" \n ECMAScript:a"), "a");
    EXPECT_EQ(programInUrl("JavaScript:"), "");
    EXPECT_EQ(programInUrl("vrmlscript:a"), "a");
    for (const char* none : {"", "  ", "a.js", "ecmascript", "file:///ecmascript:a",
                             "ecma\x13"
                             "cript:"})
        EXPECT_EQ(programInUrl(none), std::nullopt) << none;
    for (const char* program : {"function initialize() { }", "var a = 1;", "print(1)\nprint(2)"})
        EXPECT_NE(hintForProgram(program), "") << program;
    for (const char* file : {"", "a.js", "a (1).js", "http://a/b;c?d={e}", "data:text/plain;base64,aaaa"})
        EXPECT_EQ(hintForProgram(file), "") << file;
}

}  // namespace
}  // namespace rtsg
