// Arrays: sharing, copying on write, padding.
#include <rtsg/core/array.h>

#include <gtest/gtest.h>

#include <thread>
#include <vector>

using namespace rtsg;

namespace {

struct Counted {
    static inline int alive = 0;
    int value = 0;
    Counted(int v = 0) : value(v) { ++alive; }
    Counted(const Counted& o) : value(o.value) { ++alive; }
    Counted& operator=(const Counted&) = default;
    ~Counted() { --alive; }
    friend bool operator==(const Counted&, const Counted&) = default;
};

}  // namespace

TEST(Array, EmptyIsANullPointer) {
    const Array<float> a;
    EXPECT_EQ(a.header(), nullptr);
    EXPECT_TRUE(a.empty());
    EXPECT_EQ(a.span().size(), 0u);
    EXPECT_EQ(a, Array<float>::ofSize(0));
    EXPECT_EQ(sizeof(a), sizeof(void*));
}

TEST(Array, WritingCopiesWhatIsShared) {
    Array<int> a{1, 2, 3};
    const Array<int> b = a;
    EXPECT_TRUE(a.sameStorage(b));
    a.mutableData()[1] = 20;
    a.push_back(4);
    EXPECT_EQ(b, (Array<int>{1, 2, 3}));
    EXPECT_EQ(a, (Array<int>{1, 20, 3, 4}));
    EXPECT_FALSE(a == b);
}

TEST(Array, SoleOwnerWritesInPlace) {
    Array<int> a{1, 2, 3};
    const int* before = a.data();
    EXPECT_EQ(a.mutableData(), before);
}

TEST(Array, InsertAndErase) {
    Array<int> a{1, 3};
    a.insert(1, 2);
    a.insert(0, 0);
    a.insert(4, 4);
    EXPECT_EQ(a, (Array<int>{0, 1, 2, 3, 4}));
    const Array<int> shared = a;
    for (const std::size_t index : {0, 3}) a.erase(index);
    EXPECT_EQ(a, (Array<int>{1, 2, 3}));
    EXPECT_EQ(shared.size(), 5u);
}

TEST(Array, SixteenZeroBytesFollow) {
    for (std::size_t n : {1u, 2u, 3u, 4u, 5u, 7u, 100u}) {
        Array<float> a;
        for (std::size_t i = 0; i < n; ++i) a.push_back(1.f);
        a.push_back(5.f);
        a.resize(n);
        const auto* tail = reinterpret_cast<const unsigned char*>(a.end());
        for (int i = 0; i < 16; ++i) EXPECT_EQ(tail[i], 0) << "n " << n << " byte " << i;
    }
}

TEST(Array, ElementsAreAlignedTo16) {
    for (int i = 0; i < 20; ++i) {
        const auto a = Array<char>::ofSize(static_cast<std::size_t>(i) * 7 + 1);
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(a.data()) % 16, 0u);
    }
}

TEST(Array, ConstructsAndDestroysEveryElementOnce) {
    Counted::alive = 0;
    {
        Array<Counted> a;
        for (int i = 0; i < 100; ++i) a.push_back(i);
        EXPECT_EQ(Counted::alive, 100);
        Array<Counted> b = a;
        EXPECT_EQ(Counted::alive, 100);
        b.resize(10);
        EXPECT_EQ(a.size(), 100u);
        EXPECT_EQ(b.size(), 10u);
        EXPECT_EQ(Counted::alive, 110);
        b.erase(3);
        b.insert(2, 77);
        a.resize(0);
        EXPECT_EQ(Counted::alive, 10);
        EXPECT_EQ(b[2].value, 77);
    }
    EXPECT_EQ(Counted::alive, 0);
}

TEST(Array, ShrinkingSharedCopiesOnlyWhatStays) {
    Array<Array<int>> a{{1}, {2, 3}, {4, 5, 6}};
    const Array<Array<int>> b = a;
    a.resize(1);
    EXPECT_EQ(b.size(), 3u);
    EXPECT_EQ(b[2], (Array<int>{4, 5, 6}));
    EXPECT_EQ(a[0], (Array<int>{1}));
    EXPECT_TRUE(a[0].sameStorage(b[0]));
}

TEST(Array, AbsurdSizesThrowBadAllocAndKeepTheArray) {
    Array<double> a{1, 2};
    EXPECT_THROW(a.reserve(~std::size_t{0} / 4), std::bad_alloc);
    EXPECT_EQ(a, (Array<double>{1, 2}));
}

TEST(Array, CopiesOnManyThreads) {
    const Array<int> a{1, 2, 3};
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&a] {
            for (int i = 0; i < 20000; ++i) {
                Array<int> copy = a;
                copy.push_back(i);
            }
        });
    for (auto& t : threads) t.join();
    EXPECT_EQ(a.header()->owners.load(), 1u);
}

TEST(String, ComparesAndKeepsZeroBytes) {
    const std::string text("a\0b", 3);
    const String s(text);
    EXPECT_EQ(s.size(), 3u);
    EXPECT_EQ(s.str(), text);
    EXPECT_EQ(String(""), String());
    EXPECT_FALSE(s == String("a"));
}
