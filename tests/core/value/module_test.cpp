// Libraries that are loaded by the first call, and modules that are not there.
#include <stdexcept>
#include <string_view>

#include <gtest/gtest.h>

#include <rtsg/core/module.h>

#ifdef RTSG_HAS_STUBS
extern "C" double rtsg_absent_sum(int a, double b);  // a stub of a library whose module is nowhere
#endif

namespace rtsg {
namespace {

DelayedLibrary::Stubs stubsOf(const char* module, void** functions) {
    return {.module = module, .table = "rtsg_table", .need = "ghosts need", .functions = functions, .functionCount = 1};
}

TEST(Module, OneThatIsMissingIsNamedWithWhatNeedsIt) {
    const auto found = loadModule("rtsg_no_such", "symbol", "ghosts need");
    ASSERT_FALSE(found);
    EXPECT_TRUE(found.error().text.starts_with("ghosts need the module librtsg_no_such.so: ")) << found.error().text;
}

TEST(DelayedLibrary, SaysEachTimeThatItIsMissing) {
    void* functions[1] = {};
    DelayedLibrary library(stubsOf("rtsg_no_such", functions));
    for (int i = 0; i < 2; ++i) {
        const auto loaded = library.load();
        ASSERT_FALSE(loaded);
        EXPECT_TRUE(loaded.error().text.starts_with("ghosts need the module librtsg_no_such.so: "))
            << loaded.error().text;
    }
    EXPECT_EQ(functions[0], nullptr);
    EXPECT_FALSE(library.hasEnded());
}

TEST(DelayedLibrary, IsThereWhereItIsLinked) {
    DelayedLibrary library({});
    EXPECT_TRUE(library.load());
}

#ifdef RTSG_HAS_STUBS
TEST(DelayedLibrary, ACallOfAMissingOneThrowsTheReasonEachTime) {
    for (int i = 0; i < 2; ++i) {
        try {
            FAIL() << rtsg_absent_sum(1, 2);
        } catch (const std::runtime_error& error) {
            EXPECT_TRUE(std::string_view(error.what()).starts_with("ghosts need the module librtsg_absent.so: "))
                << error.what();
        }
    }
}
#endif

}  // namespace
}  // namespace rtsg
