// PagedArray: an array with cheap versions: a version costs one pointer, and a later change copies the path to its
// page.
//
//     PagedArrayWriter<int> numbers;  numbers.resize(1000);
//     const PagedArray<int> before = numbers.freeze();      // keeps what it is
//     numbers.change(7) = 1;                                // copies the page that `before` shares, and no other
//
// The array is a tree of pages. The writer changes pages in place that belong to no version, and copies others, so a
// version never changes and any thread may read it while the writer goes on. Elements that were never changed are T{}.
// Light and sound keep their tables in such arrays; rays read another kind of pages (src/trees/paged.h). Threading: the
// writer on one thread; versions on any number.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace rtsg {

/// A page has 2^kLeafBits elements: choose few if they are large, or if changes are scattered.
template <class T, unsigned kLeafBits = 4>
class PagedArray {
  public:
    std::size_t size() const { return size_; }
    /// Precondition: at < size().
    const T& operator[](std::size_t at) const {
        const T* items = page(at);
        return items ? items[at % kLeaf] : none();
    }

    /// The page that holds an element, for looking up many; null if none of its elements was changed. It lives as long
    /// as this version. Precondition: at < size().
    const T* page(std::size_t at) const {
        const Node* node = root_.get();
        for (unsigned level = levels_; level > 0 && node; --level)
            node = static_cast<const Inner*>(node)->children[childOf(at, level)].get();
        return node ? static_cast<const Leaf*>(node)->items.data() : nullptr;
    }
    static constexpr std::size_t kPerPage = std::size_t{1} << kLeafBits;

    /// Calls visit(index, in a, in b) for every element on a page that the two do not share; elements beyond the end
    /// are T{}. The time follows the number of pages that differ.
    template <class Visit>
    static void differences(const PagedArray& a, const PagedArray& b, const Visit& visit) {
        compare(a.root_.get(), a.levels_, b.root_.get(), b.levels_, 0, visit);
    }

  protected:
    static constexpr unsigned kFanBits = 5;
    static constexpr std::size_t kLeaf = kPerPage, kFan = 1 << kFanBits;
    struct Node {
        explicit Node(std::uint64_t e) : epoch(e) {}
        std::uint64_t epoch;  // of the writer when it made the node
    };
    struct Leaf : Node {
        using Node::Node;
        std::array<T, kLeaf> items{};
    };
    struct Inner : Node {
        using Node::Node;
        std::array<std::shared_ptr<Node>, kFan> children{};
    };

    static const T& none() {
        static const T value{};
        return value;
    }
    /// Elements below one child of a node at this level.
    static std::size_t span(unsigned level) { return kLeaf << (kFanBits * (level - 1)); }
    static std::size_t childOf(std::size_t at, unsigned level) {
        return (at >> (kLeafBits + kFanBits * (level - 1))) % kFan;
    }

    template <class Visit>
    static void compare(const Node* a, unsigned levelA, const Node* b, unsigned levelB, std::size_t first,
                        const Visit& visit) {
        if (a == b && (levelA == levelB || !a)) return;
        const unsigned level = std::max(levelA, levelB);
        if (level == 0) {
            for (std::size_t i = 0; i < kLeaf; ++i)
                visit(first + i, a ? static_cast<const Leaf*>(a)->items[i] : none(),
                      b ? static_cast<const Leaf*>(b)->items[i] : none());
            return;
        }
        // A lower tree is the first child of the tree that would be higher.
        const auto child = [&](const Node* node, unsigned own, std::size_t i) -> const Node* {
            if (own < level) return i == 0 ? node : nullptr;
            return node ? static_cast<const Inner*>(node)->children[i].get() : nullptr;
        };
        for (std::size_t i = 0; i < kFan; ++i)
            compare(child(a, levelA, i), levelA < level && i == 0 ? levelA : level - 1, child(b, levelB, i),
                    levelB < level && i == 0 ? levelB : level - 1, first + i * span(level), visit);
    }

    std::shared_ptr<Node> root_;
    unsigned levels_ = 0;  // 0: the root is a leaf
    std::size_t size_ = 0;
};

template <class T, unsigned kLeafBits = 4>
class PagedArrayWriter : private PagedArray<T, kLeafBits> {
    using Base = PagedArray<T, kLeafBits>;
    using Base::root_, Base::levels_, Base::size_;
    using typename Base::Inner, typename Base::Leaf, typename Base::Node;

  public:
    using Base::size, Base::operator[];

    /// Makes the array larger, never smaller.
    void resize(std::size_t elements) {
        size_ = std::max(size_, elements);
        while (size_ > (levels_ == 0 ? Base::kLeaf : Base::kFan * Base::span(levels_))) {
            if (root_) {
                auto above = std::make_shared<Inner>(epoch_);
                above->children[0] = std::move(root_);
                root_ = std::move(above);
            }
            ++levels_;
        }
    }
    /// Returns an element for writing. Precondition: at < size().
    T& change(std::size_t at) {
        std::shared_ptr<Node>* link = &root_;
        for (unsigned level = levels_; level > 0; --level) link = &own<Inner>(*link).children[Base::childOf(at, level)];
        return own<Leaf>(*link).items[at % Base::kLeaf];
    }
    /// Returns a version: the array as it is now.
    PagedArray<T, kLeafBits> freeze() {
        ++epoch_;
        return *this;
    }
    /// Returns the present array for immediate reading: the next change may change it, too.
    const PagedArray<T, kLeafBits>& now() const { return *this; }

  private:
    template <class N>
    N& own(std::shared_ptr<Node>& link) {
        if (!link) {
            link = std::make_shared<N>(epoch_);
        } else if (link->epoch != epoch_) {
            auto copy = std::make_shared<N>(static_cast<const N&>(*link));
            copy->epoch = epoch_;
            link = std::move(copy);
        }
        return static_cast<N&>(*link);
    }

    std::uint64_t epoch_ = 1;
};

}  // namespace rtsg
