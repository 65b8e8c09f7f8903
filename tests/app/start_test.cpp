// The libraries that the program loads when it starts: a verb waits only for those it uses.
#include <cmath>
#include <cstring>
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

/// The variable is set for programs that start during the object's life.
class Variable {
  public:
    Variable(const char* name, const char* value) : name_(name) { ::setenv(name, value, 1); }
    ~Variable() { ::unsetenv(name_); }
    Variable(const Variable&) = delete;
    Variable& operator=(const Variable&) = delete;

  private:
    const char* name_;
};

TEST(Start, AVariableKeepsFromHigherInstructionSets) {
    const TempFolder folder;
    for (const char* name : {"sse2", "avx2"}) {
        const Variable limit("RTSG_MAX_ISA", name);
        const Outcome version = Program({"--version", "--json"}, folder / "version").wait();
        EXPECT_EQ(version.status, 0) << version.err;
        EXPECT_NE(version.out.find("\"avx512\":false"), std::string::npos) << version.out;
    }
    const Variable unknown("RTSG_MAX_ISA", "mmx");
    const Outcome refused = Program({"keys"}, folder / "refused").wait();
    EXPECT_EQ(refused.status, 2);
    EXPECT_NE(refused.err.find("RTSG_MAX_ISA is \"mmx\"; it may be sse2, avx2 or avx512"), std::string::npos)
        << refused.err;
}

std::vector<float> floatsOfPfm(const std::string& file) {
    const std::string bytes = readFile(file);
    std::size_t begin = 0;
    for (int line = 0; line < 3; ++line) begin = bytes.find('\n', begin) + 1;
    std::vector<float> result((bytes.size() - begin) / sizeof(float));
    std::memcpy(result.data(), bytes.data() + begin, result.size() * sizeof(float));
    return result;
}

TEST(Start, PicturesOfHigherInstructionSetsDifferByRounding) {
    const TempFolder folder;
    const std::string hall = RTSG_SOURCE_DIR "/examples/demo/hall.x3dv";
    const auto draw = [&](const std::string& integrator, const char* highest) {
        const Variable limit("RTSG_MAX_ISA", highest);
        const std::string file = folder / (integrator + highest + ".pfm");
        const Outcome drawn =
            Program({"render", hall, "-o", file, "--size", "96x54", "--integrator", integrator, "--spp", "1"},
                    folder / "render")
                .wait();
        EXPECT_EQ(drawn.status, 0) << drawn.err;
        return floatsOfPfm(file);
    };
    for (const char* integrator : {"whitted", "path"}) {
        const std::vector<float> low = draw(integrator, "sse2"), high = draw(integrator, "avx512");
        ASSERT_EQ(low.size(), 96u * 54 * 3);
        ASSERT_EQ(high.size(), low.size());
        std::size_t differ = 0;
        for (std::size_t i = 0; i < low.size(); ++i)
            differ += std::abs(low[i] - high[i]) > 1e-5F * (1 + std::abs(low[i]));
        // A ray that meets an edge may take either side of it.
        EXPECT_LE(differ, low.size() / 200) << integrator;
    }
}

#if defined(__x86_64__)
TEST(Start, OlderProcessorsAreToldWhatIsMissing) {
    const TempFolder folder;
    const std::string command =
        "qemu-x86_64-static -cpu Nehalem " RTSG_PROGRAM " --version >" + (folder / "out") + " 2>&1";
    const int status = std::system(command.c_str());
    if (WEXITSTATUS(status) == 127) GTEST_SKIP() << "qemu-x86_64-static (qemu-user-static) is not here";
    const std::string said = readFile(folder / "out");
#if defined(__AVX2__)
    EXPECT_EQ(WEXITSTATUS(status), 1) << said;
    EXPECT_NE(said.find("needs a processor with AVX2"), std::string::npos) << said;
#else
    EXPECT_EQ(WEXITSTATUS(status), 0) << said;
    EXPECT_TRUE(said.starts_with("rtsg ")) << said;
#endif
}
#endif

}  // namespace
}  // namespace rtsg
