// The process's limit of memory: what is held is what the system counts, and who asks for more is refused.
#include <fstream>

#include <gmock/gmock.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/resource.h>

#include "support/resident_bytes.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

/// Leaves the limit as it was.
struct Limited {
    explicit Limited(std::uint64_t bytes) { setMemoryLimit(bytes); }
    ~Limited() { setMemoryLimit(before); }
    Limited(const Limited&) = delete;
    Limited& operator=(const Limited&) = delete;
    const std::uint64_t before = memoryLimit();
};

TEST(Memory, HeldIsWhatTheSystemCounts) {
    const std::uint64_t before = heldMemory();
    EXPECT_NEAR(static_cast<double>(before), static_cast<double>(test::residentBytes()), 8e6);
    constexpr std::size_t size = std::size_t{64} << 20;
    std::string much(size, 'x');
    EXPECT_GE(heldMemory(), before + size / 2);
    // Memory that is reserved and not used does not count.
    const std::uint64_t now = heldMemory();
    void* const reserved = std::malloc(size);
    EXPECT_LT(heldMemory(), now + size / 2);
    std::free(reserved);
    EXPECT_EQ(much.back(), 'x');
}

TEST(Memory, MoreThanTheLimitIsRefused) {
    EXPECT_TRUE(mayHold());
    EXPECT_GT(memoryLimit(), std::uint64_t{1} << 28);
    const Limited limited(heldMemory() + (std::uint64_t{64} << 20));
    EXPECT_TRUE(mayHold(std::uint64_t{16} << 20));
    const auto refused = mayHold(std::uint64_t{512} << 20);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, DiagnosticCode("memory"));
    EXPECT_THAT(refused.error().text, testing::HasSubstr("--limit memory=N"));
    EXPECT_FALSE(mayHold(UINT64_MAX));
}

TEST(Memory, UrlsAreNotReadBeyondIt) {
    const test::TempFolder folder;
    std::ofstream(folder / "a.txt") << std::string(1 << 20, 'x');
    const Resources resources(folder.path());
    auto file = resources.open(folder.path(), "a.txt");
    ASSERT_TRUE(file);
    const Limited limited(heldMemory());
    const auto text = file->read();
    ASSERT_FALSE(text);
    EXPECT_EQ(text.error().code, DiagnosticCode("memory"));
    const auto data = resources.open(folder.path(), "data:," + std::string(std::size_t{64} << 20, 'x'));
    ASSERT_FALSE(data);
    EXPECT_EQ(data.error().code, DiagnosticCode("memory"));
}

}  // namespace
}  // namespace rtsg
