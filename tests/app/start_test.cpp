// The libraries that the program loads when it starts: a verb waits only for those it uses.
#include <sstream>

#include "program.h"

namespace rtsg {
namespace {

using namespace test;

TEST(Start, ImageFilesComeAsAModuleWhenTheFirstIsAskedFor) {
    const TempFolder folder;
    ::setenv("LD_TRACE_LOADED_OBJECTS", "1", 1);  // the dynamic linker lists what it would load
    const Outcome listed = Program({"--version"}, folder / "list").wait();
    ::unsetenv("LD_TRACE_LOADED_OBJECTS");
    EXPECT_EQ(listed.out.find("OpenImageIO"), std::string::npos) << listed.out;
    std::istringstream lines(listed.out);
    int libraries = 0;
    for (std::string line; std::getline(lines, line);) ++libraries;
    EXPECT_GT(libraries, 5) << listed.out;
    EXPECT_LT(libraries, 80) << listed.out;

    writeFile(folder / "s.x3dv", "#X3D V4.0 utf8\nPROFILE Interchange\nShape { geometry Box { } }\n");
    const auto draw = [&](const std::string& file) {
        ::setenv("LD_DEBUG", "files", 1);  // the dynamic linker tells what it loads, on stderr
        const Outcome drawn =
            Program({"render", folder / "s.x3dv", "-o", folder / file, "--size", "16x16"}, folder / "render").wait();
        ::unsetenv("LD_DEBUG");
        EXPECT_EQ(drawn.status, 0) << drawn.err;
        return drawn.err.find("OpenImageIO") != std::string::npos;
    };
    for (const char* name : {"s.png", "s.jpg", "s.jpeg"}) EXPECT_FALSE(draw(name)) << name;
    // These by modules that a build has if their libraries' headers are there.
    for (const auto& [name, module] : {std::pair("s.exr", "librtsg_exr.so"), std::pair("s.webp", "librtsg_webp.so")})
        EXPECT_EQ(draw(name), !std::filesystem::exists(std::filesystem::path(RTSG_PROGRAM).parent_path() / module))
            << name;
    EXPECT_TRUE(readFile(folder / "s.png").starts_with("\x89PNG"));
    EXPECT_TRUE(draw("s.tif"));
}

}  // namespace
}  // namespace rtsg
