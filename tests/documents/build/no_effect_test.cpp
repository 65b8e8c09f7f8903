// Types that hold their fields and do nothing are named once a file, with the line of the first.
#include <fstream>

#include <gmock/gmock.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(WithoutEffect, IsNamedOnceAFileWithItsLine) {
    const test::TempFolder folder;
    const auto write = [&](const char* name, const char* text) {
        std::ofstream(folder.path() / name, std::ios::binary) << "#X3D V4.0 utf8\n" << text;
    };
    write("main.x3dv",
          "Shape { appearance Appearance { shaders [\n  DEF FIRST ComposedShader { inputOutput SFFloat x 1 }\n"
          "  ComposedShader { inputOutput SFInt32 y 1 }\n  PackagedShader { }\n  ProgramShader { } ] } }\n"
          "PROTO P [ ] { Shape { geometry PointSet { attrib [ FloatVertexAttribute { } Matrix3VertexAttribute { } "
          "Matrix4VertexAttribute { } ] } } }\nP { } P { }\nInline { url \"part.x3dv\" }\nDEF CUT NurbsSet { }");
    write("part.x3dv", "Group { }\nShape { appearance Appearance { shaders ComposedShader { } } }");
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, folder.path() / "main.x3dv", diagnostics));
    const std::string all = test::allText(diagnostics);
    EXPECT_EQ(diagnostics.all().size(), 8u) << all;
    EXPECT_THAT(all, HasSubstr("main.x3dv:3:3: warning: ComposedShader FIRST has no effect: shaders are not run"));
    EXPECT_THAT(all, HasSubstr("main.x3dv:5:3: warning: PackagedShader has no effect"));
    EXPECT_THAT(all, HasSubstr("main.x3dv:6:3: warning: ProgramShader has no effect"));
    EXPECT_THAT(all, HasSubstr("main.x3dv:7:"));
    for (const char* type : {"FloatVertexAttribute", "Matrix3VertexAttribute", "Matrix4VertexAttribute"})
        EXPECT_THAT(all, HasSubstr(std::string(type) + " has no effect: it is for shaders"));
    EXPECT_THAT(all, HasSubstr("part.x3dv:3:"));
    EXPECT_THAT(all, HasSubstr("main.x3dv:10:1: warning: NurbsSet CUT has no effect"));
}

TEST(WithoutEffect, IsNotSaidOfAProtoOfThatName) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene, "#X3D V3.0 utf8\nPROTO ComposedShader [ ] { Group { } } ComposedShader { }", diagnostics));
    EXPECT_THAT(test::allText(diagnostics), Not(HasSubstr("has no effect")));
}

}  // namespace
}  // namespace rtsg
