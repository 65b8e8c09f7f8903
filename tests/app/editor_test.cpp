// rtsg validate --lsp, as an editor starts it.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "program.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Editor : public CommandLine {
  protected:
    static std::string framed(const json& message) {
        const std::string text = message.dump();
        return fmt::format("Content-Length: {}\r\n\r\n{}", text.size(), text);
    }
};

TEST_F(Editor, IsServedOverStandardInputAndOutput) {
    const json params = {
        {"textDocument",
         {{"uri", "file://" + folder.path().string() + "/a.x3dv"},
          {"version", 3},
          {"text", "#X3D V4.0 utf8\nPROFILE Immersive\nScript { url \"ecmascript: function (\" }\n"}}}};
    const Outcome served =
        rtsg({"validate", "--lsp"}, framed({{"id", 1}, {"method", "initialize"}}) +
                                        framed({{"method", "textDocument/didOpen"}, {"params", params}}) +
                                        framed({{"id", 2}, {"method", "shutdown"}}) + framed({{"method", "exit"}}));
    EXPECT_EQ(served.status, 0) << served.err;
    EXPECT_EQ(served.err, "");
    EXPECT_THAT(served.out, HasSubstr("hoverProvider"));
}

TEST_F(Editor, WhatIsNoEditorIsToldSo) {
    const Outcome served = rtsg({"validate", "--lsp"}, "#X3D V4.0 utf8\n\r\n\r\n");
    EXPECT_EQ(served.status, 1);
    EXPECT_THAT(served.err, HasSubstr("a message has no Content-Length [editor]"));
    EXPECT_EQ(rtsg({"validate", "--lsp", file}).status, 2);
    EXPECT_EQ(rtsg({"validate"}).status, 2);
}

}  // namespace
}  // namespace rtsg::test
